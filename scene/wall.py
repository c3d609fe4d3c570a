"""The wall about a needle: how far its tip is from it, and how that changes with the pose and with the wall."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from conespot.scene.pose import tangents
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: the search for the nearest point begins with directions this far apart on the wall [mm]: bumps are wider
_APART_MM = 0.2
_FEWEST, _MOST = 15, 61  # of them along a side
_SIDE, _NARROWED = 9, 3  # when it is narrowed, and how often
#: Newton steps then, and the least step of its differences [rad]: less would be lost in rounding
_STEPS, _NARROW = 8, 1e-5
#: a Newton step [rad] after which the distance is found to well below a nanometre
_SETTLED = 1e-7


@dataclass(frozen=True)
class Wall:
    """Where a needle's axis meets the wall, and the wall's point nearest its tip: `[3]` [mm] each."""

    scene: Scene
    apex: Array
    axis: Array
    ahead: Array
    nearest: Array

    @classmethod
    def about(cls, scene: Scene, apex: Array, axis: Array) -> Wall:
        """The wall of a scene about a needle; `ahead` is NaN where the axis meets none."""
        ahead = scene.surface.intersect(scene.eye, apex, axis)
        return cls(scene, apex, axis, ahead, _nearest(scene, apex))

    @cached_property
    def distances(self) -> Array:
        """Along the axis and from the nearest point `[2]` [mm]; negative for a tip behind the wall."""
        inside = float(self.scene.depth(self.apex)) >= 0.0
        nearest = float(np.linalg.norm(self.nearest - self.apex))
        return np.array([float((self.ahead - self.apex) @ self.axis), nearest if inside else -nearest])

    def by_pose(self, size: int) -> Array:
        """Change of both per change of tip [mm] and axis [rad] `[2, size]`: tip, axis along its tangents, roll."""
        along, nearest = self.distances
        rows = np.zeros((2, size))
        n = self._ahead_normal
        facing = float(n @ self.axis)
        rows[0, :3] = -n / facing
        rows[0, 3:5] = [-along * float(n @ tangent) / facing for tangent in tangents(self.axis)]
        rows[1, :3] = (self.apex - self.nearest) / (nearest or 1.0)
        return rows

    def by_wall(self, other: Scene) -> Array:
        """Change of both `[2]` [mm] where the wall becomes another scene's, to first order."""
        n = self._ahead_normal
        along = float(n @ self._moved(self.ahead, other)) / float(n @ self.axis)
        _, nearest = self.distances
        inwards = (self.apex - self.nearest) / (nearest or 1.0)
        # of the nearest point only what moves towards the tip counts: beside it, it stays the nearest
        return np.array([along, -float(inwards @ self._moved(self.nearest, other))])

    def by_relief(self) -> Array:
        """Change of both `[2]` per mm that the wall is raised."""
        return np.array([1.0 / abs(float(self._ahead_normal @ self.axis)), 1.0])

    def _direction(self, point: Array) -> Array:
        away = point - self.scene.eye.centre
        return np.asarray(away / np.linalg.norm(away))

    @cached_property
    def _ahead_normal(self) -> Array:
        return self._normal(self.ahead)

    def _normal(self, point: Array) -> Array:
        return self.scene.surface.normals(self.scene.eye, self._direction(point))

    def _moved(self, point: Array, other: Scene) -> Array:
        return other.surface.points(other.eye, self._direction(point)) - point


def _nearest(scene: Scene, apex: Array) -> Array:
    """The wall's point nearest a tip `[3]` [mm]: on a sphere in closed form, else by narrowing a grid of directions."""
    offset = apex - scene.eye.centre
    out = float(np.linalg.norm(offset))
    middle = offset / out if out > 0.0 else np.array([0.0, 0.0, -1.0])
    if scene.surface.is_sphere:
        return np.asarray(scene.eye.centre + scene.eye.radius * middle)
    # what is nearer than the wall in this direction lies within the ball that touches it
    reach = abs(float(scene.depth(apex)))
    width = math.asin(reach / out) if reach < out else math.pi
    if scene.surface.semi_axes == (1.0, 1.0, 1.0) and out > 0.0:
        # or is raised towards it by no more than the relief: on the sphere itself this direction's point is the nearest
        radius = scene.eye.radius
        share = ((reach + scene.surface.relief) ** 2 - (radius - out) ** 2) / (4.0 * radius * out)
        width = min(width, 2.0 * math.asin(math.sqrt(min(max(share, _NARROW**2), 1.0))))
    side = int(np.clip(2 * math.ceil(width * scene.eye.radius / _APART_MM) + 1, _FEWEST, _MOST))
    for _ in range(_NARROWED):
        rays = _around(middle, width, side)
        best = int(np.argmin(_squared(scene, apex, rays)))
        middle, width, side = rays[best], 3.0 * width / (side - 1), _SIDE
    return _settled(scene, apex, middle, width / _SIDE)


def _squared(scene: Scene, apex: Array, rays: Array) -> Array:
    """Squared distances `[N]` [mm^2] of the wall in unit directions `[N, 3]`."""
    return np.asarray(np.sum(np.square(scene.surface.points(scene.eye, rays) - apex), axis=-1))


def _settled(scene: Scene, apex: Array, middle: Array, step: float) -> Array:
    """The nearest point `[3]` [mm], by Newton's method from a direction near it, on differences over a `step` [rad]."""
    for _ in range(_STEPS):
        f = _squared(scene, apex, _around(middle, step, 3)).reshape(3, 3)  # rows are steps along V, columns along U
        slope = np.array([f[1, 2] - f[1, 0], f[2, 1] - f[0, 1]]) / 2.0
        xx, yy = f[1, 2] - 2.0 * f[1, 1] + f[1, 0], f[2, 1] - 2.0 * f[1, 1] + f[0, 1]
        xy = (f[2, 2] - f[2, 0] - f[0, 2] + f[0, 0]) / 4.0
        bend = xx * yy - xy * xy
        if not (xx > 0.0 and bend > 0.0):
            break
        x, y = np.clip(np.array([yy * slope[0] - xy * slope[1], xx * slope[1] - xy * slope[0]]) / -bend, -2.0, 2.0)
        u, v = tangents(middle)
        turned = middle + step * (x * u + y * v)
        middle = turned / np.linalg.norm(turned)
        if step * math.hypot(x, y) < _SETTLED:
            break
        step = max(step * max(min(1.0, math.hypot(x, y)), 0.1), _NARROW)
    return np.asarray(scene.surface.points(scene.eye, middle))


def _around(middle: Array, width: float, side: int) -> Array:
    """Unit directions `[side^2, 3]` in a square of half that width [rad] about one, equidistant from it."""
    u, v = tangents(middle)
    x, y = np.meshgrid(*[np.linspace(-width, width, side)] * 2)
    angle = np.minimum(np.hypot(x, y), math.pi).ravel()[:, None]
    across = x.ravel()[:, None] * u + y.ravel()[:, None] * v
    return np.asarray(np.cos(angle) * middle + np.sinc(angle / math.pi) * across)
