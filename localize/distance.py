"""How far a tip is from the wall, with a standard deviation: the pose's, and how well the wall itself is known.

Research, no safety device.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.quantity import Quantity
from conespot.localize.outcome import Distance, Localization, Outcome
from conespot.scene.document import InputError
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.wall import Wall

Array = NDArray[np.float64]


def distance_of(estimate: Estimate, covariance: Array | None, knowns: Knowns, *, joint: bool) -> Distance:
    """The distance of an estimate's tip from the wall of its scene.

    `covariance` `[P, P]` is of the pose and, if it is `joint`, of the quantities behind it that the fit left free; else
    they count as independent of the pose. None states no standard deviation.
    """
    wall = Wall.about(estimate.scene, estimate.pose.apex, estimate.pose.axis)
    along, nearest = (float(value) for value in wall.distances)
    beam = estimate.scene.beam
    source = beam.source_diameter / 2.0 / math.tan(beam.half_angle)
    if covariance is None or not math.isfinite(along):
        return Distance(along, nearest, source_mm=source)
    size = estimate.pose_size if joint else len(covariance)
    free = tuple(each for each in knowns.free if each.changes == "sight")
    jacobian = np.zeros((2, len(covariance)))
    jacobian[:, :size] = wall.by_pose(size)
    variance = np.square(knowns.relief_sigma_mm * wall.by_relief())
    for each in free:
        change = _by_quantity(wall, estimate, each)
        if joint:
            jacobian[:, size + knowns.free.index(each)] = change
        elif (sigma := knowns.sigma(each)) is not None:
            variance += np.square(sigma * change)
    variance += np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian)
    sigmas = np.sqrt(np.maximum(variance, 0.0))
    return Distance(along, nearest, float(sigmas[0]), float(sigmas[1]), source)


def _by_quantity(wall: Wall, estimate: Estimate, quantity: Quantity) -> Array:
    """Change of both distances per change of a quantity of the scene `[2]`, the pose staying where it is."""
    more, less = (wall.by_wall(estimate.beside(quantity, step)) for step in (quantity.step, -quantity.step))
    return (more - less) / (2.0 * quantity.step)


def with_distance(outcome: Outcome, scene: Scene, knowns: Knowns) -> Outcome:
    """An answer that knows its distance from the wall; a failure as it is."""
    if not isinstance(outcome, Localization) or outcome.distance is not None:
        return outcome
    estimate = Estimate(Pose(outcome.apex_mm, outcome.axis), scene)
    return replace(outcome, distance=distance_of(estimate, outcome.covariance, knowns, joint=False))


@dataclass(frozen=True)
class Alarm:
    """An alarm below `least_mm` from the wall, whose "safe" may be false with a chance of `false_safe` at most.

    That chance is the stated sigma's, of errors that are Gaussian: what it is in truth, `campaign run near_retina`
    counts. Research, no safety device. Raises InputError for a chance that is not between 0 and a half.
    """

    least_mm: float
    false_safe: float = 1e-3

    def __post_init__(self) -> None:
        if not 0.0 < self.false_safe < 0.5:
            raise InputError(f"the chance of a false safe must lie between 0 and 0.5, got {self.false_safe:g}")
        if not (math.isfinite(self.least_mm) and self.least_mm >= 0.0):
            raise InputError(f"the distance of an alarm must be 0 mm or more, got {self.least_mm:g}")

    @property
    def sigmas(self) -> float:
        """Standard deviations between the distance and its one-sided bound."""
        return NormalDist().inv_cdf(1.0 - self.false_safe)

    def safe(self, outcome: Outcome) -> bool:
        """Whether the bound of the nearest distance lies above; never of a refused frame, nor without a sigma."""
        if not isinstance(outcome, Localization) or outcome.distance is None:
            return False
        beyond = outcome.distance.beyond(self.sigmas)
        return beyond is not None and beyond > self.least_mm
