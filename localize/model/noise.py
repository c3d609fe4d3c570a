"""How noisy light is, once pixel values have been turned back to it (`localize.image`).

Inside the estimators a signal of 1 is white: the largest value a pixel can take. Everything a sensor does is behind
`NoiseModel`, so a sensor with electrons only has to say how its variance grows with the signal.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from conespot.scene.noise import SensorNoise

__all__ = ["NoiseModel", "SensorNoise"]
Array = NDArray[np.float64]


class NoiseModel(Protocol):
    """What an estimator must know of a sensor."""

    def variance(self, signal: Array) -> Array:
        """Variance of one pixel [white^2] whose expected signal is `signal` [white], any shape."""
