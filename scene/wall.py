"""The wall about a needle: how far its tip is from it, and how that changes with the pose and with the wall."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.scene.pose import tangents
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: the search for the nearest point begins with directions this far apart on the wall [mm]: bumps are wider
_APART_MM = 0.1
_FEWEST, _MOST = 15, 61  # of them along a side
_SIDE = 9  # when it is narrowed
#: what is left of the directions' spread when the nearest distance is found to well below a nanometre [rad]
_NARROW = 1e-7


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

    @property
    def distances(self) -> Array:
        """Along the axis and from the nearest point `[2]` [mm]; negative for a tip behind the wall."""
        inside = float(self.scene.depth(self.apex)) >= 0.0
        nearest = float(np.linalg.norm(self.nearest - self.apex))
        return np.array([float((self.ahead - self.apex) @ self.axis), nearest if inside else -nearest])

    def by_pose(self, size: int) -> Array:
        """Change of both per change of tip [mm] and axis [rad] `[2, size]`: tip, axis along its tangents, roll."""
        along, nearest = self.distances
        rows = np.zeros((2, size))
        n = self._normal(self.ahead)
        facing = float(n @ self.axis)
        rows[0, :3] = -n / facing
        rows[0, 3:5] = [-along * float(n @ tangent) / facing for tangent in tangents(self.axis)]
        rows[1, :3] = (self.apex - self.nearest) / (nearest or 1.0)
        return rows

    def by_wall(self, other: Scene) -> Array:
        """Change of both `[2]` [mm] where the wall becomes another scene's, to first order."""
        n = self._normal(self.ahead)
        along = float(n @ self._moved(self.ahead, other)) / float(n @ self.axis)
        _, nearest = self.distances
        inwards = (self.apex - self.nearest) / (nearest or 1.0)
        # of the nearest point only what moves towards the tip counts: beside it, it stays the nearest
        return np.array([along, -float(inwards @ self._moved(self.nearest, other))])

    def by_relief(self) -> Array:
        """Change of both `[2]` per mm that the wall is raised."""
        return np.array([1.0 / abs(float(self._normal(self.ahead) @ self.axis)), 1.0])

    def _direction(self, point: Array) -> Array:
        away = point - self.scene.eye.centre
        return np.asarray(away / np.linalg.norm(away))

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
    side = int(np.clip(2 * math.ceil(width * scene.eye.radius / _APART_MM) + 1, _FEWEST, _MOST))
    while True:
        rays = _around(middle, width, side)
        points = scene.surface.points(scene.eye, rays)
        best = int(np.argmin(np.sum(np.square(points - apex), axis=-1)))
        if width < _NARROW:
            return np.asarray(points[best])
        middle, width, side = rays[best], 3.0 * width / (side - 1), _SIDE


def _around(middle: Array, width: float, side: int) -> Array:
    """Unit directions `[side^2, 3]` in a square of half that width [rad] about one, equidistant from it."""
    u, v = tangents(middle)
    x, y = np.meshgrid(*[np.linspace(-width, width, side)] * 2)
    angle = np.minimum(np.hypot(x, y), math.pi).ravel()[:, None]
    across = x.ravel()[:, None] * u + y.ravel()[:, None] * v
    return np.asarray(np.cos(angle) * middle + np.sinc(angle / math.pi) * across)
