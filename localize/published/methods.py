"""The published method: outlines to ellipses, ellipses to pairs of apexes, pairs to one position.

Zhou, Hennerkes et al., Robotica 2023. The needle's direction is the published one: that of the line from the RCM to
the estimated tip, whatever way the cones point. Their rotation errors are those of this line.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from conespot.localize.image import AnyImage, grey8
from conespot.localize.outcome import (
    NEAR_CIRCLE,
    NO_ELLIPSE,
    NO_INTERSECTION,
    NO_LIGHT,
    OUTSIDE,
    Localization,
    LocalizationFailure,
    Outcome,
)
from conespot.localize.published.authors_code import coded_candidates
from conespot.localize.published.cone_geometry import Array, Candidates, cone_over_ellipse, fitted_plane, retina_points
from conespot.localize.published.detection import Contour, Grey, Mask, coded_mask, contrast, otsu_mask, outlines
from conespot.localize.published.ellipse import fit_ellipse
from conespot.localize.published.ideal_pinhole import as_the_paper_sees
from conespot.localize.published.settings import PUBLISHED
from conespot.scene import Pose, Scene
from conespot.scene.pose import rot_x, rot_y


@dataclass(frozen=True, eq=False)
class Steps:
    """What a published method sees before it chooses: its mask, the outlines it cuts out, and two cones over each.

    `outlines` are pixel indices (column, row) `[N, 2]`; there may be fewer `pairs` than outlines, and none of either.
    """

    mask: Mask
    outlines: tuple[Contour, ...]
    pairs: tuple[Candidates, ...]


@dataclass(frozen=True)
class Method:
    """A published method: how it parts light from dark, an outline to candidates, and of several positions one."""

    segment: Callable[[Grey], Mask]
    reconstruct: Callable[[Array, Scene], Candidates | LocalizationFailure]
    unite: Callable[..., Array]

    def localize(self, image: AnyImage, scene: Scene, truth: Pose | None = None) -> Outcome:
        """The answer; with a `truth` the candidates nearest to it are taken."""
        grey = grey8(image, scene)
        mask = self.segment(grey)
        found = outlines(mask, len(scene.spotlights))
        if isinstance(found, LocalizationFailure):
            return found
        if contrast(grey, mask, scene) < PUBLISHED.least_contrast:
            return LocalizationFailure(NO_LIGHT)
        told = scene
        patches, scene = as_the_paper_sees(found, scene)
        pairs: list[Candidates] = []
        for patch in patches:
            pair = self.reconstruct(patch, scene)
            if isinstance(pair, LocalizationFailure):
                return pair
            pairs.append(pair)
        if truth is not None:
            positions = np.stack([_nearest(pair.apexes, truth.apex) for pair in pairs])
        elif len(pairs) == 1:
            if pairs[0].flattening < PUBLISHED.round_px * scene.camera.pixel_pitch:
                return LocalizationFailure(NEAR_CIRCLE)
            positions = from_rcm(pairs[0], scene)[None, :]
        else:
            positions = least_spread(np.stack([pair.apexes for pair in pairs]))
        apex = self.unite(positions, axis=0)
        if not told.depth(apex) > 0.0:
            # what no needle in the eye can light is no spotlight: a disc, a rim, the frame's own shading
            return LocalizationFailure(OUTSIDE)
        spread = float(np.sqrt(np.mean(np.sum((positions - positions.mean(axis=0)) ** 2, axis=-1))))
        axis = Pose.through(apex, scene.instrument.rcm).axis
        return Localization(apex, axis, spread_mm=spread if len(pairs) > 1 else None)

    def steps(self, image: AnyImage, scene: Scene) -> Steps:
        """What `localize` sees on its way, once more, to be looked at."""
        mask = self.segment(grey8(image, scene))
        found = outlines(mask, len(scene.spotlights))
        if isinstance(found, LocalizationFailure):
            return Steps(mask, (), ())
        patches, scene = as_the_paper_sees(found, scene)
        pairs = [self.reconstruct(patch, scene) for patch in patches]
        return Steps(mask, tuple(found), tuple(pair for pair in pairs if isinstance(pair, Candidates)))


def paper(image: AnyImage, scene: Scene) -> Outcome:
    """The paper's text: Otsu, Eqs. 1-7, the ellipse in the plane of the outline, Eqs. 22-24.

    One spotlight: the candidate whose cone comes from the RCM. Several: of all combinations of candidates the one of
    smallest spread, and of its positions the median of every coordinate (3.5).
    """
    return METHODS["paper"].localize(image, scene)


def paper_code(image: AnyImage, scene: Scene) -> Outcome:
    """The authors' code, with the RCM (one spotlight) or the smallest spread (several) instead of the truth.

    Of several positions the code takes the one nearest their mean.
    """
    return METHODS["paper-code"].localize(image, scene)


def paper_code_float(image: AnyImage, scene: Scene) -> Outcome:
    """`paper_code` without its cutting of the outline to whole pixels, to see what that costs."""
    return METHODS["paper-code-float"].localize(image, scene)


def paper_code_oracle(image: AnyImage, scene: Scene, truth: Pose) -> Outcome:
    """The authors' code with their answer to the ambiguity: of each pair the candidate nearest the true tip."""
    return METHODS["paper-code-oracle"].localize(image, scene, truth)


