"""A flat map of the retina about a point, in which areas are true and distances nearly so.

Lambert's azimuthal equal-area projection of directions from the eye's centre. On a sphere a place's distance from the
map's centre is the chord, and an area that of the map; elsewhere `stretch` tells the areas apart.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.scene.eye import Eye
from conespot.scene.scene import Scene
from conespot.scene.surface import Surface

Array = NDArray[np.float64]
Maps = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Chart:
    """`side` x `side` cells of `cell` mm about a direction `centre` `[3]` from the eye's centre, from -x and -y on."""

    eye: Eye
    surface: Surface
    centre: Array
    side: int
    cell: float

    @classmethod
    def about(cls, scene: Scene, point: Array, half: float, cell: float) -> Chart:
        """The chart about a point `[3]` that reaches at least `half` [mm] to each side."""
        away = point - scene.eye.centre
        return cls(scene.eye, scene.surface, away / np.linalg.norm(away), _even_length(2.0 * half / cell), cell)

    @functools.cached_property
    def radius(self) -> float:
        """Distance of the surface from the eye's centre in the chart's middle [mm]: its scale."""
        return float(np.linalg.norm(self.surface.points(self.eye, self.centre) - self.eye.centre))

    @functools.cached_property
    def across(self) -> Array:
        """The map's axes x and y as unit vectors `[2, 3]`."""
        first = np.cross(self.centre, np.eye(3)[np.argmin(np.abs(self.centre))])
        first /= np.linalg.norm(first)
        return np.stack([first, np.cross(self.centre, first)])

    def places(self, directions: NDArray[np.floating]) -> NDArray[np.floating]:
        """Map coordinates x, y `[..., 2]` [mm] of unit directions `[..., 3]` from the eye's centre."""
        kind = directions.dtype
        along = directions @ self.centre.astype(kind)
        scale = kind.type(self.radius) * np.sqrt(2 / np.maximum(1 + along, kind.type(1e-12)))
        return np.asarray(scale[..., None] * (directions @ self.across.T.astype(kind)))

    def directions(self, places: Array) -> Array:
        """Unit directions `[..., 3]` of map coordinates `[..., 2]` [mm]; all round the eye, those of its far side."""
        chord = np.minimum(np.sum(np.square(places / self.radius), axis=-1), 4.0)[..., None]
        sideways = places / self.radius * np.sqrt(1.0 - chord / 4.0)
        direction = (1.0 - chord / 2.0) * self.centre + sideways @ self.across
        return np.asarray(direction / np.linalg.norm(direction, axis=-1, keepdims=True))

    @functools.cached_property
    def cells(self) -> Array:
        """Directions of the cells' centres `[side, side, 3]`, rows along y."""
        ticks = (np.arange(self.side) + 0.5 - self.side / 2.0) * self.cell
        return self.directions(np.stack(np.meshgrid(ticks, ticks), axis=-1))

    @functools.cached_property
    def stretch(self) -> Array | None:
        """Area of the surface over that of the map `[side, side]`; None on the sphere, where it is 1."""
        if self.surface.is_sphere:
            return None
        away = self.surface.points(self.eye, self.cells) - self.eye.centre
        facing = -np.sum(self.surface.normals(self.eye, self.cells) * self.cells, axis=-1)
        return np.asarray(np.sum(np.square(away), axis=-1) / (self.radius**2 * facing))

    def gathered(self, directions: Array, weights: Array) -> Array:
        """Weights `[N]` of unit directions `[N, 3]` as a density [1/mm2] `[side, side]`, each shared by four cells."""
        density = np.zeros(self.side**2)
        for cell, share in self.shares(directions):
            density += np.bincount(cell, share * weights, minlength=self.side**2)
        return density.reshape(self.side, self.side) / self.cell**2

    def read(self, values: Maps, directions: NDArray[np.floating]) -> Maps:
        """Maps `[K, side, side]` in unit directions `[N, 3]`, between four cells each: `[K, N]`; 0 outside them."""
        found = np.zeros((len(values), len(directions)), np.float32)
        for cell, share in self.shares(directions):
            for layer, out in zip(values.reshape(len(values), -1), found, strict=True):
                out += layer[cell] * share
        return found

    def shares(self, directions: NDArray[np.floating]) -> Iterator[tuple[NDArray[np.int32], NDArray[np.floating]]]:
        """The four cells about each of the directions `[N, 3]`, and its share in them; 0 for those outside."""
        x, y = np.moveaxis(self.places(directions), -1, 0) / directions.dtype.type(self.cell) + (self.side - 1) / 2
        column, row = np.floor(x).astype(np.int32), np.floor(y).astype(np.int32)
        right, up = x - column, y - row
        inside = (column >= 0) & (column < self.side - 1) & (row >= 0) & (row < self.side - 1)
        corner = np.where(inside, row * self.side + column, 0)
        yield corner, (1 - right) * (1 - up) * inside
        yield corner + 1, right * (1 - up) * inside
        yield corner + self.side, (1 - right) * up * inside
        yield corner + self.side + 1, right * up * inside


def _even_length(least: float) -> int:
    """An even number of cells, at least so many, whose Fourier transform is quick: one of few, so that kernels fit."""
    steps = (64, 96, 128, 192, 256, 320, 384, 448, 512, 576, 640, 768, 896, 1024, 1280, 1536, 1792, 2048)
    return next((side for side in steps if side >= least), steps[-1])
