"""Light that goes through the pigment epithelium and comes back elsewhere, gathered on the retina's surface.

    L(x) = t(x) / pi * integral of K(|x - x'|) t(x') E(x') dA'

t is the root of what the closed form of `scene.fundus` leaves of the light behind the epithelium, passed going in and
going out; K, whose integral is 1, is `scene.spread`'s; E the irradiance. Over an even retina in even light the whole is
the closed form. This module makes the integral as maps over a `Chart`; `glow.py` multiplies it with t(x) / pi where a
camera's ray ends. Light that a bump keeps from the surface is not there; the shadow of the shaft in the ambient light
is left out.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from conespot.render import spectral
from conespot.render.fundus_anatomy import COARSE, EXTENT
from conespot.render.fundus_maps import fundus_maps
from conespot.render.retina_mesh import arc_extent
from conespot.render.source import stands
from conespot.scene import Pose, Scene, fundus
from conespot.scene.chart import Chart
from conespot.scene.power import Power
from conespot.scene.retina import Fundus, Spread
from conespot.scene.spectrum import Curve
from conespot.scene.spotlights import spotlight_axes
from conespot.scene.spread import Kernel, spread_kernel

Array = NDArray[np.float64]
Maps = NDArray[np.float32]

#: side of a map's cell [mm], at most
CELL = 0.02
#: cells along a spotlight's map, at least: where light goes less far, cells are smaller
CELLS = 250
#: share of the deep light that comes back further away than the maps reach
LOST = 1e-3
#: rays of a spotlight
RAYS = 2**16
#: between wavelengths whose light is spread [nm]; the maps are relative to a typical t, which has the fine structure
STEP = 25.0
#: below this next to no deep light is left in any eye [nm]; the table of kernels begins at 500 nm and holds before it
SHORTEST = 450.0
#: at which a film is integrated
_POINTS = 4001
#: part of the film's response left out at either end
_TAIL = 1e-3
_TYPICAL = fundus.SITES["perifovea"]
_PER_M2 = 1e6


@dataclass(frozen=True, eq=False)
class DeepMaps:
    """The integral above over a chart, divided by `typical` t, at each of the wavelengths."""

    chart: Chart
    values: Maps  #: `[W m-2 per unit of the film's light]` `[wavelengths, side, side]`
    #: what the channels see of a value times t over the typical one, at each wavelength `[C, wavelengths]`
    weights: Array


class DeepLight:
    """The deep light of a scene's retina under a light, for a film's channels."""

    def __init__(self, scene: Scene, retina: Fundus, films: list[Curve]) -> None:
        self.scene, self.retina = scene, retina
        self.wavelengths, self._films = nodes(films), films
        self._how = how = retina.spread or Spread()
        self.kernels = [spread_kernel(w, retina.pigmentation, how.scattering, how.length) for w in self.wavelengths]
        self.reach = max(kernel.reach(LOST) for kernel in self.kernels)

    def spotlight(self, pose: Pose, spotlight: int) -> DeepMaps:
        """Of a spotlight at 1 W."""
        scene, beam = self.scene, self.scene.beam
        intensity = Power(value=1.0, convention=scene.power.convention).axial_intensity(beam) * _PER_M2
        centre, around = self._patch(pose, spotlight)
        half = around + self.reach
        chart = Chart.about(scene, centre, half, min(CELL, 2.0 * half / CELLS))
        points = stands(scene, pose, spotlight)
        density = np.zeros((chart.side, chart.side))
        for point in points:
            axis = spotlight_axes(point, scene.spotlights)[spotlight]
            rays, solid_angle = cone_lattice(axis, beam.half_angle, RAYS // len(points))
            hit = scene.surface.intersect(scene.eye, point.apex, rays)
            met = np.all(np.isfinite(hit), axis=-1)
            flux = intensity * solid_angle * beam.intensity(rays @ axis)[met] / len(points)
            away = hit[met] - scene.eye.centre
            density += chart.gathered(away / np.linalg.norm(away, axis=-1, keepdims=True), flux)
        axis = spotlight_axes(pose, scene.spotlights)[spotlight]
        on_axis = scene.surface.intersect(scene.eye, pose.apex, axis)
        return self._spread(chart, density, float(np.linalg.norm(on_axis - pose.apex)))

    def outline(self, pose: Pose, spotlight: int, points: int = 64) -> Array:
        """A ring on the surface `[points, 3]` [mm] outside which there is next to no light of a spotlight."""
        centre, around = self._patch(pose, spotlight)
        turn = np.arange(points) * 2.0 * math.pi / points
        ring = (around + self.reach) * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        return self.scene.surface.points(self.scene.eye, Chart.about(self.scene, centre, 0.0, CELL).directions(ring))

    def _patch(self, pose: Pose, spotlight: int) -> tuple[Array, float]:
        """The middle of a spotlight's patch `[3]` and how far from it light falls [mm]."""
        rim = self.scene.outline(pose, spotlight)
        rim = rim[np.all(np.isfinite(rim), axis=-1)]
        centre = rim.mean(axis=0)
        return centre, float(np.linalg.norm(rim - centre, axis=-1).max()) + self.scene.surface.relief

    def ambient(self) -> DeepMaps:
        """Of the microscope's light, over all that the camera sees."""
        scene = self.scene
        chart = Chart.about(scene, np.zeros(3), arc_extent(scene) + self.reach, CELL)
        facing = scene.surface.normals(scene.eye, chart.cells) @ scene.ambient.towards
        density = scene.ambient.irradiance * np.maximum(facing, 0.0)
        if chart.stretch is not None:
            density *= chart.stretch
        return self._spread(chart, density, fundus.VITREOUS_LENGTH)

    def _spread(self, chart: Chart, density: Array, water_mm: float) -> DeepMaps:
        """The maps of light that falls with a `density` on the chart [W m-2 of it] `[side, side]`."""
        lit = density > 0.0
        entry = EntryMap(self.retina, self.scene.eye.arc(chart.cells[lit]))
        values = np.empty((len(self.wavelengths), chart.side, chart.side), np.float32)
        for i, (wavelength, kernel) in enumerate(zip(self.wavelengths, self.kernels, strict=True)):
            entered = np.zeros_like(density, dtype=np.float32)
            entered[lit] = density[lit] * entry.passage(wavelength) / typical(wavelength)
            transfer = _transfer(chart, kernel)
            values[i] = _convolved(entered, transfer)
            if chart.stretch is not None:
                # even light stays even where the surface has more area than the map
                values[i] /= _convolved(chart.stretch.astype(np.float32), transfer)
        np.maximum(values, 0.0, out=values)
        return DeepMaps(chart, values, self._weights(water_mm))

    def _weights(self, water_mm: float) -> Array:
        """Integrals over the films of the typical t, in and out, and so much water, shared between the wavelengths.

        What maps make of the typical t goes in proportion from one of the wavelengths to the next.
        """
        rows = []
        for film in self._films:
            x = np.linspace(film.low, film.high, _POINTS)
            light = film(x) * (film.integral() / np.trapezoid(film(x), x))
            passed = light * self._how.amount * typical(x) ** 2 / math.pi
            if spectral.has_water(self.scene):
                passed *= fundus.water_transmission(x, water_mm)
            hats = [np.interp(x, self.wavelengths, one) for one in np.eye(len(self.wavelengths))]
            rows.append([float(np.trapezoid(passed * hat, x)) for hat in hats])
        return np.array(rows)


