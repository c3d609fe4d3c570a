"""A sensor's fixed pattern on part of a frame: a function of its serial, the row and the column alone."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.scene.fixed_pattern import FixedPattern

Plane = NDArray[np.float32]
#: the second half of the streams' key, which keeps them apart from those of the frames' noise
_KEY = 1288
_PIXELS, _ROWS, _COLUMNS, _DEFECTS = range(4)
#: crops kept for the next frame: the readout's bands of a video frame of 2160 lines (100 MB), or of 1080 (25 MB)
_KEPT = 17


@dataclass(frozen=True, eq=False)
class Unevenness:
    """What a fixed pattern does to pixels `[h, w]`; nobody may write to it, since other frames share it."""

    response: Plane  #: electrons over those of an even sensor in the same light
    offset: Plane  #: electrons added
    dark_current: Plane  #: added to the sensor's [e-/s]


@functools.lru_cache(maxsize=_KEPT)
def unevenness(pattern: FixedPattern, row: int, column: int, shape: tuple[int, int]) -> Unevenness:
    """That of a crop of `shape` = (h, w) whose first pixel is (row, column) of the frame."""
    height, width = shape
    end = column + width
    pixels = np.stack([_stream(pattern, _PIXELS, row + i).standard_normal((end, 2)) for i in range(height)])
    rows = np.stack([_stream(pattern, _ROWS, row + i).standard_normal(2) for i in range(height)])
    columns = _stream(pattern, _COLUMNS, 0).standard_normal((end, 2))
    defects = np.stack([_stream(pattern, _DEFECTS, row + i).random(end) for i in range(height)])[:, column:]

    def summed(kind: int, pixel: float, by_row: float, by_column: float) -> Plane:
        parts = pixel * pixels[:, column:, kind] + by_row * rows[:, kind, None] + by_column * columns[column:, kind]
        return parts.astype(np.float32)

    dsnu, prnu = pattern.dsnu, pattern.prnu
    response = np.maximum(1.0 + summed(0, prnu.pixel, prnu.row, prnu.column), np.float32(0.0))
    response[defects >= 1.0 - pattern.dead] = 0.0
    hot = np.where(defects < pattern.hot, np.float32(pattern.hot_current), np.float32(0.0))
    planes = response, summed(1, dsnu.pixel, dsnu.row, dsnu.column), hot
    for plane in planes:
        plane.flags.writeable = False
    return Unevenness(*planes)


def _stream(pattern: FixedPattern, kind: int, row: int) -> np.random.Generator:
    key = np.array([pattern.serial, _KEY], np.uint64)
    return np.random.Generator(np.random.Philox(key=key, counter=[0, 0, kind, row]))
