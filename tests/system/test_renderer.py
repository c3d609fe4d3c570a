"""Rendered radiance against closed forms written here."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from conespot.render import Crop, Renderer
from conespot.render.reflectance import EXTENT, TEXEL, Reflectance
from conespot.render.retina_mesh import from_arc, to_arc
from conespot.scene import Camera, Eye, Pose, Scene
from conespot.scene.beam import CyclesBeam, HardBeam, LinearBeam, TabulatedBeam
from conespot.scene.illumination import Ambient
from conespot.scene.power import Power
from conespot.scene.retina import PhotoRetina, UniformRetina
from conespot.scene.spotlights import Instrument, Shaft, spotlight_axes
from conespot.scene.surface import Bump, Surface, bump_grid

BEAMS = {
    "hard": HardBeam(),
    "soft": CyclesBeam(blend=1.0),
    "half soft": CyclesBeam(blend=0.4),
    "linear": LinearBeam(),
    "table": TabulatedBeam(angles=(0.0, math.radians(4.0), math.radians(9.0)), intensities=(1.0, 0.9, 0.1)),
}


def scene_of(**changes):
    return Scene(**{"camera": Camera(resolution=400), "retina": UniformRetina(albedo=0.1), **changes})


def radiance_of(scene, pose, pixels, spotlight=0):
    """Lambert's closed form at pixel centres: albedo / pi * I(angle) * cos / d^2, from scene geometry alone."""
    rays = scene.camera.rays(pixels).directions
    points = scene.surface.intersect(scene.eye, scene.camera.centre, rays)
    outward = points - scene.eye.centre
    normals = scene.surface.normals(scene.eye, outward / np.linalg.norm(outward, axis=-1, keepdims=True))
    to_point = points - pose.apex
    distance = np.linalg.norm(to_point, axis=-1)
    direction = to_point / distance[..., None]
    axis = spotlight_axes(pose, scene.spotlights)[spotlight]
    cosine = np.maximum(-np.sum(normals * direction, axis=-1), 0.0)
    intensity = Power(value=1.0, convention=scene.power.convention).axial_intensity(scene.beam) * scene.beam.intensity(
        direction @ axis
    )
    return 0.1 / math.pi * intensity * cosine / (distance * 1e-3) ** 2


def pixel_grid(crop):
    x, y = np.meshgrid(crop.column + np.arange(crop.width) + 0.5, crop.row + np.arange(crop.height) + 0.5)
    return np.stack([x, y], axis=-1)


