"""Whether a frame's values can have come about as the scene's sensor says: by its darkest light and by its noise.

Noise tells how values were made whatever the frame shows: shot noise grows with the light, and values with gamma have
least of it where they are largest. It is seen in second differences along rows and columns, in which light that varies
slowly has no part (J. Immerkaer, Fast noise variance estimation, Computer Vision and Image Understanding 64 (1996)).
Texture and a renderer's own noise add to it, most where there is most light: they hide gamma, and never look like it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from conespot.localize.image import Frame, linear_light
from conespot.localize.model.noise import NoiseModel, SensorNoise
from conespot.localize.outcome import BELOW_BLACK, WRONG_NOISE
from conespot.scene import srgb
from conespot.scene.sensor import ImageSensor, Recorded, Srgb8

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DecodingSettings:
    """What of a frame is looked at, and what counts."""

    #: how far around a patch, over its size
    reach: float = 0.5
    #: pixels along the sides of squares, whose mean and noise are taken, and most squares along a side
    side: int = 5
    most: int = 40
    #: of all squares' levels of noise as told, in logarithms: the parts that are dark and bright
    ends: tuple[float, float] = (0.05, 0.95)
    dark: float = 0.3
    bright: float = 0.7
    #: squares of each without which there is nothing to tell
    fewest: int = 12
    #: of the squares' variances: texture is in the others
    quantile: float = 0.25
    #: share of the way from noise as told to that of values with gamma, in logarithms, from which on it is the latter.
    #: Values with gamma go all of it, in frames of 16 rendering samples, which add as much noise as the sensor, 0.25 to
    #: 0.65 (`benchmarks/told_worlds.py`); others go none. A read noise told three times too small goes as far in two of
    #: 64 frames of the image model (400 and 800 px), told twice too small in none
    gamma: float = 1.0 / 3.0
    #: and standard deviations of chance
    sigmas: float = 5.0
    #: standard deviations of a pixel in the dark by which a quarter of the squares must be darker than black
    black: float = 2.0


DECODING = DecodingSettings()
#: variance of second differences of second differences of white noise: the square of 1 + 4 + 1
_ROUGH = 36.0
#: standard deviation of the logarithm of a quarter's quantile of squares' variances, of white noise: of N squares it
#: is less by the root of N (16,000 samples of 24)
_SCATTER = 1.05
#: steps that round nothing
_FINE = 10**9


def decoded_amiss(frame: Frame, noise: NoiseModel, rows: slice, columns: slice) -> str | None:
    """The reason why a part of a frame was not made as the sensor says; None if nothing speaks against it."""
    sensor = frame.sensor
    squares = _squares(frame, rows, columns)
    if any(_below_black(light, noise) for light in squares):
        return BELOW_BLACK
    # what a compression leaves of noise tells of the compression
    if isinstance(sensor, Recorded | Srgb8) or not isinstance(noise, SensorNoise) or noise.electrons is None:
        return None
    return WRONG_NOISE if squares and all(_has_gamma(light, noise, sensor) for light in squares) else None


@dataclass(frozen=True, eq=False)
class _Squares:
    """Light of one channel's squares that are not clipped: means `[N]` [white], and variances of a pixel's noise."""

    level: Array
    variance: Array


def _squares(frame: Frame, rows: slice, columns: slice) -> list[_Squares]:
    """Those of each channel, spread over a part of the frame."""
    part = frame.pixels[rows, columns]
    part = part.reshape(*part.shape[:2], -1)
    side = DECODING.side
    if min(part.shape[:2]) < side:
        return []
    apart = max(side, -(-max(part.shape[:2]) // DECODING.most))
    seen = sliding_window_view(part, (side, side), axis=(0, 1))[::apart, ::apart]
    light, clipped = linear_light(np.ascontiguousarray(seen), frame.sensor, frame.ringing)
    found = []
    for channel in range(part.shape[2]):
        own = light[:, :, channel][~clipped[:, :, channel].any(axis=(2, 3))].astype(float)
        rough = np.diff(np.diff(own, 2, axis=1), 2, axis=2)
        found.append(_Squares(own.mean(axis=(1, 2)), np.square(rough).mean(axis=(1, 2)) / _ROUGH))
    return found


def _below_black(squares: _Squares, noise: NoiseModel) -> bool:
    """Whether a quarter of the squares are darker than no light."""
    if len(squares.level) < DECODING.fewest:
        return False
    dark = float(np.quantile(squares.level, DECODING.quantile))
    return dark < -DECODING.black * math.sqrt(float(noise.variance(np.zeros(()))))


def _has_gamma(squares: _Squares, noise: SensorNoise, sensor: ImageSensor) -> bool:
    """Whether noise grows with the light less than it would, by a good part of what it would if values had gamma."""
    if not len(squares.level):
        return False
    told = np.log(noise.variance(squares.level))
    low, high = np.quantile(told, DECODING.ends)
    parts = [told <= low + DECODING.dark * (high - low), told >= low + DECODING.bright * (high - low)]
    counts = [int(np.count_nonzero(part)) for part in parts]
    if min(counts) < DECODING.fewest:
        return False

    def growth(logarithms: Array) -> float:
        dark, bright = (float(np.median(logarithms[part])) for part in parts)
        return bright - dark

    dark, bright = (float(np.quantile(squares.variance[part], DECODING.quantile)) for part in parts)
    if not min(dark, bright) > 1.0 / (12.0 * noise.levels**2):  # rounded away
        return False
    missing = growth(told) - math.log(bright / dark)
    chance = _SCATTER * math.hypot(*(1.0 / math.sqrt(count) for count in counts))
    with_gamma = growth(np.log(_noise_with_gamma(squares.level, noise, sensor)))
    return missing > max(DECODING.gamma * (growth(told) - with_gamma), DECODING.sigmas * chance)


def _noise_with_gamma(level: Array, noise: SensorNoise, sensor: ImageSensor) -> Array:
    """Variance of values with gamma `[N]` [white^2] that are taken for linear ones at a `level` `[N]`."""
    share = level + sensor.black_level / sensor.full_scale
    light = srgb.decoded(np.clip(share, 0.0, 1.0))
    exposed = replace(noise, levels=_FINE).variance(sensor.decode(light))
    return np.asarray(exposed * np.square(srgb.slope(light)) + 1.0 / (12.0 * noise.levels**2))
