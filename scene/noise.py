"""The noise of an image sensor, in units of white: the largest value a pixel can take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.scene.document import InputError
from conespot.scene.srgb import slope

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SensorNoise:
    """Shot, read and quantization noise of a sensor with a linear or an sRGB transfer, unevenness and compression.

    `electrons` at white, `read` noise [e-]: variance = signal / electrons + (read / electrons)^2 + (uneven signal)^2
    + step^2 (1/12 + compression^2). No electrons given means a noiseless exposure: the first two are left out.

    >>> round(1e6 * float(SensorNoise(levels=4095, electrons=13650.0, read=13.0).variance(np.array(0.5))), 3)
    37.542
    """

    levels: int = 255  #: largest pixel value
    srgb: bool = False
    electrons: float | None = None
    read: float = 0.0
    uneven: float = 0.0  #: standard deviation of the pixels' response, relative
    compression: float = 0.0  #: standard deviation of what a lossy recording changes [steps]

    def __post_init__(self) -> None:
        least = min(self.read, self.uneven, self.compression)
        if self.levels < 1 or least < 0.0 or (self.electrons is not None and self.electrons <= 0.0):
            raise InputError("a sensor's noise needs levels >= 1, electrons > 0, read, uneven and compression >= 0")

    def variance(self, signal: Array) -> Array:
        """Variance [white^2] at an expected `signal` [white], any shape."""
        s = np.clip(signal, 0.0, 1.0)
        step: Array | float = 1.0 / self.levels
        if self.srgb:
            step = step / slope(s)
        result = np.square(step) * (1.0 / 12.0 + self.compression**2) + np.square(self.uneven * s)
        if self.electrons is not None:
            result = result + s / self.electrons + (self.read / self.electrons) ** 2
        return np.asarray(result + np.zeros_like(s))
