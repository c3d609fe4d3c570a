"""Is what the scene says exactly right? Score tests: would the residuals have a quantity otherwise that was told?

C. R. Rao, Large sample tests of statistical hypotheses concerning several parameters, Proc. Cambridge Phil. Soc. 44
(1948). At a fit's minimum the slope of the likelihood along a quantity that was held fixed has mean zero, beside what
pose and free quantities take up, if its value is right. What no residual shows (a half angle's error that the tip's
height takes up) such a test does not see either.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.knowns import Knowns
from conespot.localize.model.solve import reduction
from conespot.scene.population import SEMI_AXES_SIGMA_MM
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: share of a quantity's information that pose and free quantities must leave it: rounding alone is in the rest
_LEFT = 1e-9
#: the name of the score of the retina's semi-axes, which are doubted together
WALL = "wall"
_SHAPE = ("retina_width", "retina_height", "retina_length")
#: the names of the scores of a blur that varies around an outline, of four waves together, and of the transfer
UNEVEN, TRANSFER = "uneven", "transfer"
#: what each would have to be off by to count, and could be at most [rad, 1, mm, 1]. Nobody knows a lamp's softness to a
#: hundredth; what would have to be off by more than is possible hardly shows in the frame, and something else is amiss,
#: such as the foot of a soft edge below the sensor's last level
_MATERIAL = {
    "half_angle": (2e-4, 0.05),
    "softness": (0.01, 1.0),
    "eye_radius": (0.02, 3.0),
    "edge": (0.01, 1.0),
    TRANSFER: (0.9, 5.0),  # of the mistake: under right gamma in 8 bits without noise 0.6 is found
}
#: the same of the wall's shape: least change of all semi-axes together [mm]. No change is too large: what no shape
#: explains contradicts the one that was told no less (a rig turned into its neighbours' places, 0.24 mm off)
_SHAPE_MATERIAL_MM = 0.02
#: least width of what a blur varies by [mm]
_UNEVEN_MATERIAL_MM = 1.5e-3


def watched(knowns: Knowns, scene: Scene) -> Knowns:
    """The same with beam and wall free, so that their derivatives are there, as far as the scene has them.

    The wall stands for where the camera is too: an image tells them apart only a little. Of several sharp patches its
    three semi-axes are doubted; one patch, or soft ones, tell them from the albedo less well (of 90 frames on living
    retinas whose wall was told rightly three would be refused), and there it is the eye's radius alone.
    """
    wide = replace(knowns, half_angle_sigma_deg=knowns.half_angle_sigma_deg or None)
    soft = scene.beam.softness is not None
    if soft:
        wide = replace(wide, softness_sigma=knowns.softness_sigma or None)
    if soft or len(scene.spotlights) == 1:
        return replace(wide, eye_radius_sigma_mm=knowns.eye_radius_sigma_mm or None)
    return replace(wide, semi_axes_sigma_mm=knowns.semi_axes_sigma_mm or None)


def matter(names: list[str], gradient: Array, information: Array, size: int) -> bool:
    """Whether any of the last parameters would be off by as much as counts, as `scores` has them.

    Without the scatter of the gradient, which takes longer than all else; of the wall's shape only that one tells.
    """
    left, score, whole = _left(gradient, information, size)
    waves = [j for j, name in enumerate(names) if name == UNEVEN]
    if waves and _varies(score[waves], left[np.ix_(waves, waves)], whole[waves]):
        return True
    return any(
        name in _SHAPE or _is_material(name, score[j], left[j, j], whole[j])
        for j, name in enumerate(names)
        if name != UNEVEN
    )


def scores(names: list[str], gradient: Array, information: Array, scatter: Array, size: int) -> dict[str, float]:
    """Each of the last parameters' scores over its own sigma, the first `size` taken out; of those that matter.

    `gradient` `[P]`, `information` `[P, P]` and the gradient's covariance `scatter` `[P, P]` are where a fit stands.
    The semi-axes have one score, of the wall, and a blur's waves have one.
    """
    order = [*range(size, len(gradient)), *range(size)]
    reduced = reduction(information[np.ix_(order, order)], len(gradient) - size)
    left, score, whole = _left(gradient, information, size)
    variance = reduced @ scatter[np.ix_(order, order)] @ reduced.T
    found = {}
    for j, name in enumerate(names):
        if name in (*_SHAPE, UNEVEN) or not variance[j, j] > 0.0:
            continue
        if _is_material(name, score[j], left[j, j], whole[j]):
            found[name] = float(score[j] / math.sqrt(variance[j, j]))
    shape = [j for j, name in enumerate(names) if name in _SHAPE]
    if shape:
        at = np.ix_(shape, shape)
        found[WALL] = _of_wall(score[shape], left[at], variance[at], whole[shape])
    waves = [j for j, name in enumerate(names) if name == UNEVEN]
    if waves:
        at = np.ix_(waves, waves)
        found[UNEVEN] = _of_blur(score[waves], left[at], variance[at], whole[waves])
    return found


def _left(gradient: Array, information: Array, size: int) -> tuple[Array, Array, Array]:
    """The last parameters' information and gradient with the first `size` taken out, and their information before."""
    order = [*range(size, len(gradient)), *range(size)]
    reduced = reduction(information[np.ix_(order, order)], len(gradient) - size)
    left = reduced @ information[np.ix_(order, order)] @ reduced.T
    return left, reduced @ gradient[order], np.diag(information)[size:]


def _is_material(name: str, score: float, left: float, whole: float) -> bool:
    """Whether a quantity would be off by as much as counts, and no more than it can be.

    A mistake was made or was not: the opposite of one is something else.
    """
    if not left > _LEFT * whole:
        return False
    off = score / left if name == TRANSFER else abs(score) / left
    return bool(_MATERIAL[name][0] < off < _MATERIAL[name][1])


def _varies(score: Array, left: Array, whole: Array) -> bool:
    """Whether a blur's variance would vary by as much as counts."""
    step = np.linalg.solve(left + np.diag(_LEFT * whole), score)
    return float(np.linalg.norm(step)) > _UNEVEN_MATERIAL_MM**2


def _of_blur(score: Array, left: Array, variance: Array, whole: Array) -> float:
    """The score of all waves of a blur's variance together; 0 where they do not matter.

    Of four standard normal quantities the root of the sum of squares: by chance above 5 once in 20,000 frames.
    """
    if not _varies(score, left, whole):
        return 0.0
    return math.sqrt(max(float(score @ np.linalg.solve(variance + np.diag(_LEFT * whole), score)), 0.0))


def _of_wall(score: Array, left: Array, variance: Array, whole: Array) -> float:
    """The score of all semi-axes `[3]` together, as one of one quantity would be; 0 where it does not matter.

    Twice the logarithm of how much likelier a shape out of a population makes the score than the one that was told, but
    for the prior odds: directions in which a frame does not show the shape then count for nothing. Its square is at
    most a chi-squared of three degrees under the right shape.
    """
    variance = variance + np.diag(_LEFT * whole)
    prior = SEMI_AXES_SIGMA_MM**2 * np.eye(len(score))
    possible = variance + left @ prior @ left
    told, drawn = (float(score @ np.linalg.solve(v, score)) for v in (variance, possible))
    step = prior @ left @ np.linalg.solve(possible, score)
    if float(np.linalg.norm(step)) < _SHAPE_MATERIAL_MM:
        return 0.0
    return math.sqrt(max(told - drawn, 0.0))
