"""A pose: where the tip is and where it points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def rot_x(angle: float) -> Array:
    """Rotation about x by `angle` [rad], `[3, 3]`."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rot_y(angle: float) -> Array:
    """Rotation about y by `angle` [rad], `[3, 3]`."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rot_z(angle: float) -> Array:
    """Rotation about z by `angle` [rad], `[3, 3]`."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class Pose:
    """Position of the tip `apex` `[3]` [mm], unit `axis` `[3]` into the light, `roll` about the axis [rad]."""

    apex: Array
    axis: Array
    roll: float = 0.0

    @classmethod
    def through(cls, apex: ArrayLike, rcm: ArrayLike) -> Pose:
        """The pose with its tip at `apex` `[3]` whose axis comes from the remote centre of motion `rcm` `[3]` [mm].

        Raises ValueError if the two coincide.
        """
        tip, centre = np.asarray(apex, float), np.asarray(rcm, float)
        length = float(np.linalg.norm(centre - tip))
        if length == 0.0:
            raise ValueError("the tip coincides with the remote centre of motion, so it has no direction")
        return cls(tip, (tip - centre) / length)

    @property
    def tilt(self) -> float:
        """Angle between the vertical and the needle, the paper's rotation about Y [rad]."""
        return math.atan2(math.hypot(self.axis[0], self.axis[1]), -float(self.axis[2]))

    @property
    def azimuth(self) -> float:
        """Direction of the needle's horizontal part, tip to RCM, the paper's rotation about Z [rad]."""
        # 0.0 - 0.0 is 0.0 where -0.0 would give pi: a vertical needle has azimuth 0
        return math.atan2(0.0 - float(self.axis[1]), 0.0 - float(self.axis[0]))

    def rotation(self) -> Array:
        """Rz(azimuth) Ry(tilt) Rz(roll) `[3, 3]`: takes (0, 0, -1) to the axis."""
        return rot_z(self.azimuth) @ rot_y(self.tilt) @ rot_z(self.roll)
