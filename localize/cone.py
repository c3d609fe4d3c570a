"""`cone`: the exact outline of the cone on the eye's wall, found below the pixel on the beam's own profile.

A robust start, then bands of bins along the predicted outline, coarse to fine, in strips across the edge whose albedo
is their own. Not an ellipse, and no threshold after the start.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from localize.band import BandFit, fit_band
from localize.noise import NoiseModel, linear_light, noise_of
from localize.outcome import LocalizationFailure, Outcome
from localize.prior import Estimate, Knowns
from localize.profile import Profile
from localize.start import Start, believed, find_starts
from localize.verdict import COVERED, UNCERTAIN, judged
from localize.view import outlines
from scene.scene import Scene

#: bins across the patch, bins inside and outside the outline, iterations; a sharp edge ends at full resolution
_SHARP = ((30, 3.0, 3.0, 6), (70, 4.0, 4.0, 4))
_FULL_MM = 0.025
_FULL_LEAST_BINS = 5.0
_SOFT = ((30, 6.0, 2.0, 6), (65, 20.0, 3.0, 5), (100, 35.0, 5.0, 8))
_CLIPPED = ((40, 8.0, 3.0, 6), (130, 20.0, 4.0, 5))


def cone(
    image: NDArray[np.generic],
    scene: Scene,
    *,
    knowns: Knowns | None = None,
    reference: NDArray[np.generic] | None = None,
    noise: NoiseModel | None = None,
) -> Outcome:
    """The tip from a checked image `[H, W]` or `[H, W, 3]`; `reference` (no spotlight) helps the search only."""
    known, sensor = knowns or Knowns(), noise or noise_of(scene)
    return believed(
        find_starts(image, scene, reference), scene, lambda start: edge_outcome(image, scene, start, known, sensor)
    )


def edge_outcome(image: NDArray[np.generic], scene: Scene, start: Start, knowns: Knowns, noise: NoiseModel) -> Outcome:
    """The localization from the edge fit near a start, or why it may not be believed."""
    fit = fit_edge(image, scene, start, knowns, noise)
    if isinstance(fit, str):
        return LocalizationFailure(fit)
    return judged(
        fit.estimate, np.asarray(np.linalg.inv(fit.covariance)), 1.0, scene, knowns,
        misfit=fit.misfit, covered=fit.covered, settled=fit.settled,
    )  # fmt: skip


def is_sharp(scene: Scene) -> bool:
    """Whether the beam's edge is a step rather than a slope."""
    return Profile.of(scene.beam).angle_at(0.5) > 0.97 * scene.beam.half_angle


def is_clipped(image: NDArray[np.generic], scene: Scene, start: Start) -> bool:
    """Whether most of the middle of the patch is clipped, so that only its rim can be measured."""
    points = outlines(Estimate.at(start.pose, scene))
    if not len(points):
        return False
    column, row = np.round(points.mean(axis=0)).astype(int)
    reach = max(2, int(0.2 * np.min(np.ptp(points, axis=0))))
    cut = image[max(0, row - reach) : row + reach, max(0, column - reach) : column + reach]
    stride = max(1, reach // 16)
    return bool(cut.size and np.mean(linear_light(cut[::stride, ::stride], scene)[1]) > 0.3)


def fit_edge(
    image: NDArray[np.generic], scene: Scene, start: Start, knowns: Knowns, noise: NoiseModel
) -> BandFit | str:
    """The band fit, coarse to fine, or why there is none."""
    points = outlines(Estimate.at(start.pose, scene))
    if len(points) < 10:
        return COVERED
    spotlights = len(scene.spotlights)
    size = float(np.max(np.ptp(points, axis=0))) / (1.0 if spotlights == 1 else 2.0)
    sharp = is_sharp(scene)
    full = sharp or is_clipped(image, scene, start)
    plan = _SOFT if not full else _SHARP if sharp else _CLIPPED
    stages = [(max(1, int(size / bins)), inner, outer, turns) for bins, inner, outer, turns in plan]
    if full:
        if stages[-1][0] > 1:
            reach = max(_FULL_LEAST_BINS, _FULL_MM / scene.camera.pixel_pitch)
            stages.append((1, reach, _FULL_LEAST_BINS, 6) if sharp else (1, 14.0, 6.0, 6))
        else:
            stages[-1] = (1, _FULL_LEAST_BINS, _FULL_LEAST_BINS, 8) if sharp else (1, 20.0, 5.0, 8)
    estimate = Estimate.at(start.pose, scene)
    gains: tuple[float, ...] = ()
    fit: BandFit | None = None
    for number, (side, inner, outer, iterations) in enumerate(stages):
        fit = fit_band(
            image, estimate, gains, knowns, noise,
            side=side, inner=inner, outer=outer, iterations=iterations, tied=number == 0,
        )  # fmt: skip
        if fit is None:
            return UNCERTAIN if number else COVERED
        estimate, gains = fit.estimate, fit.gains
    assert fit is not None
    return fit
