"""The retina as a triangle mesh with exact vertex normals."""

from __future__ import annotations

import math
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from conespot.render.reflectance import Reflectance
from conespot.scene import Scene

if TYPE_CHECKING:
    from mitsuba import BSDF, Mesh

#: of neighbouring vertices [mm]: chords depart from the sphere by 10 nm, from the paper's bumps by up to 3.2 um
VERTEX_SPACING = 0.03


def arc_extent(scene: Scene) -> float:
    """Half the side [mm] of the square, in arc coordinates, that holds all the retina the camera can see."""
    limit = scene.eye.radius * math.pi / 2.0
    if scene.camera.optics is not None:
        return _through_the_pupil(scene, limit)
    along = np.linspace(0.0, 1.0, 33)
    border = np.concatenate([[(t, 0.0), (t, 1.0), (0.0, t), (1.0, t)] for t in along]) * scene.camera.shape[::-1]
    rays = scene.camera.rays(border)
    points = scene.surface.intersect(scene.eye, rays.origins, rays.directions)
    if np.any(np.isnan(points)):
        return limit
    return float(min(1.02 * np.max(np.abs(to_arc(scene, points))) + scene.surface.relief, limit))


def _through_the_pupil(scene: Scene, limit: float) -> float:
    """`arc_extent` where the pupil cuts the view, at most `limit` [mm]; a tenth more for what lies between the rays."""
    places = np.stack(np.meshgrid(np.linspace(0.0, 1.0, 65), np.linspace(0.0, 1.0, 65)), axis=-1).reshape(-1, 2)
    rays = scene.camera.rays(places * scene.camera.shape[::-1])
    points = scene.surface.intersect(scene.eye, rays.origins, rays.directions)
    seen = points[np.isfinite(points[:, 0])]
    return float(min(1.1 * np.max(np.abs(to_arc(scene, seen))) + scene.surface.relief, limit))


def to_arc(scene: Scene, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Arc coordinates `[..., 2]` [mm] of points `[..., 3]`: azimuthal equidistant about the posterior pole."""
    return scene.eye.arc(points - scene.eye.centre)


def from_arc(scene: Scene, arc: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit directions `[..., 3]` from the eye's centre at arc coordinates `[..., 2]` [mm]."""
    angle = np.linalg.norm(arc, axis=-1) / scene.eye.radius
    sideways = arc / scene.eye.radius * np.sinc(angle / np.pi)[..., None]
    return np.concatenate([sideways, -np.cos(angle)[..., None]], axis=-1)


def retina_mesh(mi: ModuleType, scene: Scene, bsdf: BSDF) -> Mesh:
    """The Mitsuba mesh of the visible retina: on the surface, with its exact normals."""
    extent = arc_extent(scene)
    n = math.ceil(2.0 * extent / VERTEX_SPACING) + 1
    ticks = np.linspace(-extent, extent, n)
    arc = np.stack(np.meshgrid(ticks, ticks, indexing="xy"), axis=-1).reshape(-1, 2)
    directions = from_arc(scene, arc)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + n], 1), np.stack([corner + 1, corner + n + 1, corner + n], 1)]
    )

    properties = mi.Properties()
    properties["bsdf"] = bsdf
    mesh = mi.Mesh("retina", len(arc), len(faces), has_vertex_normals=True, has_vertex_texcoords=True, props=properties)
    parameters = mi.traverse(mesh)
    parameters["faces"] = faces.astype(np.uint32).ravel()
    parameters["vertex_positions"] = scene.surface.points(scene.eye, directions).astype(np.float32).ravel()
    parameters["vertex_normals"] = scene.surface.normals(scene.eye, directions).astype(np.float32).ravel()
    parameters["vertex_texcoords"] = Reflectance.texture_coordinates(arc).astype(np.float32).ravel()
    parameters.update()
    return mesh
