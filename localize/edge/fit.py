"""The edge fit: bands of bins along the predicted outline, coarse to fine, as the beam's profile and clipping ask."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.band import BandFit, fit_band
from conespot.localize.edge.sandwich import EdgeFit
from conespot.localize.edge.saturated import SaturatedFit, fit_saturated
from conespot.localize.model.noise import NoiseModel, linear_light
from conespot.localize.model.prior import Estimate, Knowns
from conespot.localize.model.profile import Profile
from conespot.localize.model.view import Unlit, outlines
from conespot.localize.start.search import Start
from conespot.localize.verdict import COVERED, UNCERTAIN
from conespot.scene.scene import Scene

#: bins across the patch, bins inside and outside the outline, iterations
_RIM = ((30, 5.0, 3.0, 6), (70, 5.0, 3.0, 5))
_SOFT = ((30, 6.0, 2.0, 6), (40, 14.0, 3.0, 16))
#: a sharp edge and a clipped patch's rim end at full resolution
_FULL = (1, 5.0, 3.0, 16)
#: a step this short [sigmas] ends a stage that others follow, and the last one
_ENOUGH = (1.0, 0.3)
_CLIPPED, _THROUGHOUT = 0.3, 0.9  # shares from which on a patch counts as clipped, and as clipped throughout
_SATURATED = (30, 90)  # bins across a patch that is clipped throughout, before full resolution


def is_sharp(scene: Scene) -> bool:
    """Whether the beam's edge is a step rather than a slope."""
    return Profile.of(scene.beam).angle_at(0.5) > 0.97 * scene.beam.half_angle


def is_clipped(image: NDArray[np.generic], scene: Scene, start: Start) -> bool:
    """Whether so much of the middle of the patch is clipped that only its rim can be measured."""
    return _clipped_share(image, scene, start) > _CLIPPED


def _clipped_share(image: NDArray[np.generic], scene: Scene, start: Start) -> float:
    points = outlines(Estimate(start.pose, scene))
    if not len(points):
        return 0.0
    column, row = np.round(points.mean(axis=0)).astype(int)
    reach = max(2, int(0.2 * np.min(np.ptp(points, axis=0))))
    cut = image[max(0, row - reach) : row + reach, max(0, column - reach) : column + reach]
    stride = max(1, reach // 16)
    return float(np.mean(linear_light(cut[::stride, ::stride], scene)[1])) if cut.size else 0.0


def fit_edge(
    image: NDArray[np.generic],
    scene: Scene,
    start: Start,
    knowns: Knowns,
    noise: NoiseModel,
    unlit: Unlit | None = None,
) -> EdgeFit | str:
    """The band fit, coarse to fine, or why there is none."""
    points = outlines(Estimate(start.pose, scene))
    if len(points) < 10:
        return COVERED
    spotlights = len(scene.spotlights)
    size = float(np.max(np.ptp(points, axis=0))) / (1.0 if spotlights == 1 else 2.0)
    sharp, clipped = is_sharp(scene), _clipped_share(image, scene, start)
    estimate = Estimate(start.pose, scene)
    if sharp and clipped > _THROUGHOUT:
        saturated: SaturatedFit | None = None
        for number, side in enumerate([side for side in (int(size / bins) for bins in _SATURATED) if side > 1] + [1]):
            saturated = fit_saturated(image, estimate, knowns, side=side, tied=number == 0)
            if saturated is None:
                return UNCERTAIN if number else COVERED
            estimate = saturated.estimate
        assert saturated is not None
        return saturated
    full = sharp or clipped > _CLIPPED
    stages = [
        (max(1, int(size / bins)), inner, outer, turns) for bins, inner, outer, turns in (_RIM if full else _SOFT)
    ]
    if full:
        stages = [stage for stage in stages if stage[0] > 1]
        stages.append(_FULL)
    fit: BandFit | None = None
    for number, (side, inner, outer, iterations) in enumerate(stages):
        fit = fit_band(
            image, estimate, fit, knowns, noise,
            side=side, inner=inner, outer=outer, iterations=iterations,
            enough=_ENOUGH[number + 1 == len(stages)], tied=number == 0, unlit=unlit,
        )  # fmt: skip
        if fit is None:
            return UNCERTAIN if number else COVERED
        estimate = fit.estimate
    assert fit is not None
    return fit
