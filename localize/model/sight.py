"""What pixels look at: places on the eye's wall, how they move with the pixel, and what is out of focus there."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: places at which the circle of confusion is traced; between them its square is a polynomial of this degree
_TRACED, _DEGREE = 100, 3


@dataclass(frozen=True)
class Sight:
    """What the pixels look at: surface points, their normals, and how the points move with the pixel.

    Arrays of vectors have their components first in memory: sums over them are then sums of long vectors.
    """

    points: Array  #: `[N, 3]` [mm]
    normals: Array  #: unit, towards the inside `[N, 3]`
    along_x: Array  #: displacement of the point per pixel to the right `[N, 3]` [mm/px]
    along_y: Array  #: displacement of the point per pixel down `[N, 3]` [mm/px]
    side: float = 1.0  #: of a pixel, where it is a bin of several [px]
    confusion: Array = field(default_factory=lambda: np.zeros(0))  #: squares of radii out of focus `[N or 0]` [px^2]

    def part(self, at: NDArray[np.intp]) -> Sight:
        """What some of the pixels look at."""
        confusion = self.confusion[at] if len(self.confusion) else self.confusion
        points, normals = some(self.points, at), some(self.normals, at)
        return Sight(points, normals, some(self.along_x, at), some(self.along_y, at), self.side, confusion)


def some(vectors: Array, at: NDArray[np.intp]) -> Array:
    """Some of the vectors `[N, 3]` of a sight, which have their components first in memory and keep them so."""
    return vectors.T.take(at, axis=1).T


def look(scene: Scene, pixels: Array, side: float = 1.0) -> Sight:
    """What pixels with centres `[N, 2]` [px] and `side` [px] see of the scene's surface.

    Raises nothing: where a ray misses the eye the points are NaN.
    """
    eye, rays = scene.eye, scene.camera.rays(pixels)
    d = np.asfortranarray(rays.directions)
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
        step = side * (origins + distance * np.asfortranarray(directions))
        return np.asarray(step - (np.einsum("ij,ij->i", normals, step) / facing)[:, None] * d)

    along_x = along(rays.origins_by_x, rays.directions_by_x)
    along_y = along(rays.origins_by_y, rays.directions_by_y)
    confusion = np.zeros(0) if scene.camera.pupil == 0.0 else _confusion(scene, pixels, points)
    first = np.asfortranarray
    return Sight(first(points), first(normals), first(along_x), first(along_y), side, confusion)


def _confusion(scene: Scene, pixels: Array, points: Array) -> Array:
    """Squares of the radii of the circles of confusion `[N]` [px^2]: smooth too where the focus changes sides."""
    seen = np.flatnonzero(np.isfinite(points[:, 0]))
    found = np.zeros(len(points))
    some = seen[:: max(1, len(seen) // _TRACED)]
    squares = np.square(scene.camera.confusion(points[some]))
    some, squares = some[np.isfinite(squares)], squares[np.isfinite(squares)]
    if not len(some):
        return found
    middle = pixels[some].mean(axis=0)
    scale = max(float(np.max(np.ptp(pixels[some], axis=0))), 1.0)
    x, y = ((pixels - middle) / scale).T
    degree = _DEGREE if len(some) > 4 * _DEGREE**2 else 0
    terms = np.stack([x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)], axis=1)
    found[seen] = terms[seen] @ np.linalg.lstsq(terms[some], squares, rcond=None)[0]
    return np.maximum(found, 0.0)


def window(row: int, column: int, height: int, width: int, side: int = 1) -> Array:
    """Centres `[height * width, 2]` [px] of `side` x `side` bins of a window whose first pixel is (row, column)."""
    x = column + side * (np.arange(width) + 0.5)
    y = row + side * (np.arange(height) + 0.5)
    return np.stack([np.tile(x, height), np.repeat(y, width)], axis=1)
