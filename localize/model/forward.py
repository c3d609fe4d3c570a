"""The image model the estimators share: beam, inverse square, cosine and pixel integration, with its Jacobian.

Radiance of a Lambertian surface of albedo a at P, lit from the apex A by K cones of profile g and on-axis radiant
intensity I0, under an ambient irradiance E:

    L = a / pi * (E + I0 f sum_k G_k),   f = n.(A - P) / |A - P|^3,   G_k = mean of g over the pixel.

A pixel is a square box that averages. Across a pixel the profile's own variable w (the cosine off the axis, or minus
the angle) is a plane, so the mean of g over the square is the second difference of g's second antiderivative
(`Profile.mean`). For a hard edge that is the exact area of a box cut by a half plane.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.profile import Profile
from conespot.scene.pose import Pose, tangents
from conespot.scene.scene import Scene
from conespot.scene.spotlights import spotlight_axes

Array = NDArray[np.float64]


def rotation_basis(axis: Array) -> Array:
    """Rotation vectors `[3, 3]`, one a row, that move `axis` along U, along V, and roll about it [rad]."""
    u, v = tangents(axis)
    return np.stack([-v, u, axis])


def moved(pose: Pose, step: Array) -> Pose:
    """`pose` after `step` = (dx, dy, dz [mm], du, dv[, droll] [rad]), the parameters of every fit."""
    basis = rotation_basis(pose.axis)
    vector = step[3:] @ basis[: len(step) - 3]
    rotation = _rotation(vector) @ pose.rotation()
    axis = rotation @ np.array([0.0, 0.0, -1.0])
    axis = axis / np.linalg.norm(axis)
    bare = Pose(pose.apex + step[:3], axis)
    if len(step) == 5:
        return bare
    turn = bare.rotation().T @ rotation
    return Pose(bare.apex, axis, float(np.arctan2(turn[1, 0], turn[0, 0])))


def _rotation(vector: Array) -> Array:
    """Rodrigues: the rotation `[3, 3]` by `vector` `[3]` [rad]."""
    angle = float(np.linalg.norm(vector))
    k = np.array([[0.0, -vector[2], vector[1]], [vector[2], 0.0, -vector[0]], [-vector[1], vector[0], 0.0]])
    if angle < 1e-8:
        return np.asarray(np.eye(3) + k + k @ k / 2.0)
    return np.asarray(np.eye(3) + np.sin(angle) / angle * k + (1.0 - np.cos(angle)) / angle**2 * (k @ k))


@dataclass(frozen=True)
class Sight:
    """What the pixels look at: surface points, their normals, and how the points move with the pixel."""

    points: Array  #: `[N, 3]` [mm]
    normals: Array  #: unit, towards the inside `[N, 3]`
    along_x: Array  #: displacement of the point per pixel to the right `[N, 3]` [mm/px]
    along_y: Array  #: displacement of the point per pixel down `[N, 3]` [mm/px]


def look(scene: Scene, pixels: Array, side: float = 1.0) -> Sight:
    """What pixels with centres `[N, 2]` [px] and `side` [px] see of the scene's surface.

    Raises nothing: where a ray misses the eye the points are NaN.
    """
    eye, rays = scene.eye, scene.camera.rays(pixels)
    d = rays.directions
    points = scene.surface.intersect(eye, rays.origins, d)
    if scene.surface.is_sphere:
        normals = (eye.centre - points) / eye.radius
    else:
        outward = points - eye.centre
        normals = scene.surface.normals(eye, outward / np.linalg.norm(outward, axis=1, keepdims=True))
    distance = np.einsum("ij,ij->i", points - rays.origins, d)[:, None]
    facing = np.einsum("ij,ij->i", normals, d)

    def along(origins: Array, directions: Array) -> Array:
        """How the point moves with a ray that moves so: along the ray as far as keeps it on the surface."""
        step = side * (origins + distance * directions)
        return np.asarray(step - (np.einsum("ij,ij->i", normals, step) / facing)[:, None] * d)

    along_x = along(rays.origins_by_x, rays.directions_by_x)
    along_y = along(rays.origins_by_y, rays.directions_by_y)
    return Sight(points, normals, along_x, along_y)


def window(row: int, column: int, height: int, width: int, side: int = 1) -> Array:
    """Centres `[height * width, 2]` [px] of `side` x `side` bins of a window whose first pixel is (row, column)."""
    x = column + side * (np.arange(width) + 0.5)
    y = row + side * (np.arange(height) + 0.5)
    return np.stack([np.tile(x, height), np.repeat(y, width)], axis=1)


@dataclass(frozen=True)
class Light:
    """Spotlight irradiance at N pixels, for unit on-axis intensity, and its derivatives."""

    value: Array  #: f sum_k G_k `[N]` [1/mm^2]
    jacobian: Array  #: `[P, N]`: per mm of the apex, per rad along U, V (and roll), then per unit of every change


def light(
    sight: Sight,
    pose: Pose,
    scene: Scene,
    profile: Profile,
    *,
    pose_size: int = 5,
    changes: Sequence[tuple[Profile, Profile, float]] = (),
) -> Light:
    """The spotlights' irradiance on what `sight` sees: the cones' pixel means times cosine over distance squared.

    The Jacobian has a row for each of `pose_size` pose parameters, the sixth being the roll, and one for each of the
    `changes`: the profile at a little more and a little less of some quantity, and how much lies between them.
    """
    axes = spotlight_axes(pose, scene.spotlights)
    basis = rotation_basis(pose.axis)[: pose_size - 3]
    to = sight.points - pose.apex
    d2 = np.einsum("ij,ij->i", to, to)
    d = np.sqrt(d2)
    to /= d[:, None]
    cosine = -np.einsum("ij,ij->i", sight.normals, to)
    f = np.maximum(cosine, 0.0) / d2
    total, rows = np.zeros(len(d)), np.zeros((3 + len(basis) + len(changes), len(d)))
    for axis in axes:
        c = to @ axis
        across = (axis - c[:, None] * to) / d[:, None]  # gradient of c over the surface point [1/mm]
        w, stretch = profile.variable(c)
        gx = np.einsum("ij,ij->i", across, sight.along_x)
        gy = np.einsum("ij,ij->i", across, sight.along_y)
        px, py = np.abs(gx) * stretch / 2.0, np.abs(gy) * stretch / 2.0
        step = profile.coefficients[0, 0] > 0.0
        # at the foot of a soft edge too: it is all that a clipped patch shows
        edge = np.flatnonzero(np.abs(w - profile.knots[0]) < (1.5 if step else 4.0) * (px + py))
        if len(edge):
            # a step counts where it is, a slope as the mean over the pixel
            missing = (profile.knots[0] - w) / stretch if step else np.hypot(gx, gy) / math.sqrt(12.0)
            bend = _bend(sight, edge, (gx[edge], gy[edge]), to, d, c, across, missing, scene.eye.radius)
            w = w.copy()
            w[edge] += bend * (np.broadcast_to(stretch, w.shape)[edge])
        mean, slope = profile.mean(w, px, py)
        total += mean
        slope = slope * stretch * f
        rows[:3] -= slope * across.T
        for j, vector in enumerate(basis):
            rows[3 + j] += slope * (to @ _cross(vector, axis))
        for j, (more, less, between) in enumerate(changes, start=3 + len(basis)):
            rows[j] += f * (more.mean(w, px, py)[0] - less.mean(w, px, py)[0]) / between
    value = total * f
    falloff = (sight.normals / d2[:, None] + 3.0 * (cosine / d2)[:, None] * to) / d[:, None]
    rows[:3] += np.where(cosine > 0.0, total, 0.0) * falloff.T
    return Light(value, rows)


def _cross(a: Array, b: Array) -> Array:
    """The cross product of two vectors `[3]`, in a tenth of the time of numpy's."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def light_by_surface(here: Light, sight: Sight, pose: Pose, sides: tuple[Sight, Sight], step: float) -> Array:
    """Derivative of the light `[N]` by a quantity that moves the surface, from what the pixels see at +-`step` of it.

    The light depends on points less apex and on normals, so the apex' own Jacobian is used: the size of the whole
    scene, which no image tells, then stays exactly unobservable.
    """
    points = (sides[0].points - sides[1].points) / (2.0 * step)
    normals = (sides[0].normals - sides[1].normals) / (2.0 * step)
    to = sight.points - pose.apex
    cosine = np.einsum("ij,ij->i", sight.normals, to)
    turned = np.einsum("ij,ij->i", normals, to) / np.where(np.abs(cosine) > 1e-9, cosine, np.inf)
    return np.asarray(here.value * turned - np.einsum("ji,ij->i", here.jacobian[:3], points))