class EntryMap:
    """t at places of the retina, as light that goes in meets it: from the maps at texels of `COARSE`."""

    def __init__(self, retina: Fundus, arc: Array) -> None:
        """At arc coordinates `[N, 2]` [mm]."""
        self._retina = retina
        column = ((arc[:, 0] + EXTENT) / COARSE - 0.5).astype(np.float32)
        row = ((EXTENT - arc[:, 1]) / COARSE - 0.5).astype(np.float32)
        layers = _coarse_layers(retina)
        # remap takes no more than four channels, and no row longer than 32767
        width = 4096
        pad = max(-len(arc) % width, width - len(arc))  # a row at least: where no light falls there is no place
        x, y = (np.pad(values, (0, pad)).reshape(-1, width) for values in (column, row))
        sampled = [cv2.remap(layer, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) for layer in layers]
        self._values = [values.ravel()[: len(arc)] for values in sampled]

    def passage(self, wavelength: float) -> NDArray[np.float32]:
        """t `[N]` at a wavelength [nm]."""
        melanin, blood, epithelium, macular, disc, artery, vein = self._values
        density = melanin * float(fundus.melanin_template(wavelength)) + macular * float(
            fundus.macular_template(wavelength)
        )
        exponent = math.log(10.0) * density + blood * _absorbed(wavelength, fundus.BLOOD.choroid_saturation)
        t = (1.0 - epithelium) * np.exp(-exponent) * np.sqrt((1.0 - disc) * float(fundus.scatter(wavelength)))
        for path, saturation in ((artery, self._retina.artery_saturation), (vein, self._retina.vein_saturation)):
            through = np.exp(-2.0 * _absorbed(wavelength, saturation) * path)
            t *= np.sqrt(fundus.BLOOD.bypass + (1.0 - fundus.BLOOD.bypass) * through)
        return np.asarray(t, np.float32)


