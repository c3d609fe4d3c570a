"""Whether a fit may be believed: a result that contradicts the model is refused with the reason, never returned."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.distance import distance_of
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.prior import rcm_miss
from conespot.localize.model.smear import sag_sigma
from conespot.localize.model.suspicion import TRANSFER, UNEVEN, WALL
from conespot.localize.outcome import COVERED, OUTSIDE, UNCERTAIN, Localization, LocalizationFailure, Outcome
from conespot.scene.camera import Camera
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
MISSES_RCM = "the axis misses the remote centre of motion by more than both their errors allow"
MISFIT = "the light in the patch contradicts the model of the beam"
BEHIND = "the fitted tip is behind the remote centre of motion"
WRONG_BEAM = "the patch's edge contradicts the scene's beam: its half angle, its softness or the sharpness of the frame"
WRONG_WALL = (
    "the patch's outline contradicts the scene's eye: its radius, its surface or where the camera is; "
    "semi_axes_sigma leaves the shape free"
)
WRONG_TRANSFER = (
    "the light across the patch's edge contradicts how the scene's sensor turns light to values: with gamma (srgb8), or"
    " without (linear, emva)"
)
_WRONG = {WALL: WRONG_WALL, "eye_radius": WRONG_WALL, TRANSFER: WRONG_TRANSFER}
UNSETTLED = "the fit does not settle"


@dataclass(frozen=True)
class VerdictSettings:
    """Tuned numbers of the verdict. `campaign run gross_errors` counts what they let through and refuse: 5,016 frames.

    There 66 of 6,732 answers on whole patches are refused, and one of all given is a gross error.
    """

    #: largest sigma of the tip that is returned [mm]. A free fit of a soft edge runs off along what it hardly sees, and
    #: then states too little: it is refused earlier than one that the RCM ties
    largest_sigma_mm: float = 0.15
    largest_free_sigma_mm: float = 0.06
    #: largest score over its sigma of a quantity that was told. On ten right scenes with hard edges the largest is 1.3,
    #: on eight with soft ones under `cone` 4.3; beams told a tenth softer have 11
    suspicious: float = 6.0
    #: the same of the wall's shape, all semi-axes together: the root of the chi-squared of three degrees that one right
    #: frame in a thousand exceeds. Of 430 with three hard spotlights one did, with 4.04 (`campaign run eyes --seed
    #: 1001` with eyes from 1000 on, `precision` on `random` tips, and the image model)
    suspicious_wall: float = 4.03
    #: the same of a blur that varies around the outline: under right worlds at most 3.6, under a depth of field nobody
    #: tells of 4.8 to 8.7 (`benchmarks/told_worlds.py`)
    suspicious_blur: float = 5.0
    #: by how many of its sigmas a core may be wider than the scene says, in squared diameters. Eleven frames of 9,883
    #: found one that nobody told of, of 0.32 to 0.33 mm: an optic disc for a hard patch beyond the frame, 2.6 mm off
    core_sigmas: float = 6.0
    #: largest rms residual over the model's, single ones counted to 5 at most
    largest_misfit: float = 2.5
    #: least share of a patch that must be seen; with it 648 of 792 patches that the frame cuts are answered
    least_covered: float = 0.35
    #: sigmas by which the axis may miss the RCM: in two directions chance does so four times in a million
    miss_sigmas: float = 5.0
    #: what no fit on real optics resolves, added to every tip [mm] and axis [rad]: 20 nm, and as much over 10 mm of
    #: needle. The least mean error met is 30 nm (three hard spotlights, 5000 px)
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
    suspicions: Callable[[], Mapping[str, float]] = dict,
) -> Outcome:
    """The localization, or why there is none.

    `covariance` `[P, P]` is of the pose and the free quantities, infinite if there is none. `misfit` is the rms
    residual over the model's, `covered` the share seen, `suspicions` gives scores of what the scene says, over their
    sigmas (`model.suspicion`), and is asked of a fit that nothing else refuses: it takes as long as a step of one.
    """
    if covered < VERDICT.least_covered:
        return LocalizationFailure(COVERED)
    if nominal.depth(estimate.pose.apex) <= 0.0:
        return LocalizationFailure(OUTSIDE)
    inwards = estimate.pose.apex - np.asarray(nominal.instrument.rcm)
    if float(inwards @ estimate.pose.axis) <= 0.0:
        return LocalizationFailure(BEHIND)
    size = estimate.pose_size
    joint = covariance.copy()
    joint[np.arange(3), np.arange(3)] += VERDICT.floor_mm**2 + sag_sigma(nominal) ** 2
    joint[:3, :3] += _of_colours(estimate)
    joint[np.arange(3, size), np.arange(3, size)] += VERDICT.floor_rad**2
    pose = joint[:size, :size].copy()
    variances = np.diag(pose)
    # of a patch that hardly holds them, rounding makes some negative
    sigma = math.sqrt(float(np.sum(variances[:3]))) if np.all(variances > 0.0) else math.inf
    limit = VERDICT.largest_free_sigma_mm if knowns.rcm_sigma_mm is None else VERDICT.largest_sigma_mm
    if not math.isfinite(sigma) or sigma > limit:
        return LocalizationFailure(UNCERTAIN)
    if knowns.rcm_sigma_mm is not None:
        reach = float(np.linalg.norm(np.asarray(nominal.instrument.rcm) - estimate.pose.apex))
        spread = math.hypot(knowns.rcm_sigma_mm, reach * math.sqrt(float(np.max(variances[3:5]))))
        if float(np.linalg.norm(rcm_miss(estimate.pose, nominal))) > VERDICT.miss_sigmas * spread + 1e-5:
            return LocalizationFailure(MISSES_RCM)
    if misfit > VERDICT.largest_misfit:
        return LocalizationFailure(MISFIT)
    if _too_wide(estimate.scene, nominal, knowns):
        return LocalizationFailure(WRONG_BEAM)
    limits = {WALL: VERDICT.suspicious_wall, UNEVEN: VERDICT.suspicious_blur}
    found = {name: abs(score) / limits.get(name, VERDICT.suspicious) for name, score in suspicions().items()}
    worst = max(found, key=lambda name: found[name], default=None)
    if worst is not None and found[worst] > 1.0:
        return LocalizationFailure(_WRONG.get(worst, WRONG_BEAM))
    if not settled:
        return LocalizationFailure(UNSETTLED)
    distance = distance_of(estimate, joint, knowns, joint=True)
    camera = _moved(estimate.scene.camera, nominal.camera)
    if size == 6:
        # a pose's roll turns about the needle's back end, the fit's about the axis into the light
        pose[5, :5] *= -1.0
        pose[:5, 5] *= -1.0
        return Localization(
            estimate.pose.apex, estimate.pose.axis, pose, roll=estimate.pose.roll, distance=distance, camera=camera
        )
    return Localization(estimate.pose.apex, estimate.pose.axis, pose, distance=distance, camera=camera)


def _of_colours(estimate: Estimate) -> Array:
    """Covariance of the tip `[3, 3]` [mm^2] from the image's size, which the light's colours change.

    A patch that is larger by a part is taken for that of a tip which is farther from the wall by that part.
    """
    scene, pose = estimate.scene, estimate.pose
    sigma = scene.image_size_sigma
    if sigma == 0.0:
        return np.zeros((3, 3))
    farther = sigma * (scene.surface.intersect(scene.eye, pose.apex, pose.axis) - pose.apex)
    return np.outer(farther, farther)


def _moved(found: Camera, nominal: Camera) -> Camera | None:
    """The camera as it was found, where it stands otherwise than told."""
    stands = (found.height, found.tilt, found.azimuth)
    return None if stands == (nominal.height, nominal.tilt, nominal.azimuth) else found


def _too_wide(found: Scene, nominal: Scene, knowns: Knowns) -> bool:
    """Whether the light would leave a core that is far wider than what is known of it."""
    sigma = knowns.core_sigma_mm
    if not isinstance(sigma, float):
        return False
    wider = found.beam.source_diameter**2 - nominal.beam.source_diameter**2
    return 0.0 < VERDICT.core_sigmas * sigma**2 < wider
