"""From pixel values back to light, and how noisy that light is.

Inside the estimators a signal of 1 is white: the largest value a pixel can take. Everything a sensor does is behind
`NoiseModel`, so a sensor with electrons only has to say how its variance grows with the signal.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.scene.document import InputError
from conespot.scene.emva import Emva
from conespot.scene.scene import Scene
from conespot.scene.sensor import Srgb8

Array = NDArray[np.float64]


class NoiseModel(Protocol):
    """What an estimator must know of a sensor."""

    def variance(self, signal: Array) -> Array:
        """Variance of one pixel [white^2] whose expected signal is `signal` [white], any shape."""


@dataclass(frozen=True)
class SensorNoise:
    """Shot, read and quantization noise of a sensor with a linear or an sRGB transfer.

    `electrons` at white, `read` noise [e-]: variance = signal / electrons + (read / electrons)^2 + step^2 / 12.
    No electrons given means a noiseless exposure: only the quantization remains.
    """

    levels: int = 255  #: largest pixel value
    srgb: bool = False
    electrons: float | None = None
    read: float = 0.0

    def __post_init__(self) -> None:
        if self.levels < 1 or self.read < 0.0 or (self.electrons is not None and self.electrons <= 0.0):
            raise InputError("a sensor's noise needs levels >= 1, electrons > 0 and read >= 0")

    def variance(self, signal: Array) -> Array:
        """Variance [white^2] at an expected `signal` [white]."""
        s = np.clip(signal, 0.0, 1.0)
        step: Array | float = 1.0 / self.levels
        if self.srgb:
            step = step / _srgb_slope(s)
        result = np.square(step) / 12.0
        if self.electrons is not None:
            result = result + s / self.electrons + (self.read / self.electrons) ** 2
        return np.asarray(result + np.zeros_like(s))


def noise_of(scene: Scene) -> NoiseModel:
    """The noise model of the scene's sensor: EMVA 1288 for a camera, else quantization only."""
    sensor = scene.sensor
    if isinstance(sensor, Emva):
        levels = sensor.full_scale
        return SensorNoise(levels=levels, electrons=levels / sensor.gain, read=sensor.read_noise)
    return SensorNoise(levels=sensor.full_scale, srgb=isinstance(sensor, Srgb8))


def linear_light(pixels: NDArray[np.generic], scene: Scene) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Signals [white] of pixel values of any shape, and which of them are clipped and only bounds.

    uint8: 255 is white; uint16: the sensor's full scale; float: 1.0. An sRGB sensor's transfer is undone, a camera's
    black level taken off. Raises InputError for any other type.
    """
    if isinstance(scene.sensor, Emva):
        sensor = scene.sensor
        full = 255.0 if pixels.dtype == np.uint8 else sensor.full_scale if pixels.dtype == np.uint16 else 1.0
        value = pixels.astype(np.float32) / np.float32(full)
        black = sensor.black_level / sensor.full_scale
        # a pixel near the full well is as good as clipped: its noise is cut off on one side
        limit = black + 0.98 * min(1.0 - black, sensor.saturation * sensor.gain / sensor.full_scale)
        return value - np.float32(black), value >= limit
    srgb = isinstance(scene.sensor, Srgb8)
    if pixels.dtype == np.uint8 or pixels.dtype == np.uint16:
        full = 255 if pixels.dtype == np.uint8 else min(scene.sensor.full_scale, 65535)
        table = _table(full, 256 if pixels.dtype == np.uint8 else 65536, srgb)
        return table[pixels], np.asarray(pixels, np.uint16) >= full
    if np.issubdtype(pixels.dtype, np.floating):
        signal = pixels.astype(np.float32)
        clipped = signal >= 1.0
        return (_srgb_decode(signal).astype(np.float32) if srgb else signal), clipped
    raise InputError(f"an image must be uint8, uint16 or float, not {pixels.dtype}")


@lru_cache(maxsize=8)
def _table(full: int, size: int, srgb: bool) -> NDArray[np.float32]:
    code = np.minimum(np.arange(size) / full, 1.0)
    return (_srgb_decode(code) if srgb else code).astype(np.float32)


def _srgb_decode(code: ArrayLike) -> Array:
    """IEC 61966-2-1."""
    c = np.asarray(code, float)
    return np.where(c <= 0.04045, c / 12.92, ((np.maximum(c, 0.04045) + 0.055) / 1.055) ** 2.4)


def _srgb_slope(signal: Array) -> Array:
    """d code / d signal of the sRGB transfer."""
    s = np.maximum(signal, 0.0031308)
    return np.where(signal <= 0.0031308, 12.92, 1.055 / 2.4 * s ** (1.0 / 2.4 - 1.0))