def nodes(films: list[Curve]) -> list[float]:
    """Wavelengths [nm] at which light is spread: evenly over what the films together see, not below `SHORTEST`."""
    x = np.unique(np.concatenate([np.linspace(film.low, film.high, 1001) for film in films]))
    seen = np.cumsum(np.maximum(sum(film(x) for film in films), 0.0) * np.gradient(x))
    low, high = np.interp([_TAIL, 1.0 - _TAIL], seen / seen[-1], x)
    low, high = max(low, SHORTEST), max(high, SHORTEST)
    count = 1 if high - low < STEP / 5.0 else math.ceil((high - low) / STEP) + 1
    return np.linspace(low, high, count).tolist() if count > 1 else [0.5 * (low + high)]


def cone_lattice(axis: Array, half_angle: float, count: int) -> tuple[Array, float]:
    """Unit directions `[count, 3]` that fill a cone evenly, and the solid angle of each [sr]: Fibonacci's lattice."""
    cosine = 1.0 - (np.arange(count) + 0.5) / count * (1.0 - math.cos(half_angle))
    turn = np.arange(count) * math.pi * (3.0 - math.sqrt(5.0))
    sine = np.sqrt(1.0 - cosine**2)
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    second = np.cross(axis, first)
    rays = cosine[:, None] * axis + (sine * np.cos(turn))[:, None] * first + (sine * np.sin(turn))[:, None] * second
    return rays, 2.0 * math.pi * (1.0 - math.cos(half_angle)) / count


def typical(wavelength: float | Array) -> Array:
    """t of the perifovea without vessels."""
    x = np.asarray(wavelength, float)
    density = _TYPICAL.melanin * fundus.melanin_template(x) + _TYPICAL.macular * fundus.macular_template(x)
    blood = fundus.blood_absorption(x, fundus.BLOOD.choroid_saturation) * _TYPICAL.blood
    return np.asarray((1.0 - _TYPICAL.epithelium) * 10.0**-density * np.exp(-blood) * np.sqrt(fundus.scatter(x)))


def _absorbed(wavelength: float, saturation: float) -> float:
    return float(fundus.blood_absorption(wavelength, saturation))


@functools.lru_cache(maxsize=4)
def _coarse_layers(retina: Fundus) -> list[NDArray[np.float32]]:
    """Melanin, blood, epithelium, macular pigment, disc, artery and vein, at texels of `COARSE`."""
    maps = fundus_maps(retina)
    n = len(maps.melanin)
    artery, vein = (
        np.asarray(cv2.resize(path, (n, n), interpolation=cv2.INTER_AREA), np.float32)
        for path in (maps.artery, maps.vein)
    )
    return [maps.melanin, maps.blood, maps.epithelium, maps.macular, maps.disc, artery, vein]


def _convolved(values: NDArray[np.float32], transfer: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(scipy.fft.irfft2(scipy.fft.rfft2(values) * transfer, s=values.shape), np.float32)


def _transfer(chart: Chart, kernel: Kernel) -> NDArray[np.float32]:
    """The kernel's Fourier transform on the frequencies of `rfft2` of a chart: Gaussians are those of x times of y.

    Light is shared by four cells and read between four: each is a tent along x and y, of the variance cell^2 / 6. The
    Gaussians have as much less, where they have it.
    """
    variances = np.maximum(np.square(kernel.widths) - chart.cell**2 / 3.0, 0.0)[:, None]
    y, x = np.fft.fftfreq(chart.side, chart.cell), np.fft.rfftfreq(chart.side, chart.cell)
    down, along = (np.exp(-2.0 * np.pi**2 * variances * np.square(f)) for f in (y, x))
    return np.asarray((kernel.parts[:, None] * down).T @ along, np.float32)
