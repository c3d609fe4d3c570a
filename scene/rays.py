"""What a camera's pixels see along."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Rays:
    """What pixels see along, and how that changes from pixel to pixel: x to the right, y down.

    Where all rays have the same, an array is one vector `[3]`, which goes with the others as numpy broadcasts.
    """

    origins: Array  #: `[..., 3]` [mm]
    directions: Array  #: unit, away from the camera `[..., 3]`
    origins_by_x: Array  #: `[..., 3]` [mm/px]
    origins_by_y: Array  #: `[..., 3]` [mm/px]
    directions_by_x: Array  #: across the directions `[..., 3]` [1/px]
    directions_by_y: Array  #: across the directions `[..., 3]` [1/px]
