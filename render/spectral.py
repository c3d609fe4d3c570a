"""How a film weighs wavelengths: the sensor's response times the light's spectrum, and the vitreous on the way out.

Light and sensor enter an image only as their product. With the product in the film, whose response decides which
wavelengths are sampled, a grey retina renders without any spectral noise.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import assert_never

import numpy as np

from conespot.scene import Scene, fundus, media
from conespot.scene.emva import Emva
from conespot.scene.illumination import Light
from conespot.scene.optics import Optics
from conespot.scene.sensor import Linear, Srgb8
from conespot.scene.spectrum import Curve

#: up to this many points a spectrum is given to Mitsuba as it is
_FEW_POINTS = 256
_WATER = Curve(np.arange(300.0, 1101.0), np.asarray(fundus.water_transmission(np.arange(300.0, 1101.0))))


@dataclass(frozen=True)
class Channel:
    """One film channel: its name, the sensor's response alone, and the film's curve with the light in it."""

    name: str
    response: Curve
    film: Curve


def unit(scene: Scene) -> str:
    """Unit of what the film integrates: radiance, or weighted with a camera's responsivity."""
    match scene.sensor.camera:
        case Srgb8() | Linear():
            return "W m-2 sr-1"
        case Emva():
            return "A m-2 sr-1"
        case unknown:
            assert_never(unknown)


def has_water(scene: Scene) -> bool:
    """Whether the vitreous absorbs: in a living eye it does."""
    return scene.retina.water


def channels(
    scene: Scene, light: Light, responses: dict[str, Curve] | None = None, *, from_outside: bool = False
) -> tuple[Channel, ...]:
    """The channels of the scene's sensor (or of `responses`) under a light, in the order of their names' table.

    `linear` and a grey `srgb8` have one with response 1: radiance integrated over wavelength. Where the camera looks
    through the eye's optics, its media are in the film: once, and of a light `from_outside` twice.
    """
    spectrum = light.spectrum
    wide = Curve(np.array([300.0, 1100.0]), np.ones(2))
    if responses is None:
        responses = scene.sensor.responses
    found = []
    for name, response in (responses or {"radiance": wide}).items():
        seen = spectrum if responses is None else spectrum.times(response)
        film = seen.times(_WATER) if has_water(scene) else seen
        if scene.camera.optics is not None:
            film = film.times(_media(scene.camera.optics, 2 if from_outside else 1))
        found.append(Channel(name, response, film))
    return tuple(found)


def _media(optics: Optics, passes: int) -> Curve:
    """What becomes of radiance on its way out of the eye, its light having passed the media so many times.

    Radiance over the square of the index stays the same through any optics without loss (Nicodemus, Am. J. Phys.
    31:368, 1963): in air it is that in the vitreous over n^2, whose light goes into a wider cone.
    """
    x = _WATER.wavelengths
    age = optics.age if optics.lens == "phakic" else None
    return Curve(x, media.transmission(x, age) ** passes / optics.index("vitreous", x) ** 2)


def emission(scene: Scene, light: Light, total: float, water_mm: float) -> dict[str, object]:
    """What an emitter radiates, the film having the light's spectrum: the same at all wavelengths.

    In a living eye `water_mm` of vitreous between the light and the retina absorb some.
    """
    if not has_water(scene) or total == 0.0:  # Mitsuba takes no table of zeros
        return {"type": "uniform", "value": total}
    values = _written(emitted(light, total, water_mm))
    low, high = light.spectrum.low, light.spectrum.high
    return {"type": "regular", "wavelength_min": low, "wavelength_max": high, "values": values}


def emitted(light: Light, total: float, water_mm: float) -> list[float]:
    """Values of an emitter's regular spectrum behind `water_mm` of vitreous."""
    x = np.linspace(light.spectrum.low, light.spectrum.high, 129)
    return [float(v) for v in total * fundus.water_transmission(x, water_mm)]


def film_spectrum(curve: Curve) -> dict[str, object]:
    """A film's response for Mitsuba: the curve itself, or with many points an even grid of the same integral."""
    if len(curve.wavelengths) <= _FEW_POINTS:
        return {"type": "irregular", "wavelengths": _written(curve.wavelengths), "values": _written(curve.values)}
    points = int(np.clip(np.ceil((curve.high - curve.low) / 0.5) + 1, 257, 1401))
    values = curve(np.linspace(curve.low, curve.high, points))
    total = float(np.trapezoid(values, dx=(curve.high - curve.low) / (points - 1)))
    if total > 0.0:
        values = values * (curve.integral() / total)
    return {"type": "regular", "wavelength_min": curve.low, "wavelength_max": curve.high, "values": _written(values)}


def reflectance_spectrum(site: str) -> dict[str, object]:
    """A site of the fundus as a regular spectrum at whole nanometres."""
    values = fundus.reflectance(np.arange(300.0, 1101.0), fundus.SITES[site])
    return {"type": "regular", "wavelength_min": 300.0, "wavelength_max": 1100.0, "values": _written(values)}


def _written(values: Iterable[float]) -> str:
    return ", ".join(repr(float(v)) for v in values)