def _bend(
    sight: Sight,
    edge: NDArray[np.intp],
    slope: tuple[Array, Array],
    to: Array,
    d: Array,
    c: Array,
    across: Array,
    missing: Array,
    radius: float,
) -> Array:
    """What the second derivatives of the cosine add to it in pixels on the outline, where a plane is not enough.

    Along the edge t^2 has the mean 1/12 over a pixel: a half plane covers more of it than the convex patch does, by
    1 / (24 R) px for a radius of R px. Across, the edge lies `missing` / slope away from the pixel's centre.
    """
    gx, gy = slope
    length = np.maximum(np.hypot(gx, gy), 1e-300)
    x, y = sight.along_x[edge], sight.along_y[edge]
    v, dist, cosine = to[edge], d[edge], c[edge]
    gradient, normal = across[edge], np.einsum("ij,ij->i", across[edge], sight.normals[edge])

    def second(step: Array) -> Array:
        along = np.einsum("ij,ij->i", v, step) / dist
        rise = np.einsum("ij,ij->i", gradient, step)  # of the cosine
        size = np.einsum("ij,ij->i", step, step)
        flat = -2.0 * rise * along - cosine * (size / dist**2 - along**2)
        return np.asarray(flat + normal * size / radius)

    ex, ey = (gx / length)[:, None], (gy / length)[:, None]
    away = np.clip(missing[edge] / length, -0.7, 0.7)
    return np.asarray(second(-ey * x + ex * y) / 24.0 + second(ex * x + ey * y) * away**2 / 2.0)


def ambient_irradiance(sight: Sight, scene: Scene) -> Array:
    """The microscope's irradiance on what `sight` sees `[N]`, relative to that on a plane across its beam."""
    return np.maximum(sight.normals @ scene.ambient.towards, 0.0)
