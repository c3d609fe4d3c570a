"""How bright the spotlights are over the ambient light, where both are on all that is seen."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: least part of the brighter bins' light that tells it: less is as if there were no ambient light
_LEAST = 0.05


def gain_between(
    signal: Array, ambient: Array, light: Array, bright: NDArray[np.bool_], dark: NDArray[np.bool_]
) -> float:
    """Log of the spotlights' intensity over the ambient irradiance, from `bright` and from `dark` bins.

    Both see one albedo: signal / ambient is a (1 + gain light / ambient), with medians over the bins, any shape.
    """
    if min(np.count_nonzero(bright), np.count_nonzero(dark)) < 5:
        return math.log(1e3 / float(light.max()))
    shown, lit = signal / ambient, light / ambient
    high, near = (float(np.median(values[bright])) for values in (shown, lit))
    low, far = (float(np.median(values[dark])) for values in (shown, lit))
    told = max(low * near - high * far, _LEAST * low * near, 1e-12)
    return math.log(max((high - low) / told, 1e-3 / float(light.max())))
