"""An account of an answer: what a localizer saw on its way, to be looked at. Localizing itself never makes one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

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
_EDGES = 128  # places along an outline where the light's edge is looked for
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
    micrometre, paper, Table I) or the cones of its answer. What takes longer than localizing is worked out when it is
    asked for: from the `answer` and the `frame`, none without an answer.
    """

    frame: Frame
    answer: Estimate | None = None
    mask: NDArray[np.bool_] | None = None
    found: tuple[Array, ...] = ()
    fitted: tuple[Array, ...] = ()

    @cached_property
    def patches(self) -> tuple[Patch, ...]:
        """What the answer predicts."""
        return () if self.answer is None else _patches(self.frame, self.answer)

    @cached_property
    def edges(self) -> tuple[Array, ...]:
        """Where the patches' light itself falls to the level that the answer predicts at its outline `[N, 2]`."""
        return tuple(_edge(patch) for patch in self.patches)


def account(image: AnyImage, scene: Scene, localizer: str, outcome: Outcome) -> Account:
    """What a localizer of that name saw in a checked image on the way to its `outcome`."""
    frame, estimate = Frame(image, scene.sensor), None
    if not isinstance(outcome, LocalizationFailure):
        estimate = Estimate(Pose(outcome.apex_mm, outcome.axis, outcome.roll or 0.0), outcome.seen_in(scene))
    method = METHODS.get(localizer)
    if method is None:
        cones = () if estimate is None else tuple(outline(estimate, k, _POINTS) for k in range(len(scene.spotlights)))
        return Account(frame, estimate, fitted=cones)
    steps = method.steps(image, scene)
    mask = np.zeros(scene.camera.shape, bool)
    height, width = steps.mask.bright.shape
    mask[steps.mask.top : steps.mask.top + height, steps.mask.left : steps.mask.left + width] = steps.mask.bright
    fitted = tuple(_drawn(pair.apexes[0], pair.axes[0], scene) for pair in steps.pairs)
    found = tuple(np.asarray(points + 0.5, np.float64) for points in steps.outlines)
    return Account(frame, estimate, mask, found, fitted)


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
    lit[bins.lit] = bins.spotlight(estimate)[0][0]
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


def _edge(patch: Patch) -> Array:
    """Where a patch's light crosses the predicted light's middle level, as seen from its middle `[N, 2]` [px].

    On each line outwards, seen light is first brought to the predicted light's own two levels by least squares, since
    a real retina is not even.
    """
    height, width = patch.light.shape
    low, high = float(np.nanmin(patch.predicted)), float(np.nanmax(patch.predicted))
    level = (low + high) / 2.0
    lit = patch.predicted > level
    if not lit.any() or high <= low:
        return np.empty((0, 2))
    rows, columns = np.nonzero(lit)
    middle = np.array([columns.mean(), rows.mean()])
    reach = np.arange(0.0, math.hypot(height, width), 0.5)
    found = []
    for turn in np.linspace(0.0, 2.0 * np.pi, _EDGES, endpoint=False):
        x, y = middle[:, None] + np.array([[math.cos(turn)], [math.sin(turn)]]) * reach
        inside = (x >= 0.0) & (x <= width - 1.0) & (y >= 0.0) & (y <= height - 1.0)
        at = [y[inside], x[inside]]
        predicted, seen = (_along(plane, at) for plane in (patch.predicted, patch.light))
        crossing = _falls_below(predicted, level)
        if crossing is None or np.ptp(predicted) < (high - low) / 2.0:
            continue
        levels = np.column_stack([predicted, np.ones(len(predicted))])
        gain, offset = np.linalg.lstsq(levels, seen, rcond=None)[0]
        if not gain > 0.0:
            continue
        own = _falls_below((seen - offset) / gain, level, near=crossing)
        if own is not None:
            found.append(patch.side * (middle + 0.5 * own * np.array([math.cos(turn), math.sin(turn)]) + 0.5))
    corner = np.array([patch.column, patch.row], float)
    return np.array(found).reshape(-1, 2) + corner


def _along(plane: Array, at: list[Array]) -> Array:
    """Bilinear values of a plane at rows and columns `[N]` each."""
    row, column = (np.floor(part).astype(int) for part in at)
    down, right = at[0] - row, at[1] - column
    below, beside = np.minimum(row + 1, plane.shape[0] - 1), np.minimum(column + 1, plane.shape[1] - 1)
    upper = plane[row, column] * (1.0 - right) + plane[row, beside] * right
    lower = plane[below, column] * (1.0 - right) + plane[below, beside] * right
    return np.asarray(upper * (1.0 - down) + lower * down)


def _falls_below(profile: Array, level: float, near: float | None = None) -> float | None:
    """Where a profile `[N]` falls below a level, in steps from its start: the first place, or that nearest another."""
    steps = np.flatnonzero((profile[:-1] >= level) & (profile[1:] < level))
    if not len(steps):
        return None
    places = steps + (profile[steps] - level) / (profile[steps] - profile[steps + 1])
    return float(places[0] if near is None else places[np.argmin(np.abs(places - near))])
