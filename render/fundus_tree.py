"""A fundus out of nothing but anatomy and a seed: vessel trees, disc and pigment."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.render.fundus_anatomy import COARSE, EXTENT, FINE, Anatomy, Map, smooth_noise, texel_centres
from conespot.scene import fundus

Array = NDArray[np.float64]

#: step along a vessel [mm], and the radius at which a branch ends [mm]
_STEP = 0.05
_THINNEST = 0.006
#: radius of a trunk at the disc [mm]; a vessel of this radius has the closed form's blood path
_TRUNK = {"artery": 0.055, "vein": 0.072}
#: around the fovea no vessel grows [mm]
_AVASCULAR = 0.28


@dataclass
class _Vessel:
    """A polyline `[N, 2]` [mm] with radii `[N]` [mm]."""

    points: Array
    radii: Array


def grown(rng: np.random.Generator) -> Anatomy:
    """An eye of its own: left or right, disc size and place, arcades, branches and pigment all drawn from `rng`."""
    side = rng.choice([-1.0, 1.0])  # the disc is left of the fovea in a left eye
    disc = np.array([side * rng.uniform(4.2, 4.8), rng.uniform(0.1, 0.8)])
    semi_axes = rng.uniform(0.80, 0.95), rng.uniform(0.9, 1.08)
    trees = {kind: _tree(rng, disc, kind) for kind in ("artery", "vein")}
    x, y = texel_centres(COARSE)
    radius = np.hypot((x - disc[0]) / semi_axes[0], (y - disc[1]) / semi_axes[1])
    mask = 1.0 / (1.0 + np.exp((radius - 1.0) / 0.03))
    n = len(x)
    melanin = 0.08 * smooth_noise(rng, n, 3.0 / COARSE) + 0.04 * smooth_noise(rng, n, 0.4 / COARSE)
    blood = 0.10 * smooth_noise(rng, n, 1.5 / COARSE) + 0.10 * _choroidal_vessels(rng, n)
    epithelium = 0.05 * smooth_noise(rng, n, 2.0 / COARSE) + 0.03 * smooth_noise(rng, n, 0.15 / COARSE)
    return Anatomy(
        disc_centre=(float(disc[0]), float(disc[1])),
        melanin=np.clip(melanin, -0.3, 0.3).astype(np.float32),
        blood=np.clip(blood, -0.4, 0.4).astype(np.float32),
        epithelium=np.clip(epithelium, -0.25, 0.25).astype(np.float32),
        disc=mask.astype(np.float32),
        artery=_depths(trees["artery"], fundus.ARTERY_DEPTH, _TRUNK["artery"]),
        vein=_depths(trees["vein"], fundus.VEIN_DEPTH, _TRUNK["vein"]),
    )


def _tree(rng: np.random.Generator, disc: Array, kind: str) -> list[_Vessel]:
    """Four trunks, each an arcade around the macula or a nasal vessel, with their branches."""
    vessels: list[_Vessel] = []
    temporal = -np.sign(disc[0])
    shift = 0.45 if kind == "vein" else 0.0
    start = disc + rng.normal(0.0, 0.06, 2) + [0.10 if kind == "vein" else -0.10, 0.0]
    for up in (1.0, -1.0):
        crest = rng.uniform(2.7, 3.4) + shift
        way = np.array(
            [
                [0.05, 0.45],
                [0.55 + 0.2 * shift, 1.3],
                [1.9, 0.80 * crest],
                [3.9, crest],
                [6.0, crest - 0.25],
                [8.0, crest - 0.9],
                [10.5, crest - 1.4],
                [13.0, crest - 1.0],
            ]
        )
        way[1:] += rng.normal(0.0, 0.16, way[1:].shape)
        _grow_trunk(rng, vessels, start + way * [temporal, up], start, _TRUNK[kind])
        out = np.array([[-0.3, 0.5], [-1.1, 1.5], [-2.2, 2.6], [-3.5, 4.4]]) + rng.normal(0.0, 0.15, (4, 2))
        out += [shift, 0.0]
        _grow_trunk(rng, vessels, start + out * [temporal, up], start, 0.7 * _TRUNK[kind])
    for _ in range(2 if kind == "artery" else 1):  # towards the macula, thin
        side = rng.choice([-1.0, 1.0])
        way = np.array([[0.9, 0.15], [2.0, 0.35], [3.2, 0.55], [3.9, 0.7]]) * [1.0, rng.uniform(0.5, 1.2)]
        _grow_trunk(rng, vessels, start + way * [temporal, side], start, 0.3 * _TRUNK[kind])
    return vessels


def _grow_trunk(rng: np.random.Generator, vessels: list[_Vessel], way: Array, start: Array, radius: float) -> None:
    """A trunk through the points `way` `[K, 2]`, wavy and slowly thinner, and all its branches."""
    knots = np.concatenate([[start], way])
    t = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
    s = np.arange(0.0, t[-1], _STEP)
    points = np.stack([_smooth_through(t, knots[:, k], s) for k in (0, 1)], axis=1)
    points += _wave(rng, len(s), 0.05)
    _add(rng, vessels, points, radius * np.exp(-s / 30.0), generation=0)


def _smooth_through(t: Array, values: Array, at: Array) -> Array:
    """A smooth curve through values at t: cubic Hermite with Catmull-Rom slopes."""
    slopes = np.gradient(values, t)
    i = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(t) - 2)
    h = t[i + 1] - t[i]
    u = (at - t[i]) / h
    a, b = values[i], values[i + 1]
    return np.asarray(
        a * (1 + 2 * u) * (1 - u) ** 2
        + b * u * u * (3 - 2 * u)
        + h * slopes[i] * u * (1 - u) ** 2
        + h * slopes[i + 1] * u * u * (u - 1)
    )


def _wave(rng: np.random.Generator, n: int, amplitude: float) -> Array:
    """Tortuosity [mm] `[n, 2]`: smooth, zero at the beginning."""
    noise = cv2.GaussianBlur(rng.standard_normal((n, 2)), (1, 0), sigmaX=1e-6, sigmaY=6.0)
    ramp = np.minimum(np.arange(n) * _STEP / 1.0, 1.0)[:, None]
    return np.asarray(noise / max(float(noise.std()), 1e-9) * amplitude * ramp)


def _add(rng: np.random.Generator, vessels: list[_Vessel], points: Array, radii: Array, generation: int) -> None:
    """Keep a vessel and let branches grow out of it, alternately to both sides."""
    points, radii = _inside(points, radii)
    if len(points) < 6:
        return
    vessels.append(_Vessel(points, radii))
    if generation >= 4:
        return
    side = rng.choice([-1.0, 1.0])
    at = rng.uniform(0.9, 1.6) if generation == 0 else rng.uniform(0.4, 0.8)
    while at < len(points) * _STEP - 0.3:
        i = int(at / _STEP)
        heading = np.arctan2(*(points[min(i + 2, len(points) - 1)] - points[max(i - 2, 0)])[::-1])
        share = rng.uniform(0.3, 0.6) if generation == 0 else rng.uniform(0.45, 0.75)
        radius = radii[i] * share
        if radius > _THINNEST:
            _branch(
                rng, vessels, points[i], heading + side * np.radians(rng.uniform(30.0, 60.0)), radius, generation + 1
            )
            # Murray: the cubes of the radii add up
            radii[i:] *= (1.0 - share**3) ** (1.0 / 3.0)
        side = -side if rng.random() < 0.7 else side
        at += rng.uniform(0.7, 1.4) if generation == 0 else rng.uniform(0.45, 1.1)


def _branch(
    rng: np.random.Generator, vessels: list[_Vessel], start: Array, heading: float, radius: float, generation: int
) -> None:
    """A branch that wanders, drawn towards the fovea from afar and bent round it nearby."""
    length = rng.uniform(0.7, 1.3) * 45.0 * radius**0.7
    steps = max(8, int(length / _STEP))
    points = [start]
    turn = 0.0
    for _ in range(steps):
        here = points[-1]
        distance = float(np.hypot(*here))
        turn = 0.75 * turn + rng.normal(0.0, 0.03)
        inward = np.arctan2(-here[1], -here[0])
        if 0.9 < distance < 3.0:
            heading += 0.02 * np.sin(inward - heading)
        elif distance <= 0.9:  # the last arterioles run round the foveal centre
            heading += 0.06 * np.sin(inward + np.copysign(1.4, np.sin(heading - inward)) - heading)
        heading += turn
        points.append(here + _STEP * np.array([np.cos(heading), np.sin(heading)]))
        if distance < _AVASCULAR:
            break
    path = np.array(points)
    radii = radius * np.linspace(1.0, 0.35, len(path))
    _add(rng, vessels, path, radii, generation)


def _inside(points: Array, radii: Array) -> tuple[Array, Array]:
    """The beginning of a path, up to where it gets too thin or leaves the map."""
    out = (radii < _THINNEST) | np.any(np.abs(points) > EXTENT - 0.1, axis=1)
    end = int(np.argmax(out)) if np.any(out) else len(points)
    return points[:end].copy(), radii[:end].copy()


def _depths(vessels: list[_Vessel], deepest: float, trunk: float) -> Map:
    """Blood paths [um]: across a round vessel the chord sqrt(1 - (x / r)^2) of its deepest, in proportion to radius."""
    n = round(2.0 * EXTENT / FINE)
    depth = np.zeros((n, n), np.float32)
    for vessel in vessels:
        ends = np.stack([(vessel.points[:, 0] + EXTENT) / FINE, (EXTENT - vessel.points[:, 1]) / FINE], axis=1)
        for a, b, radius in zip(ends[:-1], ends[1:], vessel.radii[:-1], strict=True):
            r = radius / FINE
            low = np.clip(np.floor(np.minimum(a, b) - r - 1.0), 0, n - 1).astype(int)
            high = np.clip(np.ceil(np.maximum(a, b) + r + 1.0), 1, n).astype(int)
            x = np.arange(low[0], high[0]) + 0.5 - a[0]
            y = (np.arange(low[1], high[1]) + 0.5 - a[1])[:, None]
            step = b - a
            u = np.clip((x * step[0] + y * step[1]) / max(float(step @ step), 1e-12), 0.0, 1.0)
            squared = (x - u * step[0]) ** 2 + (y - u * step[1]) ** 2
            chord = deepest * (radius / trunk) * np.sqrt(np.maximum(1.0 - squared / (r * r), 0.0))
            window = depth[low[1] : high[1], low[0] : high[0]]
            np.maximum(window, chord, out=window, casting="same_kind")
    return np.asarray(cv2.GaussianBlur(depth, (0, 0), 0.6))


def _choroidal_vessels(rng: np.random.Generator, n: int) -> Array:
    """The choroid's own wide, winding vessels: where smooth noise changes sign, deviation 1."""
    first, second = (smooth_noise(rng, n, 1.6 / COARSE) / 0.22 for _ in range(2))
    bands = np.exp(-(first**2)) + np.exp(-(second**2))
    return np.asarray((bands - bands.mean()) / bands.std())
