"""From an outline in the image to the apex of the cone that cast it (paper, Eqs. 1-7 and 22-24)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.localize.published.ellipse import Ellipse
from conespot.scene import Camera, Eye

Array = NDArray[np.float64]


def retina_points(camera: Camera, eye: Eye, pixels: ArrayLike) -> Array:
    """Points `[..., 3]` [mm] of the retina seen at pixel coordinates `[..., 2]` [px]; NaN where a ray misses the eye.

    The camera must be the paper's own, square and straight above the pole.

    Paper, Eqs. 1-7. With y1 the distance of the sensor point from the sensor's centre and m = y1 / f, Eq. 3 (its
    first term under the root corrected to (2 d0 f/y1 - 2 r f/y1)^2) is, times m, the distance from the optical axis

        x1 = m [(d0 - r) + sqrt((d0 - r)^2 - (1 + m^2) (d0^2 - 2 d0 r))] / (1 + m^2),

    which holds on the axis too. Eqs. 5 and 6 keep the sensor point's direction, here by its own components, so that
    a sensor point with x_c = 0 is no special case.
    """
    d0, r = camera.height, eye.radius
    half = camera.shape[1] / 2.0
    sensor = (np.asarray(pixels, float) - half) * [1.0, -1.0] / camera.focal_length_px  # (x_c, y_c) / f, y up
    m2 = np.sum(sensor * sensor, axis=-1)
    root2 = (d0 - r) ** 2 - (1.0 + m2) * (d0 * d0 - 2.0 * d0 * r)
    depth = ((d0 - r) + np.sqrt(np.where(root2 >= 0.0, root2, np.nan))) / (1.0 + m2)  # x1 / m, below the pinhole
    return np.concatenate([sensor * depth[..., None], (d0 - depth)[..., None]], axis=-1)


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane through `origin` `[3]` with axes `u`, `v` and unit `normal` `[3]` towards the inside of the eye."""

    origin: Array
    u: Array
    v: Array
    normal: Array

    def local(self, points: Array) -> Array:
        """Coordinates `[N, 2]` along u and v of points `[N, 3]`, the distance from the plane dropped."""
        return (points - self.origin) @ np.column_stack([self.u, self.v])

    def world(self, local: Array) -> Array:
        """Points `[N, 3]` at coordinates `[N, 3]` along u, v and the normal."""
        return self.origin + local @ np.stack([self.u, self.v, self.normal])


def fitted_plane(points: Array, eye: Eye) -> Plane:
    """The plane of least squared distance from points `[N, 3]` [mm]."""
    middle = points.mean(axis=0)
    u, v, normal = np.linalg.svd(points - middle, full_matrices=False)[2]
    inward = normal if normal @ (eye.centre - middle) > 0.0 else -normal
    return Plane(middle, u, v, inward)


def cone_over_ellipse(ellipse: Ellipse, half_angle: float) -> tuple[Array, Array]:
    """Where a cone of `half_angle` [rad] that cuts out the ellipse has its apex: two places `[2, 3]`.

    The ends `[2, 3]` of the major axis come with them, all in the coordinates that `Plane.world` takes.
    Paper, Eqs. 22-24: the axis leans by alpha against the normal, sin alpha = sqrt(1 - b^2/a^2) cos beta, and the apex
    stands s1 = a sin 2 alpha / sin 2 beta from the centre along the major axis, to either side, and
    s2 = a (cos 2 alpha / sin 2 beta + cot 2 beta) above it. b/a is at most 1.
    """
    ratio = min(ellipse.b / ellipse.a, 1.0)
    alpha = math.asin(math.sqrt(1.0 - ratio * ratio) * math.cos(half_angle))
    s1 = ellipse.a * math.sin(2.0 * alpha) / math.sin(2.0 * half_angle)
    s2 = ellipse.a * (math.cos(2.0 * alpha) / math.sin(2.0 * half_angle) + 1.0 / math.tan(2.0 * half_angle))
    sides = np.array([[1.0], [-1.0]]) * ellipse.major
    apexes = np.column_stack([ellipse.centre + s1 * sides, [s2, s2]])
    vertices = np.column_stack([ellipse.centre + ellipse.a * sides, [0.0, 0.0]])
    return apexes, vertices


@dataclass(frozen=True, eq=False)
class Candidates:
    """The two cones that one outline allows: apexes `[2, 3]` [mm] and unit axes `[2, 3]` into the light.

    `flattening` is a - b of the ellipse [mm]; without any the two are one.
    """

    apexes: Array
    axes: Array
    flattening: float

    @classmethod
    def of(cls, apexes: Array, vertices: Array, flattening: float) -> Candidates:
        """From apexes `[2, 3]` and the ends of the major axis `[2, 3]` [mm], whose angle the cone's axis halves."""
        rays = vertices[None, :, :] - apexes[:, None, :]
        bisector = np.sum(rays / np.linalg.norm(rays, axis=-1, keepdims=True), axis=1)
        return cls(apexes, bisector / np.linalg.norm(bisector, axis=-1, keepdims=True), flattening)
