"""What is known beside the image, each with how well: the RCM, the half angle, the eye, the camera.

A quantity with sigma 0 is fixed, with sigma None free, else it has a Gaussian prior around the scene's value. All
but the RCM join the parameters of a fit; the RCM acts on the pose through the distance by which the axis misses it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.forward import moved
from conespot.localize.model.profile import Profile
from conespot.scene.document import InputError
from conespot.scene.pose import Pose, tangents
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: how well the RCM is known where nobody says: an assumption and no measurement. An RCM that is 0.1 mm off sideways
#: moves the tip by 12 um (3 mm high) to 25 um (6 mm), so this one leaves half of that
RCM_SIGMA_MM = 0.05
#: an "exactly" known RCM: far below anything an image can tell, yet well conditioned
_EXACT_MM = 1e-6
#: what may be free beside the pose; the first two are the beam's, which alone changes with them
FREE = ("half_angle", "softness", "eye_radius", "camera_height")
BEAM = FREE[:2]
_BEAM_STEP = {"half_angle": 1e-6, "softness": 1e-4}
#: a softness below is a hard edge to every camera
_HARDEST = 1e-3


@dataclass(frozen=True)
class Knowns:
    """Standard deviations of what the scene states; 0 is exactly known, None is free.

    The needle passes through the scene's RCM within `rcm_sigma_mm` sideways. Raises InputError for a negative value.
    """

    rcm_sigma_mm: float | None = RCM_SIGMA_MM
    half_angle_sigma_deg: float | None = 0.0
    softness_sigma: float | None = 0.0  #: of a `cycles` beam's blend
    eye_radius_sigma_mm: float | None = 0.0
    camera_height_sigma_mm: float | None = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value is not None and not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"knowns: {name} must be 0 (exact), positive, or None (free), got {value!r}")

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the scene's quantities that join the fit, in the order of its parameters."""
        return tuple(name for name in FREE if self.sigma(name) != 0.0)

    def sigma(self, name: str) -> float | None:
        """Sigma of one of `FREE` in the unit held inside [rad, 1, mm, mm]; None if free."""
        if name == "half_angle":
            return None if self.half_angle_sigma_deg is None else math.radians(self.half_angle_sigma_deg)
        if name == "softness":
            return self.softness_sigma
        return self.eye_radius_sigma_mm if name == "eye_radius" else self.camera_height_sigma_mm


def value(scene: Scene, name: str) -> float:
    """The scene's value of one of `FREE` [rad, 1, mm, mm]. Raises InputError for the softness of a beam without one."""
    if name == "half_angle":
        return scene.beam.half_angle
    if name == "softness":
        if scene.beam.softness is None:
            raise InputError(f"knowns: a {scene.beam.kind} beam has no softness; describe it as a cycles beam")
        return scene.beam.softness
    return scene.eye.radius if name == "eye_radius" else scene.camera.height


def with_value(scene: Scene, name: str, new: float) -> Scene:
    """The scene with another value of one of `FREE` [rad, 1, mm, mm]."""
    if name == "half_angle":
        return scene.model_copy(update={"beam": scene.beam.stretched(new)})
    if name == "softness":
        # a fit may look a little beyond the softest beam there is
        return scene.model_copy(update={"beam": scene.beam.model_copy(update={"blend": max(new, _HARDEST)})})
    if name == "eye_radius":
        return scene.model_copy(update={"eye": scene.eye.model_copy(update={"radius": new})})
    return scene.model_copy(update={"camera": scene.camera.model_copy(update={"height": new})})


@dataclass(frozen=True)
class Estimate:
    """Where a fit stands: the pose, and the scene with the values of its free quantities."""

    pose: Pose
    scene: Scene

    @property
    def pose_size(self) -> int:
        """How many parameters the pose has: tip and axis, and with several spotlights the roll."""
        return 6 if len(self.scene.spotlights) > 1 else 5

    @property
    def profile(self) -> Profile:
        """The beam's profile."""
        return Profile.of(self.scene.beam)

    def beam_changes(self, free: tuple[str, ...]) -> list[tuple[Profile, Profile, float]]:
        """The profile at a little more and less of each free quantity of the beam, and how much lies between."""
        found = []
        for name in (name for name in free if name in BEAM):
            here, step = value(self.scene, name), _BEAM_STEP[name]
            more, less = (Profile.of(with_value(self.scene, name, here + s).beam) for s in (step, -step))
            found.append((more, less, 2.0 * step))
        return found

    def moved(self, step: Array, free: tuple[str, ...]) -> Estimate:
        """The estimate after `step`: pose parameters first, then the free quantities."""
        scene = self.scene
        for name, delta in zip(free, step[self.pose_size :], strict=True):
            scene = with_value(scene, name, value(scene, name) + float(delta))
        return Estimate(moved(self.pose, step[: self.pose_size]), scene)


def rcm_miss(pose: Pose, scene: Scene) -> Array:
    """By how much the axis misses the RCM, along U and V `[2]` [mm]."""
    u, v = tangents(pose.axis)
    offset = np.asarray(scene.instrument.rcm) - pose.apex
    return np.array([u @ offset, v @ offset])


def prior_rows(estimate: Estimate, nominal: Scene, knowns: Knowns) -> tuple[Array, Array]:
    """Whitened residuals `[Q]` and Jacobian `[Q, P]` of what is known, for P = pose parameters and free quantities."""
    free, pose_size = knowns.free, estimate.pose_size
    size = pose_size + len(free)
    residuals: list[float] = []
    rows: list[Array] = []
    if knowns.rcm_sigma_mm is not None:
        sigma = max(knowns.rcm_sigma_mm, _EXACT_MM)
        u, v = tangents(estimate.pose.axis)
        along = float((np.asarray(nominal.instrument.rcm) - estimate.pose.apex) @ estimate.pose.axis)
        for k, unit in enumerate((u, v)):
            row = np.zeros(size)
            row[:3] = -unit
            row[3 + k] = -along
            rows.append(row / sigma)
        residuals.extend(rcm_miss(estimate.pose, nominal) / sigma)
    for j, name in enumerate(free):
        spread = knowns.sigma(name)
        if spread is not None:
            row = np.zeros(size)
            row[pose_size + j] = 1.0 / spread
            rows.append(row)
            residuals.append((value(estimate.scene, name) - value(nominal, name)) / spread)
    return np.array(residuals).reshape(-1), np.array(rows).reshape(-1, size)
