"""A fundus out of nothing but anatomy and a seed: vessel trees, disc and pigment."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.render.fundus_anatomy import COARSE, EXTENT, FINE, Anatomy, Map, smooth_noise, texel_centres
from conespot.render.fundus_growth import GROWTH
from conespot.scene import fundus

Array = NDArray[np.float64]


@dataclass
class _Vessel:
    """A polyline `[N, 2]` [mm] with radii `[N]` [mm]."""

    points: Array
    radii: Array


def grown(rng: np.random.Generator) -> Anatomy:
    """An eye of its own: left or right, disc size and place, arcades, branches and pigment all drawn from `rng`."""
    g = GROWTH
    side = rng.choice([-1.0, 1.0])  # the disc is left of the fovea in a left eye
    disc = np.array([side * rng.uniform(*g.disc_distance), rng.uniform(*g.disc_height)])
    semi_axes = rng.uniform(*g.disc_half_width), rng.uniform(*g.disc_half_height)
    arteries = _tree(rng, disc, g.artery_trunk, vein=False)
    veins = _tree(rng, disc, g.vein_trunk, vein=True)
    x, y = texel_centres(COARSE)
    radius = np.hypot((x - disc[0]) / semi_axes[0], (y - disc[1]) / semi_axes[1])
    mask = 1.0 / (1.0 + np.exp((radius - 1.0) / g.disc_rim))
    n = len(x)
    melanin = _mottled(rng, n, *g.melanin[0]) + _mottled(rng, n, *g.melanin[1])
    blood = _mottled(rng, n, *g.blood) + g.choroid * _choroidal_vessels(rng, n)
    epithelium = _mottled(rng, n, *g.epithelium[0]) + _mottled(rng, n, *g.epithelium[1])
    return Anatomy(
        disc_centre=(float(disc[0]), float(disc[1])),
        melanin=np.clip(melanin, -g.most_melanin, g.most_melanin).astype(np.float32),
        blood=np.clip(blood, -g.most_blood, g.most_blood).astype(np.float32),
        epithelium=np.clip(epithelium, -g.most_epithelium, g.most_epithelium).astype(np.float32),
        disc=mask.astype(np.float32),
        artery=_depths(arteries, fundus.BLOOD.artery_depth, g.artery_trunk),
        vein=_depths(veins, fundus.BLOOD.vein_depth, g.vein_trunk),
    )


def _mottled(rng: np.random.Generator, n: int, amplitude: float, size: float) -> Array:
    """Smooth noise `[n, n]` of a deviation, on coarse texels, with features of `size` [mm]."""
    return amplitude * smooth_noise(rng, n, size / COARSE)


def _tree(rng: np.random.Generator, disc: Array, trunk: float, *, vein: bool) -> list[_Vessel]:
    """Four trunks, each an arcade around the macula or a nasal vessel, with their branches, and thin macular ones."""
    g = GROWTH
    vessels: list[_Vessel] = []
    temporal = -np.sign(disc[0])
    shift = g.vein_shift if vein else 0.0
    start = disc + rng.normal(0.0, g.scatter_start, 2) + [g.apart if vein else -g.apart, 0.0]
    across, per_shift, of_crest, up_by = np.array(g.arcade).T
    for up in (1.0, -1.0):
        crest = rng.uniform(*g.crest) + shift
        way = np.stack([across + per_shift * shift, of_crest * crest + up_by], axis=1)
        way[1:] += rng.normal(0.0, g.scatter_arcade, way[1:].shape)
        _grow_trunk(rng, vessels, start + way * [temporal, up], start, trunk)
        out = np.array(g.nasal) + rng.normal(0.0, g.scatter_nasal, (len(g.nasal), 2))
        out += [shift, 0.0]
        _grow_trunk(rng, vessels, start + out * [temporal, up], start, g.nasal_share * trunk)
    for _ in range(1 if vein else 2):
        side = rng.choice([-1.0, 1.0])
        way = np.array(g.macular) * [1.0, rng.uniform(*g.macular_slope)]
        _grow_trunk(rng, vessels, start + way * [temporal, side], start, g.macular_share * trunk)
    return vessels


def _grow_trunk(rng: np.random.Generator, vessels: list[_Vessel], way: Array, start: Array, radius: float) -> None:
    """A trunk through the points `way` `[K, 2]`, wavy and slowly thinner, and all its branches."""
    knots = np.concatenate([[start], way])
    t = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(knots, axis=0), axis=1))])
    s = np.arange(0.0, t[-1], GROWTH.step)
    points = np.stack([_smooth_through(t, knots[:, k], s) for k in (0, 1)], axis=1)
    points += _wave(rng, len(s), GROWTH.wave)
    _add(rng, vessels, points, radius * np.exp(-s / GROWTH.taper), generation=0)


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
    noise = cv2.GaussianBlur(rng.standard_normal((n, 2)), (1, 0), sigmaX=1e-6, sigmaY=GROWTH.wave_steps)
    ramp = np.minimum(np.arange(n) * GROWTH.step / GROWTH.wave_after, 1.0)[:, None]
    return np.asarray(noise / max(float(noise.std()), 1e-9) * amplitude * ramp)


def _add(rng: np.random.Generator, vessels: list[_Vessel], points: Array, radii: Array, generation: int) -> None:
    """Keep a vessel and let branches grow out of it, alternately to both sides."""
    g = GROWTH
    points, radii = _inside(points, radii)
    if len(points) < g.shortest:
        return
    vessels.append(_Vessel(points, radii))
    if generation >= g.generations:
        return
    branching = g.trunk if generation == 0 else g.branch
    side = rng.choice([-1.0, 1.0])
    at = rng.uniform(*branching.first)
    while at < len(points) * g.step - g.bare_end:
        i = int(at / g.step)
        heading = np.arctan2(*(points[min(i + 2, len(points) - 1)] - points[max(i - 2, 0)])[::-1])
        share = rng.uniform(*branching.share)
        radius = radii[i] * share
        if radius > g.thinnest:
            turned = heading + side * np.radians(rng.uniform(*g.angle_deg))
            _branch(rng, vessels, points[i], turned, radius, generation + 1)
            # Murray: the cubes of the radii add up
            radii[i:] *= (1.0 - share**3) ** (1.0 / 3.0)
        side = -side if rng.random() < g.alternates else side
        at += rng.uniform(*branching.spacing)


def _branch(
    rng: np.random.Generator, vessels: list[_Vessel], start: Array, heading: float, radius: float, generation: int
) -> None:
    """A branch that wanders, drawn towards the fovea from afar and bent round it nearby."""
    g = GROWTH
    length = rng.uniform(*g.length_spread) * g.length_mm * radius**g.length_exponent
    steps = max(g.fewest_steps, int(length / g.step))
    points = [start]
    turn = 0.0
    for _ in range(steps):
        here = points[-1]
        distance = float(np.hypot(*here))
        turn = g.turn_kept * turn + rng.normal(0.0, g.turn)
        inward = np.arctan2(-here[1], -here[0])
        if g.bent_from < distance < g.drawn_from:
            heading += g.drawn * np.sin(inward - heading)
        elif distance <= g.bent_from:  # the last arterioles run round the foveal centre
            heading += g.bent * np.sin(inward + np.copysign(g.bent_to, np.sin(heading - inward)) - heading)
        heading += turn
        points.append(here + g.step * np.array([np.cos(heading), np.sin(heading)]))
        if distance < g.avascular:
            break
    path = np.array(points)
    radii = radius * np.linspace(1.0, g.thins_to, len(path))
    _add(rng, vessels, path, radii, generation)


def _inside(points: Array, radii: Array) -> tuple[Array, Array]:
    """The beginning of a path, up to where it gets too thin or leaves the map."""
    out = (radii < GROWTH.thinnest) | np.any(np.abs(points) > EXTENT - GROWTH.margin, axis=1)
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
    return np.asarray(cv2.GaussianBlur(depth, (0, 0), GROWTH.blur_texels))


def _choroidal_vessels(rng: np.random.Generator, n: int) -> Array:
    """The choroid's own wide, winding vessels: where smooth noise changes sign, deviation 1."""
    first, second = (smooth_noise(rng, n, GROWTH.choroid_size / COARSE) / GROWTH.choroid_width for _ in range(2))
    bands = np.exp(-(first**2)) + np.exp(-(second**2))
    return np.asarray((bands - bands.mean()) / bands.std())
