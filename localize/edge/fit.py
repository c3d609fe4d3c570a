"""The edge fit: bands of bins along the predicted outline, coarse to fine, as the beam's profile and clipping ask."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.band import BandFit, Stage, fit_band
from conespot.localize.edge.sandwich import EdgeFit
from conespot.localize.edge.saturated import SaturatedFit, fit_saturated
from conespot.localize.edge.settings import EDGE, Level
from conespot.localize.edge.strips import WIDTH
from conespot.localize.image import Frame, Reference
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel, SensorNoise
from conespot.localize.model.profile import Profile
from conespot.localize.model.view import edge_width, outlines
from conespot.localize.outcome import COVERED, FEW_PIXELS, UNCERTAIN, LocalizationFailure
from conespot.scene.scene import Scene

Array = NDArray[np.float64]


def is_sharp(scene: Scene) -> bool:
    """Whether the beam's edge is a step rather than a slope."""
    return Profile.of(scene.beam).angle_at(0.5) > EDGE.sharp * scene.beam.half_angle


def is_clipped(frame: Frame, start: Estimate) -> bool:
    """Whether so much of the middle of the patch is clipped that only its rim can be measured."""
    return _clipped_share(frame, start) > EDGE.clipped


def _clipped_share(frame: Frame, start: Estimate) -> float:
    points = outlines(start)
    if not len(points):
        return 0.0
    column, row = np.round(points.mean(axis=0)).astype(int)
    reach = max(2, int(EDGE.middle * np.min(np.ptp(points, axis=0))))
    stride = max(1, reach // 16)
    rows, columns = (slice(max(0, at - reach), at + reach, stride) for at in (row, column))
    clipped = frame.light(rows, columns)[1]
    return float(np.mean(clipped)) if clipped.size else 0.0


@dataclass(frozen=True)
class _Patch:
    """What decides how a patch is fitted."""

    size: float  #: [px]
    sharp: bool  #: whether its edge is a step
    clipped: float  #: share of its middle

    @classmethod
    def of(cls, frame: Frame, start: Estimate, points: Array) -> _Patch:
        """From its outlines' points `[N, 2]` [px]."""
        size = float(np.max(np.ptp(points, axis=0))) / (1.0 if len(start.scene.spotlights) == 1 else 2.0)
        return cls(size, is_sharp(start.scene), _clipped_share(frame, start))

    @property
    def levels(self) -> list[Level]:
        """The levels that bring a start to its edge."""
        return _levels(EDGE.rim if self.sharp or self.clipped > EDGE.clipped else EDGE.soft, self.size)


def fit_edge(
    frame: Frame,
    start: Estimate,
    knowns: Knowns,
    noise: NoiseModel,
    reference: Reference | None = None,
) -> EdgeFit | LocalizationFailure:
    """The band fit, coarse to fine, or why there is none."""
    points = outlines(start)
    if len(points) < EDGE.fewest_points:
        return LocalizationFailure(COVERED)
    patch = _Patch.of(frame, start, points)
    # the middle of so narrow a patch reaches beyond it, and is not clipped throughout
    if patch.sharp and patch.clipped > EDGE.clipped and patch.size < EDGE.narrowest:
        return LocalizationFailure(FEW_PIXELS)
    if not (patch.sharp and patch.clipped > EDGE.throughout):
        return _bands(frame, start, knowns, noise, reference, patch)
    found: list[EdgeFit | LocalizationFailure] = [
        _throughout(replace(frame, ringing=EDGE.ringing), start, knowns, patch.size)
    ]
    # What a compression leaves of so high an edge is nothing to measure. Nor can its few pixels that are neither dark
    # nor clipped be weighed where nobody states the camera's noise: through optics tips were 14 um off at a stated 3.
    few = math.pi * patch.size / WIDTH < EDGE.fewest_strips
    if _states(noise) and not frame.sensor.noise.compression > 0.0 and not few:
        found.append(_bands(frame, start, knowns, noise, reference, patch))
    # the brighter the light, the fewer pixels of the edge are neither dark nor clipped: then bands hold the tip less
    held = [fit for fit in found if isinstance(fit, EdgeFit) and fit.settled]
    return min(held, key=lambda fit: float(np.trace(fit.covariance[:3, :3])), default=found[0])


def _states(noise: NoiseModel) -> bool:
    """Whether a noise model knows more than how pixels are rounded."""
    return not isinstance(noise, SensorNoise) or noise.electrons is not None


def _bands(
    frame: Frame,
    start: Estimate,
    knowns: Knowns,
    noise: NoiseModel,
    reference: Reference | None,
    patch: _Patch,
) -> BandFit | LocalizationFailure:
    """The fit of bands, coarse to fine."""
    fit: BandFit | None = None
    # what a compression leaves of an edge's foot looks like a spread
    compressed = frame.sensor.noise.compression > 0.0
    used, doubting = knowns, knowns if compressed and patch.clipped > EDGE.clipped else knowns.doubting
    for number, level in enumerate(patch.levels):
        last = number + 1 == len(patch.levels)
        while True:
            tied = number == 0 and len(patch.levels) > 1
            stage = _stage(level, patch, edge_width(start), last=last)
            found = fit_band(frame, start, fit, used, noise, reference, stage=stage, tied=tied)
            if isinstance(found, LocalizationFailure):
                # what starts inside the frame and leaves it has run off
                return LocalizationFailure(UNCERTAIN) if number else found
            nominal, fit, start = start.scene, found, found.estimate
            more = replace(doubting, rcm_sigma_mm=0.0) if tied else doubting
            if used == doubting or not found.contradicts(more, nominal):
                break
            # one width tells that something spreads the image, two what it is
            used = doubting = doubting.doubting_core if patch.sharp and not compressed else doubting
    assert fit is not None
    return fit


def _levels(levels: tuple[Level, ...], size: float) -> list[Level]:
    """The levels for a patch of `size` [px].

    Where the last takes every pixel, coarser ones whose bins would be pixels too are left out.
    """
    every = levels[-1].bins is not None
    return [level for level in levels if every or level.bins is None or int(size / level.bins) > 1]


def _stage(level: Level, patch: _Patch, width: float, *, last: bool) -> Stage:
    """The bins of a level on a patch, and the band of an edge that is `width` [px] wide."""
    side = 1 if level.bins is None else max(1, int(patch.size / level.bins))
    if last:
        # bins half as wide as the blur see all of it
        side = max(side, int(EDGE.bins_a_width * width))
    reach = EDGE.widths * width / side
    return Stage(side, level.inner + reach, level.outer + reach, level.iterations, EDGE.enough[last])


def _throughout(frame: Frame, start: Estimate, knowns: Knowns, size: float) -> SaturatedFit | LocalizationFailure:
    """The fit of a patch that is clipped throughout, coarse to fine."""
    fit: SaturatedFit | None = None
    # a small patch has no coarser bins than pixels: the axis is on the RCM in the first fit, and never in the last
    sides = [side for side in (int(size / bins) for bins in EDGE.saturated_bins) if side > 1] or [1]
    for number, side in enumerate([*sides, 1]):
        found = fit_saturated(frame, start, knowns, side=side, tied=number == 0)
        if isinstance(found, LocalizationFailure):
            return LocalizationFailure(UNCERTAIN) if number else found
        fit, start = found, found.estimate
    assert fit is not None
    return fit
