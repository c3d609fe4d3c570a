"""The needle of an answer as the camera sees it: tip, axis, where it points to on the wall, and how sure the tip is."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.outcome import Localization
from conespot.scene.scene import Scene
from conespot.scene.wall import Wall

Array = NDArray[np.float64]
#: of the needle that is drawn [mm]
_LENGTH = 3.0
#: radius in standard deviations of the ellipsoid that holds the tip in 95 of 100 frames: chi-squared of three degrees
RADIUS_95 = math.sqrt(7.8147)
_STEP = 1e-4  # of the tip, by which its image's derivative is taken [mm]


@dataclass(frozen=True, eq=False)
class Needle:
    """In pixels (column, row; centres at i + 0.5): `tip` `[1, 2]`, `shaft` behind it, `beam` to the wall `[N, 2]`.

    `nearest` `[2, 2]` leads from the tip to the wall's nearest point. `ellipsoid` `[N, 2]` is the outline of the 95 %
    ellipsoid about the tip in its own size, None where the answer states no covariance.
    """

    tip: Array
    shaft: Array
    beam: Array
    nearest: Array
    ellipsoid: Array | None = None

    @classmethod
    def of(cls, found: Localization, scene: Scene) -> Needle:
        """The needle of an answer in a scene."""
        apex, axis = found.apex_mm, found.axis
        wall = Wall.about(scene, apex, axis)

        def drawn(*points: Array) -> Array:
            pixels = scene.camera.project(np.array(points))
            return np.asarray(pixels[np.all(np.isfinite(pixels), axis=1)])

        shaft = [apex - along * axis for along in np.linspace(0.0, _LENGTH, 16)]
        ellipsoid = None if found.covariance is None else _ellipsoid(apex, found.covariance[:3, :3], scene)
        return cls(drawn(apex), drawn(*shaft), drawn(apex, wall.ahead), drawn(apex, wall.nearest), ellipsoid)


def _ellipsoid(apex: Array, covariance: Array, scene: Scene) -> Array:
    """The outline of the 95 % ellipsoid's image `[64, 2]` [px], to first order."""
    steps = np.concatenate([np.eye(3), -np.eye(3)]) * _STEP
    pixels = scene.camera.project(apex + steps)
    by_tip = (pixels[:3] - pixels[3:]).T / (2.0 * _STEP)
    sizes, axes = np.linalg.eigh(by_tip @ covariance @ by_tip.T)
    turn = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    circle = np.stack([np.cos(turn), np.sin(turn)])
    spread = axes @ (np.sqrt(np.maximum(sizes, 0.0))[:, None] * circle)
    return np.asarray(scene.camera.project(apex) + RADIUS_95 * spread.T)
