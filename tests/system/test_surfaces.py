"""Ellipsoids and height maps: rendered as the closed form says, and localized on."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from conespot.localize import locate
from conespot.localize.model.knowns import Knowns
from conespot.render import Exposure, Renderer, kernel
from conespot.render.retina_mesh import retina_mesh
from conespot.scene import Camera, Scene
from conespot.scene.beam import HardBeam
from conespot.scene.height_map import ReliefMap
from conespot.scene.power import Power
from conespot.scene.retina import UniformRetina
from conespot.scene.sensor import Linear
from conespot.scene.surface import Surface, bump_grid


def drusen():
    """Soft mounds of up to 60 um, 0.7 mm wide and more, where they meet flat on top, over 10 mm."""
    x, y = np.meshgrid(np.linspace(-5.0, 5.0, 81), np.linspace(5.0, -5.0, 81))
    heights = np.zeros(x.shape)
    for px, py, size in np.random.default_rng(4).uniform((-4.0, -4.0, 0.3), (4.0, 4.0, 0.6), (60, 3)):
        heights += np.exp(-((x - px) ** 2 + (y - py) ** 2) / (2.0 * size**2))
    heights = 60.0 * (1.0 - np.exp(-heights))
    return ReliefMap(kind="csv", file="drusen.csv", width=10.0, points=heights.tolist())


SURFACES = {
    "ellipsoid": Surface(semi_axes=(1.03, 0.97, 1.1)),
    "height map": Surface(height_map=drusen()),
    "all": Surface(semi_axes=(1.03, 0.97, 1.1), bumps=bump_grid().bumps, height_map=drusen()),
}


def scene_on(name, **parts):
    given = {"camera": Camera(resolution=1000), "beam": HardBeam(), "retina": UniformRetina(albedo=0.1)}
    return Scene(**{**given, "surface": SURFACES[name], "sensor": Linear(bits=12), **parts})


def radiance_of(scene, pose, crop):
    """Lambert's closed form at pixel centres: albedo / pi * I(angle) * cos / d^2, from scene geometry alone."""
    x, y = np.meshgrid(crop.column + np.arange(crop.width) + 0.5, crop.row + np.arange(crop.height) + 0.5)
    rays = scene.camera.rays(np.stack([x, y], axis=-1)).directions
    points = scene.surface.intersect(scene.eye, scene.camera.centre, rays)
    outward = points - scene.eye.centre
    normals = scene.surface.normals(scene.eye, outward / np.linalg.norm(outward, axis=-1, keepdims=True))
    to_point = points - pose.apex
    distance = np.linalg.norm(to_point, axis=-1)
    cosine = np.maximum(-np.sum(normals * to_point, axis=-1) / distance, 0.0)
    intensity = Power(value=1.0, convention=scene.power.convention).axial_intensity(scene.beam)
    intensity = intensity * scene.beam.intensity(to_point @ pose.axis / distance)
    return 0.1 / math.pi * intensity * cosine / (distance * 1e-3) ** 2


@pytest.mark.parametrize("name", SURFACES)
def test_the_patch_is_as_bright_and_where_the_closed_form_says(name):
    """A rendered tile against Lambert's law on the surface's own points and normals; the median within 0.2 %."""
    scene = scene_on(name)
    pose = scene.pose(np.array([3.0, 2.5, 5.0]))
    tile = Renderer(scene, samples=64).tile(pose, 0, seed=5)
    expected = radiance_of(scene, pose, tile.crop)
    plain = radiance_of(scene_on(name, surface=Surface()), pose, tile.crop)
    lit = (expected > 0.02 * expected.max()).astype(np.uint8)
    inner = cv2.erode(lit, np.ones((5, 5), np.uint8)) > 0
    assert inner.sum() > 1000
    assert np.percentile(np.abs(plain[inner] / expected[inner] - 1.0), 90) > 0.01, "the sphere must look different"
    ratio = tile.radiance[..., 0][inner] / expected[inner]
    assert abs(np.median(ratio) - 1.0) < 2e-3
    assert np.percentile(np.abs(ratio - 1.0), 90) < 0.02
    # and its whole edge is in the tile
    assert not tile.radiance[[0, -1]].any()
    assert not tile.radiance[:, [0, -1]].any()


@pytest.mark.parametrize(("name", "depart"), [("ellipsoid", 1e-4), ("height map", 2e-4)])
def test_the_mesh_keeps_to_the_surface(name, depart):
    """The middle of every triangle within 0.1 um of an ellipsoid, 0.2 um of drusen; vertex normals are exact."""
    mi, _, _ = kernel.load()
    scene = scene_on(name)
    mesh = retina_mesh(mi, scene, mi.load_dict({"type": "diffuse"}))
    parameters = mi.traverse(mesh)
    vertices, normals = (
        np.array(parameters[f"vertex_{what}"], float).reshape(-1, 3) for what in ("positions", "normals")
    )
    faces = np.array(parameters["faces"]).reshape(-1, 3)
    assert np.abs(scene.depth(vertices)).max() < 2e-6
    assert np.abs(scene.depth(vertices[faces].mean(axis=1))).max() < depart
    outward = vertices - scene.eye.centre
    exact = scene.surface.normals(scene.eye, outward / np.linalg.norm(outward, axis=1, keepdims=True))
    np.testing.assert_allclose(normals, exact, atol=2e-6)
    # as far as the camera sees
    corner = scene.camera.project(vertices[[0, -1]])
    assert np.all((corner < 0.0) | (corner > scene.camera.resolution))


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "all" else pytest.mark.slow) for name in SURFACES]
)
def test_cone_finds_the_tip_to_two_micrometres_on_a_surface_it_is_told_of_and_not_if_told_of_a_sphere(name):
    scene = scene_on(name)
    renderer = Renderer(scene, samples=512)
    exposure = Exposure(renderer.background(), scene.sensor)
    sphere = scene.model_copy(update={"surface": Surface()})
    for seed, apex in enumerate(([1.0, 0.4, 5.0], [2.0, -2.0, 4.0])):
        image = exposure.frame([renderer.tile(scene.pose(np.array(apex)), 0, seed=seed)], 0.004)
        told, untold = (locate(image, s, "cone", knowns=Knowns(rcm_sigma_mm=None)) for s in (scene, sphere))
        assert told
        assert np.linalg.norm(told.apex_mm - apex) < 2e-3
        assert not untold or np.linalg.norm(untold.apex_mm - apex) > 0.02
