"""What the colours of light do to an image seen through the eye's optics: each colour's has a size of its own.

The image of light of many wavelengths has the size of one of them. That is not their mean, since the blue image is far
larger than the red one is smaller; and it is another where the retina has another colour.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from conespot.scene import fundus, media
from conespot.scene.optics import Optics
from conespot.scene.spectrum import Curve, mean_of

Array = NDArray[np.float64]
#: [nm]; the media's indices are known from 365 to 1014, and go on smoothly to where a camera sees nothing
_WAVELENGTHS = np.arange(360.0, 1101.0)
#: how far from the pole a ray is aimed, the optics left out [mm]
_AIMED = 1.0


def seen_light(
    light: Curve, place: fundus.Pigments | None, optics: Optics | None, responses: Mapping[str, Curve] | None
) -> Curve:
    """Light [1/nm] as a sensor sees it, over all its channels, from a place of a living fundus or a grey one."""
    x = np.arange(300.0, 1101.0)
    passed = np.ones_like(x) if place is None else fundus.reflectance(x, place)
    if optics is not None:
        passed = passed * media.transmission(x, optics.age if optics.lens == "phakic" else None)
    if responses is not None:
        passed = passed * sum((response(x) for response in responses.values()), np.zeros_like(x))
    return light.times(Curve(x, passed))


def wavelength_of_image(optics: Optics, height: float, light: Curve) -> float:
    """Wavelength [nm] whose image is as large as that of the `light`, for a camera so high above the pole [mm]."""
    met = _met(optics, height)
    return float(np.interp(_mean(light, met), met, _WAVELENGTHS))


def size_sigma(optics: Optics, height: float, lights: Sequence[Curve]) -> float:
    """Standard deviation of the size of an image, relative, that may be of any of the `lights`."""
    met = _met(optics, height)
    sizes = [1.0 / _mean(light, met) for light in lights]
    return float(np.std(sizes) / np.mean(sizes))


def _met(optics: Optics, height: float) -> Array:
    """How far from the pole one pixel's rays meet the retina's tangent plane [mm], at `_WAVELENGTHS`."""
    way = np.array([_AIMED, 0.0, -height]) / np.hypot(_AIMED, height)
    start = np.array([0.0, 0.0, height])
    with np.errstate(invalid="ignore", divide="ignore"):
        origin, direction, _ = optics.enter(tuple(start), tuple(way), _WAVELENGTHS, np.sqrt)
    return np.asarray(origin[0] - direction[0] * origin[2] / direction[2])


def _mean(light: Curve, met: Array) -> float:
    return mean_of(light.cut(float(_WAVELENGTHS[0]), float(_WAVELENGTHS[-1])), Curve(_WAVELENGTHS, met))
