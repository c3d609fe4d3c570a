"""What a JPEG's quantization rounds, and how much it rounds away."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

#: pixels along the side of a block
BLOCK = 8

#: quantization of luminance at quality 50, in rows of 8 frequencies (ITU-T T.81, Table K.1)
_LUMINANCE = np.array(
    [
        [16, 11, 10, 16, 24, 40, 51, 61],
        [12, 12, 14, 19, 26, 58, 60, 55],
        [14, 13, 16, 24, 40, 57, 69, 56],
        [14, 17, 22, 29, 51, 87, 80, 62],
        [18, 22, 37, 56, 68, 109, 103, 77],
        [24, 35, 55, 64, 81, 104, 113, 92],
        [49, 64, 78, 87, 103, 121, 120, 101],
        [72, 92, 95, 98, 112, 100, 103, 99],
    ]
)


def luminance_steps(quality: int) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    """Steps `[8, 8]` to which a luminance's frequencies are rounded at a quality of 1 to 100, as libjpeg scales them.

    >>> luminance_steps(90)[0].tolist()
    [3, 2, 2, 3, 5, 8, 10, 12]
    """
    scale = 5000 // quality if quality < 50 else 200 - 2 * quality
    steps = np.clip((_LUMINANCE * scale + 50) // 100, 1, 255)
    return steps.astype(np.int64)


def rounding_error(quality: int) -> float:
    """Standard deviation [levels] of a pixel's error where all frequencies are busy, as across an edge.

    The transform keeps energy: it is the mean of steps^2 / 12. Where an image is smooth it is less.

    >>> round(rounding_error(90), 1)
    3.9
    """
    return math.sqrt(float(np.mean(np.square(luminance_steps(quality)))) / 12.0)


@cache
def cosines() -> NDArray[np.float64]:
    """The orthonormal cosine transform of a block's side `[8, 8]`.

    >>> bool(np.allclose(cosines() @ cosines().T, np.eye(8)))
    True
    """
    order = np.arange(BLOCK)[:, None]
    wave = np.cos(np.pi * order * (np.arange(BLOCK) + 0.5) / BLOCK) * np.sqrt(2.0 / BLOCK)
    wave[0] /= np.sqrt(2.0)
    return np.asarray(wave)
