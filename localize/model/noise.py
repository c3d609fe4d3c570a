"""How noisy light is, once pixel values have been turned back to it (`localize.image`).

Inside the estimators a signal of 1 is white: the largest value a pixel can take. Everything a sensor does is behind
`NoiseModel`, so a sensor with electrons only has to say how its variance grows with the signal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

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


def _srgb_slope(signal: Array) -> Array:
    """d code / d signal of the sRGB transfer."""
    s = np.maximum(signal, 0.0031308)
    return np.where(signal <= 0.0031308, 12.92, 1.055 / 2.4 * s ** (1.0 / 2.4 - 1.0))
