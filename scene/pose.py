"""A pose: where the tip is and where it points."""

from __future__ import annotations

import functools
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
    """Position of the tip `apex` `[3]` [mm], unit `axis` `[3]` into the light, `roll` about the axis [rad].

    Of an instrument that moves it is the pose at mid-exposure; `sway` `[K, 3]` is where the tip is off it [mm], at even
    instants from the first to the last of the exposure.
    """

    apex: Array
    axis: Array
    roll: float = 0.0
    sway: Array | None = None

    @classmethod
    def through(cls, apex: ArrayLike, rcm: ArrayLike, sway: Array | None = None) -> Pose:
        """The pose with its tip at `apex` `[3]` whose axis comes from the remote centre of motion `rcm` `[3]` [mm].

        >>> pose = Pose.through([0.0, 0.0, 4.0], [0.0, 3.0, 8.0])
        >>> pose.axis.tolist(), round(math.degrees(pose.azimuth), 6), round(math.degrees(pose.tilt), 6)
        ([0.0, -0.6, -0.8], 90.0, 36.869898)

        Raises ValueError if the two coincide.
        """
        tip, centre = np.asarray(apex, float), np.asarray(rcm, float)
        length = float(np.linalg.norm(centre - tip))
        if length == 0.0:
            raise ValueError("the tip coincides with the remote centre of motion, so it has no direction")
        return cls(tip, (tip - centre) / length, sway=sway)

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


def tangents(axis: Array) -> tuple[Array, Array]:
    """Unit vectors U, V `[3]` across the unit `axis` `[3]`: the first two columns of `Pose.rotation()` without roll.

    U lies in the vertical plane through the axis. An axis' covariance is stated in this basis,
    axis' = axis + du U + dv V [rad], and a cone's outline is counted in it.

    >>> [part.round(12).tolist() for part in tangents(np.array([0.0, 0.0, -1.0]))]
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    return _tangents(np.asarray(axis, float).tobytes())


@functools.lru_cache(maxsize=64)
def _tangents(axis: bytes) -> tuple[Array, Array]:
    """A fit asks for those of one axis a dozen times; nobody may write into them."""
    pose = Pose(np.zeros(3), np.frombuffer(axis))
    azimuth, tilt = pose.azimuth, pose.tilt
    c, s, down = math.cos(azimuth), math.sin(azimuth), math.cos(tilt)
    frame = np.array([[c * down, s * down, -math.sin(tilt)], [-s, c, 0.0]]) + 0.0  # no zero is negative
    frame.flags.writeable = False
    return frame[0], frame[1]


def cone_rays(axis: Array, half_angle: ArrayLike, azimuth: ArrayLike) -> Array:
    """Unit directions `[..., 3]` at angles `half_angle` off the unit `axis` `[3]` and `azimuth` from U to V [rad].

    >>> (cone_rays(np.array([0.0, 0.0, -1.0]), math.pi / 2.0, [0.0, math.pi / 2.0]).round(12) + 0.0).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    """
    u, v = tangents(axis)
    b, phi = np.asarray(half_angle, float)[..., None], np.asarray(azimuth, float)[..., None]
    return np.asarray(np.cos(b) * axis + np.sin(b) * (np.cos(phi) * u + np.sin(phi) * v))
