"""Monte Carlo noise: how much of it a sensor forgives, and where an image has more."""

from __future__ import annotations

import math
from typing import assert_never

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.scene.emva import Emva
from conespot.scene.sensor import Linear, SingleFrame, Srgb8

#: samples a pixel that are enough in the smooth interior of a patch, and tell where they are not
PILOT = 4
#: side of the window [px] over which the noise is measured: its standard deviation is then known to a seventh
_WINDOW = 5
#: part of the sensor's own noise that the renderer may add: in all 5 % more
_SHARE = 1.0 / 3.0


def tolerance(sensor: SingleFrame) -> float:
    """Standard deviation of a pixel's radiance, relative to it, that the sensor forgives whatever the power.

    Of pixel values without noise of their own it moves none by more than half a level: white none, and a darker one
    less. Of an EMVA 1288 camera it is a third of its noise in a pixel that is about to clip, which is relatively least.
    """
    match sensor:
        case Srgb8():
            # white has the smallest relative level: value = 1.055 L^(1/2.4) - 0.055
            return 0.5 / sensor.full_scale * 2.4 / 1.055
        case Linear():
            return 0.5 / sensor.full_scale
        case Emva():
            return _SHARE * math.sqrt(sensor.saturation + sensor.read_noise**2) / sensor.saturation
        case _:
            assert_never(sensor)


def mean_and_doubt(halves: NDArray[np.float32], relative: float) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """The mean `[h, w, C]` of two halves `[h, w, 2, C]`, and where any channel has more noise than that part of it.

    Two estimates of equal variance differ, in the mean square, by four times the variance of their mean. The
    difference is that of one rendering, so it is averaged over a window, which also reaches around an edge.
    """
    one, other = halves[:, :, 0], halves[:, :, 1]
    mean = 0.5 * (one + other)
    square = np.square(0.5 * (one - other))
    variance = cv2.boxFilter(square, -1, (_WINDOW, _WINDOW), borderType=cv2.BORDER_REFLECT).reshape(square.shape)
    doubt = variance > np.square(np.float32(relative) * mean)
    return mean, doubt[..., 0] if doubt.shape[-1] == 1 else doubt.any(axis=-1)
