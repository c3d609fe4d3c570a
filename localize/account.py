"""An account of an answer: what a localizer saw on its way, to be looked at. Localizing itself never makes one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.image import AnyImage, Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.view import Bins, Shown, Window, outline
from conespot.localize.outcome import LocalizationFailure, Outcome
from conespot.localize.published.methods import METHODS
from conespot.scene.pose import Pose, cone_rays
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
_POINTS = 256  # of an outline
_BINS = 256  # of a window, at most
_MARGIN = 0.25  # around a patch
_FEWEST = 10  # bins that tell two levels
_ROUNDS = 10  # until it is settled which clipped bins are bright enough


@dataclass(frozen=True, eq=False)
class Patch:
    """A window of the frame, in bins of `side` px from pixel (row, column): its light, and what the answer predicts.

    Both `[h, w]`, 1 is white. Predicted is the light of the answer's cones over an even retina, whose brightness under
    both lights is taken from the window. An answer without a roll has that of `Pose.through`.
    """

    row: int
    column: int
    side: int
    light: Array
    predicted: Array


@dataclass(frozen=True, eq=False)
class Account:
    """What a localizer saw, in pixels (column, row) with centres at i + 0.5.

    `mask` `[H, W]` is what it took for light and `found` the outlines `[N, 2]` it cut out, of those that threshold.
    `fitted` are the outlines `[N, 2]` of what it fitted: ellipses (drawn as the cones over them, which is the same to a
    micrometre, paper, Table I) or the cones of its answer. `patches` are predicted from the answer, none without one.
    """

    mask: NDArray[np.bool_] | None = None
    found: tuple[Array, ...] = ()
    fitted: tuple[Array, ...] = ()
    patches: tuple[Patch, ...] = ()


def account(image: AnyImage, scene: Scene, localizer: str, outcome: Outcome) -> Account:
    """What a localizer of that name saw in a checked image on the way to its `outcome`."""
    fitted: tuple[Array, ...] = ()
    patches: tuple[Patch, ...] = ()
    if not isinstance(outcome, LocalizationFailure):
        estimate = Estimate(Pose(outcome.apex_mm, outcome.axis, outcome.roll or 0.0), scene)
        fitted = tuple(outline(estimate, k, _POINTS) for k in range(len(scene.spotlights)))
        patches = _patches(Frame(image, scene.sensor), estimate)
    method = METHODS.get(localizer)
    if method is None:
        return Account(fitted=fitted, patches=patches)
    steps = method.steps(image, scene)
    mask = np.zeros(scene.camera.shape, bool)
    height, width = steps.mask.bright.shape
    mask[steps.mask.top : steps.mask.top + height, steps.mask.left : steps.mask.left + width] = steps.mask.bright
    fitted = tuple(_drawn(pair.apexes[0], pair.axes[0], scene) for pair in steps.pairs)
    found = tuple(np.asarray(points + 0.5, np.float64) for points in steps.outlines)
    return Account(mask, found, fitted, patches)


def _drawn(apex: Array, axis: Array, scene: Scene) -> Array:
    """Where the camera sees the outline of a cone on the eye's wall `[N, 2]` [px]."""
    rays = cone_rays(axis, scene.beam.half_angle, np.arange(_POINTS) * 2.0 * np.pi / _POINTS)
    pixels = scene.camera.project(scene.surface.intersect(scene.eye, apex, rays))
    return np.asarray(pixels[np.all(np.isfinite(pixels), axis=1)])


def _patches(frame: Frame, estimate: Estimate) -> tuple[Patch, ...]:
    windows = ((k, Window.around(estimate, k, _BINS, _MARGIN)) for k in range(len(estimate.scene.spotlights)))
    patches = (_patch(frame, estimate, k, at) for k, at in windows if at is not None)
    return tuple(patch for patch in patches if patch is not None)


def _patch(frame: Frame, estimate: Estimate, spotlight: int, at: Window) -> Patch | None:
    shown = max(Shown.each(frame, at), key=lambda plane: np.count_nonzero(plane.usable))
    bins = Bins(at, estimate, Knowns(), spotlight)
    lit = np.zeros(shown.signal.size)
    lit[bins.lit] = bins.spotlight(estimate)[0]
    levels = np.column_stack([bins.ambient, lit])
    seen = bins.seen & np.isfinite(lit)
    light, clipped = shown.signal.ravel(), ~shown.usable.ravel()
    use = seen & ~clipped
    for _ in range(_ROUNDS):
        if np.count_nonzero(use) < _FEWEST:
            return None
        predicted = levels @ np.linalg.lstsq(levels[use], light[use], rcond=None)[0]
        # a clipped bin is a lower bound, which light above it meets
        use = seen & ~(clipped & (predicted > light))
    return Patch(at.row, at.column, at.side, shown.signal, np.minimum(predicted, 1.0).reshape(shown.signal.shape))
