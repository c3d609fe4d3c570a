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
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: share of a quantity's information that pose and free quantities must leave it: rounding alone is in the rest
_LEFT = 1e-9
#: what each would have to be off by to count, and could be at most [rad, 1, mm, 1]. Nobody knows a lamp's softness to a
#: hundredth; what would have to be off by more than is possible hardly shows in the frame, and something else is amiss,
#: such as the foot of a soft edge below the sensor's last level
_MATERIAL = {"half_angle": (2e-4, 0.05), "softness": (0.01, 1.0), "eye_radius": (0.02, 3.0), "edge": (0.01, 1.0)}


def watched(knowns: Knowns, scene: Scene) -> Knowns:
    """The same with beam and wall free, so that their derivatives are there, as far as the scene has them.

    The eye's radius stands for the wall and for where the camera is: an image tells them apart only a little.
    """
    wide = replace(knowns, half_angle_sigma_deg=knowns.half_angle_sigma_deg or None)
    if scene.beam.softness is not None:
        wide = replace(wide, softness_sigma=knowns.softness_sigma or None)
    return replace(wide, eye_radius_sigma_mm=knowns.eye_radius_sigma_mm or None)


def scores(names: list[str], gradient: Array, information: Array, scatter: Array, size: int) -> dict[str, float]:
    """Each of the last parameters' scores over its own sigma, the first `size` taken out; of those that matter.

    `gradient` `[P]`, `information` `[P, P]` and the gradient's covariance `scatter` `[P, P]` are where a fit stands.
    """
    order = [*range(size, len(gradient)), *range(size)]
    reduced = reduction(information[np.ix_(order, order)], len(gradient) - size)
    left = np.diag(reduced @ information[np.ix_(order, order)] @ reduced.T)
    score, variance = reduced @ gradient[order], np.diag(reduced @ scatter[np.ix_(order, order)] @ reduced.T)
    whole = np.diag(information)[size:]
    return {
        name: float(s) / math.sqrt(float(v))
        for name, s, v, part, all_of_it in zip(names, score, variance, left, whole, strict=True)
        if v > 0.0 and part > _LEFT * all_of_it and _MATERIAL[name][0] < abs(s) / part < _MATERIAL[name][1]
    }
