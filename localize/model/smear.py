"""The smear of a hand's tremor: how far the tip's places during an exposure scatter, and in which direction.

In an exposure much shorter than its waves a tremor is a steady velocity, of which nobody tells a localizer and whose
sign no frame shows. What a frame shows is the covariance of the tip's places, v v^T T^2 / 12. It widens each part of
the outline by what that part moves, which a blur that is the same in all directions does not.
"""

from __future__ import annotations

from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from conespot.scene.motion import Tremor, Velocity, exposure_of
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: the six entries of a symmetric matrix `[3, 3]`
ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class Smeared(Tremor):
    """A tremor whose way in one frame is being estimated."""

    way: tuple[float, float, float, float, float, float]  #: covariance of the tip's places, by `ENTRIES` [mm^2]


def way_covariance(scene: Scene) -> Array:
    """Covariance `[3, 3]` [mm^2] of the tip's places during the exposure: of a tremor the mean one."""
    match scene.motion:
        case None:
            return np.zeros((3, 3))
        case Velocity():
            way = exposure_of(scene.motion, scene.sensor) * np.asarray(scene.motion.velocity)
            return np.outer(way, way) / 12.0
        case Smeared():
            xx, yy, zz, xy, xz, yz = scene.motion.way
            return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        case Tremor():
            return np.eye(3) * smear_sigma(scene) ** 2
        case unknown:
            assert_never(unknown)


def smear_sigma(scene: Scene) -> float:
    """Root mean square deviation of the tip along an axis during an exposure that a scene's tremor has [mm]; or 0."""
    tremor = scene.motion
    return tremor.smear(exposure_of(tremor, scene.sensor)) if isinstance(tremor, Tremor) else 0.0


def sag_sigma(scene: Scene) -> float:
    """How far the tip's mean place in an exposure, which is what a frame shows, is off that in its middle [mm]; or 0.

    Root mean square along an axis. A straight way has both in one place; a scene's tremor bends it.
    """
    tremor = scene.motion
    return tremor.sag(exposure_of(tremor, scene.sensor)) if isinstance(tremor, Tremor) else 0.0


def with_way(scene: Scene, entry: tuple[int, int], new: float) -> Scene:
    """The scene, which has a tremor, with another entry of its way's covariance [mm^2]."""
    way = way_covariance(scene)
    way[entry] = way[entry[::-1]] = new
    return smeared(scene, way)


def smeared(scene: Scene, way: Array) -> Scene:
    """The scene, which has a tremor, with a way of covariance `[3, 3]` [mm^2]."""
    tremor = scene.motion
    assert isinstance(tremor, Tremor)
    told = {name: getattr(tremor, name) for name in Tremor.model_fields}
    values = tuple(float(way[entry]) for entry in ENTRIES)
    return scene.model_copy(update={"motion": Smeared(**told, way=values)})
