"""Where a fit stands: a pose, and a scene with the values of its free quantities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.forward import moved
from conespot.localize.model.profile import Profile
from conespot.localize.model.quantity import Quantity
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene

Array = NDArray[np.float64]


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

    def beside(self, quantity: Quantity, step: float) -> Scene:
        """The scene with `step` more of a quantity."""
        return quantity.write(self.scene, quantity.value(self.scene) + step)

    def beam_changes(self, free: tuple[Quantity, ...]) -> list[tuple[Profile, Profile, float]]:
        """The profile at a little more and less of each free quantity of the beam, and how much lies between."""
        found = []
        for each in (each for each in free if each.changes == "beam"):
            more, less = (Profile.of(self.beside(each, step).beam) for step in (each.step, -each.step))
            found.append((more, less, 2.0 * each.step))
        return found

    def wider(self, free: tuple[Quantity, ...]) -> list[tuple[Scene, float]]:
        """The scene with a little more of each free quantity that spreads the image, and how much more."""
        return [(self.beside(each, each.step), each.step) for each in free if each.changes == "spread"]

    def blocked(self, quantity: Quantity, step: float) -> bool:
        """Whether a quantity is at an end that a step would leave: a blur where there is none cannot be less."""
        here = quantity.value(self.scene)
        return step != 0.0 and quantity.value(quantity.write(self.scene, here + step)) == here

    def moved(self, step: Array, free: tuple[Quantity, ...]) -> Estimate:
        """The estimate after `step`: pose parameters first, then the free quantities."""
        scene = self.scene
        for each, delta in zip(free, step[self.pose_size :], strict=True):
            scene = each.write(scene, each.value(scene) + float(delta))
        return Estimate(moved(self.pose, step[: self.pose_size]), scene)
