"""A camera's rays behind the eye's optics, and the way back from a point to the pixel that sees it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from conespot.scene.optics import Optics
from conespot.scene.rays import Rays

Array = NDArray[np.float64]
#: [px]: half of what differences are taken over. They are then good to 1e-9 of a derivative
_STEP = 1e-2
#: a Newton step [px] below which the next one would be lost in rounding
_CONVERGED = 1e-8
_MOST_STEPS = 40


def refracted(optics: Optics, rays: Rays, wavelength: float, *, stopped: bool = True) -> Rays:
    """Rays in the vitreous of those in the air, for a wavelength [nm].

    NaN where a ray misses a surface and, if `stopped`, where the iris stops it.
    """
    # all five at once: of an outline's few points each call would cost more than its rays
    steps = [(by, step) for by in ("x", "y") for step in (_STEP, -_STEP)]
    o, d = np.broadcast_arrays(rays.origins, rays.directions)
    beside = {"x": (rays.origins_by_x, rays.directions_by_x), "y": (rays.origins_by_y, rays.directions_by_y)}
    all_origins = np.stack([o, *(o + step * beside[by][0] for by, step in steps)])
    all_directions = np.stack([d, *(d + step * beside[by][1] for by, step in steps)])
    origins, directions, off = _entering(optics, all_origins, all_directions, wavelength)
    if stopped:
        hidden = ~(off[0] <= 1.0)
        origins[0][hidden] = directions[0][hidden] = np.nan
    by_x, by_y = (
        ((origins[k] - origins[k + 1]) / (2.0 * _STEP), (directions[k] - directions[k + 1]) / (2.0 * _STEP))
        for k in (1, 3)
    )
    return Rays(origins[0], directions[0], by_x[0], by_y[0], by_x[1], by_y[1])


def pitch(seen: Rays) -> float:
    """How far apart on the wall neighbouring pixels of a row look [mm], of the pixel that sees the origin.

    As far from where the ray enters the vitreous as the origin is.
    """
    return float(np.linalg.norm(seen.origins_by_x + np.linalg.norm(seen.origins) * seen.directions_by_x))


def _entering(optics: Optics, origins: Array, directions: Array, wavelength: float) -> tuple[Array, Array, Array]:
    """`Optics.enter` for arrays `[..., 3]`."""
    o, d = np.broadcast_arrays(origins, directions / np.linalg.norm(directions, axis=-1, keepdims=True))
    with np.errstate(invalid="ignore", divide="ignore"):
        origin, direction, off = optics.enter(
            (o[..., 0], o[..., 1], o[..., 2]), (d[..., 0], d[..., 1], d[..., 2]), wavelength, np.sqrt
        )
    return np.stack(np.broadcast_arrays(*origin), -1), np.stack(np.broadcast_arrays(*direction), -1), off


def found(rays: Callable[[Array], Rays], points: Array, start: Array) -> Array:
    """The pixels `[..., 2]` [px] whose `rays` pass through points `[..., 3]` [mm], by Newton's method from a `start`.

    NaN for what no ray meets on its way from where it begins. Where the optics fold the image, so that several pixels
    see one point, it is the one on the side of the fold that `start` is on.
    """
    target = np.asarray(points, float).reshape(-1, 3)
    pixels = np.full((len(target), 2), np.nan)
    left = np.flatnonzero(np.all(np.isfinite(target), axis=1))
    at = np.tile(np.asarray(start, float), (len(left), 1))
    part = np.ones(len(left))  # of a whole step
    side = np.sign(steps_to(rays(at[:1]), target[left[:1]])[1]) if len(left) else np.ones(1)
    step = steps_to(rays(at), target[left])[0]
    for _ in range(_MOST_STEPS):
        there = at + part[:, None] * step
        after, orientation, ahead = steps_to(rays(there), target[left])
        good = np.all(np.isfinite(after), axis=1) & (orientation * side > 0.0)
        done = good & (np.abs(after).max(axis=1, initial=0.0) < _CONVERGED)
        met = done & (ahead > 0.0)
        pixels[left[met]] = there[met]
        at, step = np.where(good[:, None], there, at), np.where(good[:, None], after, step)
        part = np.where(good, 1.0, 0.5 * part)
        going = ~done
        left, at, step, part = left[going], at[going], step[going], part[going]
        if not len(left):
            break
    return pixels.reshape(*np.shape(points)[:-1], 2)


def steps_to(rays: Rays, points: Array) -> tuple[Array, Array, Array]:
    """The steps `[N, 2]` [px] that take rays to points `[N, 3]`, as seen along the rays.

    Also the area `[N]` [mm2/px2] that a pixel sees there, negative where the image is turned over, and how far along
    their rays the points lie `[N]` [mm].
    """
    d, off = rays.directions, points - rays.origins
    along = np.einsum("ij,ij->i", off, d)
    right = rays.origins_by_x + along[:, None] * rays.directions_by_x
    down = rays.origins_by_y + along[:, None] * rays.directions_by_y
    # the triple product with d counts nothing that lies along the ray
    area, by_x, by_y = (np.einsum("ij,ij->i", np.cross(a, b), d) for a, b in ((right, down), (off, down), (right, off)))
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.stack([by_x, by_y], axis=1) / area[:, None], area, along