@pytest.mark.parametrize("name", BEAMS)
@pytest.mark.parametrize("convention", ["isotropic", "flux"])
def test_radiance_of_a_tile_is_lamberts_closed_form(name, convention):
    """A rendered tile against albedo / pi * I cos / d^2 at its pixels' centres; the median ratio within 0.1 %."""
    scene = scene_of(beam=BEAMS[name], power=Power(convention=convention))
    pose = scene.pose(np.array([1.2, -0.7, 4.0]))
    tile = Renderer(scene, samples=16).tile(pose, 0, seed=3)
    expected = radiance_of(scene, pose, pixel_grid(tile.crop))
    inside = expected > 0.02 * expected.max()
    # a pixel's mean is not its centre's value where the profile bends; only interior pixels are compared
    inner = cv2.erode(inside.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    assert inner.sum() > 200
    ratio = tile.radiance[..., 0][inner] / expected[inner]
    # stratified samples estimate the pixel's mean without bias: so does the median over hundreds of pixels
    assert abs(np.median(ratio) - 1.0) < 1e-3
    assert np.abs(ratio - 1.0).max() < 0.08


@pytest.mark.parametrize("name", BEAMS)
@pytest.mark.parametrize("convention", ["isotropic", "flux"])
def test_flux_through_the_cone_is_the_stated_watts(name, convention):
    """Radiance times pi / albedo, summed over the surface the camera sees, against the stated watts; within 0.1 %."""
    scene = scene_of(beam=BEAMS[name], power=Power(convention=convention))
    pose = scene.pose(np.array([0.5, 0.5, 5.0]))
    tile = Renderer(scene, samples=64).tile(pose, 0, seed=4)
    # area of the surface behind a pixel [mm2]: solid angle times distance squared over the cosine
    pixels = pixel_grid(tile.crop)
    rays = scene.camera.rays(pixels).directions
    distance = scene.eye.intersect(scene.camera.centre, rays)
    normals = (scene.eye.centre - (scene.camera.centre + distance[..., None] * rays)) / scene.eye.radius
    solid_angle = (-rays[..., 2]) ** 3 / scene.camera.focal_length_px**2
    area = solid_angle * distance**2 / -np.sum(rays * normals, axis=-1) * 1e-6
    seen = float(np.sum(tile.radiance[..., 0] * math.pi / 0.1 * area))
    assert seen == pytest.approx(Power(value=1.0, convention=convention).flux(scene.beam), rel=1e-3)


def test_background_is_albedo_over_pi_times_irradiance():
    """The rendered background at three pixels against albedo / pi * E cos of a tilted light; within 0.1 %."""
    scene = scene_of(ambient=Ambient(irradiance=2.0, tilt=math.radians(10.0), azimuth=0.4))
    background = Renderer(scene).background()[..., 0]
    pixels = np.array([[20.5, 30.5], [200.5, 200.5], [380.5, 100.5]])
    rays = scene.camera.rays(pixels).directions
    points = scene.camera.centre + scene.eye.intersect(scene.camera.centre, rays)[:, None] * rays
    normals = (scene.eye.centre - points) / scene.eye.radius
    light = np.array(
        [math.sin(0.174532925) * math.cos(0.4), math.sin(0.174532925) * math.sin(0.4), math.cos(0.174532925)]
    )
    seen = background[pixels[:, 1].astype(int), pixels[:, 0].astype(int)]
    np.testing.assert_allclose(seen, 0.1 / math.pi * 2.0 * normals @ light, rtol=1e-3)


@pytest.mark.parametrize("where", [(0.0, 0.0), (4.5, 3.0), (-5.5, 5.0), (2.0, -5.8)])
def test_a_known_point_projects_to_the_same_pixel_in_scene_and_mitsuba(where):
    """A small bright disc of albedo is rendered; its centroid must be where `Camera.project` puts its centre."""
    scene = Scene(camera=Camera(resolution=1000), beam=HardBeam(half_angle=math.radians(1.0)), retina=UniformRetina())
    # a thin cone straight down the normal at the point lights a disc around it
    point = scene.surface.points(scene.eye, from_arc(scene, np.array(where)))
    inward = (scene.eye.centre - point) / scene.eye.radius
    pose = Pose(point + 4.0 * inward, -inward)
    tile = Renderer(scene, samples=256).tile(pose, 0, seed=1)
    weights = tile.radiance[..., 0].astype(float)
    centroid = np.tensordot(weights, pixel_grid(tile.crop), axes=([0, 1], [0, 1])) / weights.sum()
    # the disc's own perspective moves its centroid: compared with that of its outline, exactly projected
    outline = scene.camera.project(scene.outline(pose, 0, points=720))
    x, y = outline.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    expected = [((c + np.roll(c, -1)) * cross).sum() / (3.0 * cross.sum()) for c in (x, y)]
    assert np.abs(centroid - expected).max() < 0.05
    assert np.abs(scene.camera.project(point) - expected).max() < 0.05


def test_texture_lies_where_the_arc_coordinates_say():
    """The background over the ambient light's closed form is the albedo map, looked up through `scene` alone."""
    scene = scene_of(camera=Camera(resolution=1000), retina=PhotoRetina())
    background = Renderer(scene).background()[..., 0]
    pixels = pixel_grid(Crop(0, 0, 1000, 1000))
    rays = scene.camera.rays(pixels).directions
    points = scene.camera.centre + scene.eye.intersect(scene.camera.centre, rays)[..., None] * rays
    cosine = ((scene.eye.centre - points) / scene.eye.radius)[..., 2]
    arc = to_arc(scene, points)
    albedo = cv2.boxFilter(Reflectance(scene.retina).map, -1, (3, 3))
    column, row = ((arc[..., k] * sign + EXTENT) / TEXEL - 0.5 for k, sign in ((0, 1.0), (1, -1.0)))
    near = cv2.remap(albedo, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR)
    seen = background / (scene.ambient.irradiance / math.pi * cosine)
    assert np.ptp(near) > 0.05, "the texture must have a pattern for this to mean anything"
    assert np.percentile(np.abs(seen / near - 1.0), 99) < 0.05
    assert abs(np.mean(seen / near) - 1.0) < 2e-3


def test_bumps_are_displaced_and_shaded_as_the_closed_form_says():
    """A tile over a bump against Lambert's law on the surface's own points and normals; the median within 0.2 %."""
    scene = scene_of(surface=Surface(bumps=(Bump(x=0.3, y=0.2, diameter=1.0, height=0.1),)), beam=HardBeam())
    pose = scene.pose(np.array([1.0, 0.0, 5.0]))
    tile = Renderer(scene, samples=64).tile(pose, 0, seed=5)
    pixels = pixel_grid(tile.crop)
    expected = radiance_of(scene, pose, pixels)
    flat = radiance_of(scene_of(beam=HardBeam()), pose, pixels)
    bumped = (np.abs(expected / np.where(flat > 0, flat, np.inf) - 1.0) > 0.05) & (expected > 0)
    assert bumped.sum() > 100, "the bump must show for this test to mean anything"
    inner = expected > 0.5 * flat.max()
    ratio = tile.radiance[..., 0][inner] / expected[inner]
    assert abs(np.median(ratio) - 1.0) < 2e-3
    assert np.percentile(np.abs(ratio - 1.0), 90) < 0.03


def test_the_shaft_hides_the_retina_and_casts_a_shadow():
    """A background with a black shaft against one without, where the shaft and its cast shadow project."""
    ambient = Ambient(tilt=math.radians(20.0), azimuth=math.pi / 2)
    scene = scene_of(ambient=ambient, instrument=Instrument(shaft=Shaft(albedo=0.0)))
    pose = scene.pose(np.array([0.0, 0.0, 4.0]))
    renderer = Renderer(scene)
    bare, shaded = renderer.background(), renderer.background(pose)
    dark = shaded[..., 0] < 0.3 * bare[..., 0]
    on_shaft = scene.camera.project(pose.apex - 3.0 * pose.axis)
    assert dark[int(on_shaft[1]), int(on_shaft[0])]
    # the shadow falls where the light's ray through a point of the shaft meets the retina, away from the lamp
    middle = pose.apex - 3.0 * pose.axis
    down = -np.array([0.0, math.sin(ambient.tilt), math.cos(ambient.tilt)])
    shadow = scene.camera.project(middle + scene.eye.intersect(middle, down) * down)
    assert dark[int(shadow[1]), int(shadow[0])]
    assert np.linalg.norm(shadow - on_shaft) > 20.0
    assert 0.005 < dark.mean() < 0.2
    # the spot's own light is behind no shaft: the patch is as bright as without
    plain = Renderer(scene_of(ambient=ambient)).tile(pose, 0, seed=2)
    with_shaft = renderer.tile(pose, 0, seed=2)
    # without a shaft the retina is Mitsuba's sphere and not a mesh: the same to the last bits of float32
    assert with_shaft.radiance.sum() <= plain.radiance.sum() * (1.0 + 1e-6)
    assert with_shaft.radiance.sum() > 0.3 * plain.radiance.sum()


def test_arc_coordinates_invert_and_keep_distances_from_the_pole():
    scene = Scene(eye=Eye(radius=12.5))
    arc = np.random.default_rng(0).uniform(-7, 7, (100, 2))
    directions = from_arc(scene, arc)
    points = scene.surface.points(scene.eye, directions)
    np.testing.assert_allclose(to_arc(scene, points), arc, atol=1e-12)
    np.testing.assert_allclose(12.5 * np.arccos(-directions[:, 2]), np.linalg.norm(arc, axis=1), atol=1e-9)


def test_bump_grid_is_the_papers_fifteen_bumps():
    assert len(bump_grid().bumps) == 15
    assert {(b.diameter, b.height) for b in bump_grid().bumps} == {(0.5, 0.1)}