def text_candidates(outline: Array, scene: Scene) -> Candidates | LocalizationFailure:
    """Candidates for an outline `[N, 2]` of pixel indices, with the ellipse in the outline's own plane."""
    points = retina_points(scene.camera, scene.eye, outline + 0.5)
    if np.isnan(points).any():
        return LocalizationFailure(NO_INTERSECTION)
    plane = fitted_plane(points, scene.eye)
    ellipse = fit_ellipse(plane.local(points))
    if ellipse is None:
        return LocalizationFailure(NO_ELLIPSE)
    apexes, vertices = cone_over_ellipse(ellipse, scene.beam.half_angle)
    return Candidates.of(plane.world(apexes), plane.world(vertices), ellipse.a - ellipse.b)


def _integer_candidates(outline: Array, scene: Scene) -> Candidates | LocalizationFailure:
    return coded_candidates(outline, scene, whole_pixels=True)


def _float_candidates(outline: Array, scene: Scene) -> Candidates | LocalizationFailure:
    return coded_candidates(outline, scene, whole_pixels=False)


def from_rcm(pair: Candidates, scene: Scene) -> Array:
    """Of one spotlight's two candidates the apex `[3]` [mm] that fits the known insertion point.

    The cone leans against the line from the RCM to its apex by a known angle, zero unless the spotlight is offset.
    """
    spotlight = scene.spotlights[0]
    down = np.array([0.0, 0.0, -1.0])
    known = _angle(rot_y(spotlight.y) @ rot_x(spotlight.x) @ down, down)
    needle = pair.apexes - np.asarray(scene.instrument.rcm)
    return np.asarray(pair.apexes[np.argmin(np.abs(_angle(pair.axes, needle) - known))])


def least_spread(apexes: Array) -> Array:
    """Of all 2^K combinations of the candidates `[K, 2, 3]` the positions `[K, 3]` of least squared spread (3.5)."""
    count = len(apexes)
    picks = np.arange(2**count)[:, None] >> np.arange(count) & 1
    positions = apexes[np.arange(count), picks]
    spread = np.sum((positions - positions.mean(axis=1, keepdims=True)) ** 2, axis=(1, 2))
    return np.asarray(positions[np.argmin(spread)])


def _nearest(positions: Array, to: Array) -> Array:
    return np.asarray(positions[np.argmin(np.linalg.norm(positions - to, axis=-1))])


def _nearest_mean(positions: Array, axis: int) -> Array:
    return _nearest(positions, positions.mean(axis=axis))


def _angle(a: Array, b: Array) -> Array:
    cross = np.linalg.norm(np.cross(a, b), axis=-1)
    return np.arctan2(cross, np.sum(a * b, axis=-1))


_CODED = Method(coded_mask, _integer_candidates, _nearest_mean)
#: the published methods by the names of their localizers
METHODS: dict[str, Method] = {
    "paper": Method(otsu_mask, text_candidates, np.median),
    "paper-code": _CODED,
    "paper-code-float": Method(coded_mask, _float_candidates, _nearest_mean),
    "paper-code-oracle": _CODED,
}
