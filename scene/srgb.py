"""The sRGB transfer function, IEC 61966-2-1: linear light to codes and back, both from 0 to 1."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

_Float = TypeVar("_Float", bound=np.floating)
#: where the straight foot meets the power law: light, and its code
_FOOT, _FOOT_CODE = 0.0031308, 0.04045


def encoded(light: NDArray[_Float]) -> NDArray[_Float]:
    """Codes of linear light, any shape and precision.

    >>> encoded(np.array([0.0, 0.0031308, 0.5, 1.0])).round(4).tolist()
    [0.0, 0.0404, 0.7354, 1.0]
    """
    return np.where(light <= _FOOT, 12.92 * light, 1.055 * np.maximum(light, 0.0) ** (1.0 / 2.4) - 0.055)


def decoded(code: NDArray[_Float]) -> NDArray[_Float]:
    """Linear light of codes, any shape and precision.

    >>> decoded(encoded(np.array([0.0, 0.001, 0.5, 1.0]))).round(12).tolist()
    [0.0, 0.001, 0.5, 1.0]
    """
    return np.where(code <= _FOOT_CODE, code / 12.92, ((np.maximum(code, _FOOT_CODE) + 0.055) / 1.055) ** 2.4)


def slope(light: NDArray[_Float]) -> NDArray[_Float]:
    """Change of the code per change of linear light, any shape.

    >>> slope(np.array([0.001, 1.0])).round(4).tolist()
    [12.92, 0.4396]
    """
    return np.where(light <= _FOOT, 12.92, 1.055 / 2.4 * np.maximum(light, _FOOT) ** (1.0 / 2.4 - 1.0))
