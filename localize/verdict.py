"""Whether a fit may be believed: a result that contradicts the model is refused with the reason, never returned."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.prior import Estimate, Knowns, rcm_miss
from conespot.localize.outcome import COVERED, UNCERTAIN, Localization, LocalizationFailure, Outcome
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
MISSES_RCM = "the axis misses the remote centre of motion by more than both their errors allow"
MISFIT = "the light in the patch contradicts the model of the beam"
OUTSIDE = "the fitted tip is outside the eye"
BEHIND = "the fitted tip is behind the remote centre of motion"
UNSETTLED = "the fit does not settle"


@dataclass(frozen=True)
class VerdictSettings:
    """Tuned numbers of the verdict."""

    largest_sigma_mm: float = 0.15
    largest_free_sigma_mm: float = 0.06
    largest_misfit: float = 2.5
    least_covered: float = 0.35
    miss_sigmas: float = 5.0
    floor_mm: float = 2e-5
    floor_rad: float = 2e-6


VERDICT = VerdictSettings()


def judged(
    estimate: Estimate,
    covariance: Array,
    nominal: Scene,
    knowns: Knowns,
    *,
    misfit: float,
    covered: float,
    settled: bool,
) -> Outcome:
    """The localization, or why there is none.

    `covariance` `[P, P]` is of the pose and the free quantities, infinite if there is none. `misfit` is the rms
    residual over the model's, `covered` the share seen.
    """
    if covered < VERDICT.least_covered:
        return LocalizationFailure(COVERED)
    if nominal.depth(estimate.pose.apex) <= 0.0:
        return LocalizationFailure(OUTSIDE)
    inwards = estimate.pose.apex - np.asarray(nominal.instrument.rcm)
    if float(inwards @ estimate.pose.axis) <= 0.0:
        return LocalizationFailure(BEHIND)
    size = estimate.pose_size
    pose = covariance[:size, :size].copy()
    pose[np.arange(3), np.arange(3)] += VERDICT.floor_mm**2
    pose[np.arange(3, size), np.arange(3, size)] += VERDICT.floor_rad**2
    sigma = math.sqrt(float(np.trace(pose[:3, :3])))
    limit = VERDICT.largest_free_sigma_mm if knowns.rcm_sigma_mm is None else VERDICT.largest_sigma_mm
    if not math.isfinite(sigma) or sigma > limit:
        return LocalizationFailure(UNCERTAIN)
    if knowns.rcm_sigma_mm is not None:
        reach = float(np.linalg.norm(np.asarray(nominal.instrument.rcm) - estimate.pose.apex))
        spread = math.hypot(knowns.rcm_sigma_mm, reach * math.sqrt(float(np.max(np.diag(pose)[3:5]))))
        if float(np.linalg.norm(rcm_miss(estimate.pose, nominal))) > VERDICT.miss_sigmas * spread + 1e-5:
            return LocalizationFailure(MISSES_RCM)
    if misfit > VERDICT.largest_misfit:
        return LocalizationFailure(MISFIT)
    if not settled:
        return LocalizationFailure(UNSETTLED)
    if size == 6:
        # a pose's roll turns about the needle's back end, the fit's about the axis into the light
        pose[5, :5] *= -1.0
        pose[:5, 5] *= -1.0
        return Localization(estimate.pose.apex, estimate.pose.axis, pose, roll=estimate.pose.roll)
    return Localization(estimate.pose.apex, estimate.pose.axis, pose)
