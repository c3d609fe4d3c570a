"""Transfers that frames are often told to have in place of their own, and what that does to the light."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.residual import RESIDUAL
from conespot.scene import srgb
from conespot.scene.emva import Emva
from conespot.scene.sensor import ImageSensor, Linear, Srgb8

Array = NDArray[np.float64]
_SHARES = np.linspace(0.0, 1.0, 4097)


def mistake(sensor: ImageSensor) -> Callable[[Array], Array] | None:
    """Of light as told [white], any shape: its logarithm over that of what it truly was, if the usual mistake was made.

    Values with gamma are taken for linear ones or the reverse. None for a recorder: what it makes of the light around
    an edge hides its range.
    """
    true = _otherwise(sensor)
    if true is None:
        return None

    def of(model: Array) -> Array:
        seen = np.minimum(model, 1.0)
        light = true(np.interp(seen, sensor.decode(_SHARES), _SHARES))
        return np.asarray(np.log(seen / np.maximum(light, RESIDUAL.darkest * seen)))

    return of


def _otherwise(sensor: ImageSensor) -> Callable[[Array], Array] | None:
    """How values would be decoded if the mistake was made."""
    match sensor:
        case Srgb8():
            return np.asarray
        case Linear() | Emva():
            return lambda share: sensor.decode(srgb.decoded(share))
        case _:
            return None
