"""Which way something looks that stands above the eye."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def axes(tilt: float, azimuth: float, roll: float) -> Array:
    """Unit vectors `[3, 3]`, one a row: to the right, up, and back along its axis, for angles [rad].

    The axis is `tilt` off the vertical towards `azimuth` (from +x to +y); `roll` takes the right side down.

    >>> axes(0.0, 1.0, 0.0).round(12).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    turn = _about_z(azimuth)
    lean = np.array([[math.cos(tilt), 0.0, math.sin(tilt)], [0.0, 1.0, 0.0], [-math.sin(tilt), 0.0, math.cos(tilt)]])
    return np.asarray((turn @ lean @ turn.T @ _about_z(-roll)).T)


def _about_z(angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
