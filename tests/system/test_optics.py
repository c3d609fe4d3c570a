"""Frames through the eye's optics: where light lands, how much of it comes out, and what a fit makes of them."""

import numpy as np
import pytest

from conespot.localize import locate
from conespot.render import Exposure, Renderer, kernel
from conespot.render.rays import RayGenerator
from conespot.scene import media
from conespot.scene.scene import Scene

FLAT = {"eye": "navarro", "contact": "flat"}
UPRIGHT = {"rcm": [0.0, 0.0, 22.0]}
LIGHTS = {name: {"kind": "line", "name": name, "wavelength": nm} for name, nm in (("blue", 450.0), ("infrared", 850.0))}


def scene_of(optics, light="line532", resolution=300, **more):
    return Scene.model_validate(
        {
            "eye": {"radius": 12.0},
            "camera": {"resolution": resolution, "optics": optics},
            "retina": {"kind": "uniform"},
            "illumination": light,
            "ambient": {"illumination": light},
            "sensor": {"kind": "linear", "bits": 12},
            **more,
        }
    )


needs_jit = pytest.mark.skipif(not kernel.load()[2].vectorized, reason="the scalar variant has Mitsuba's own camera")


@needs_jit
@pytest.mark.parametrize("optics", [FLAT, {"eye": "navarro"}, {"eye": "le-grand", "lens": "pseudophakic"}])
@pytest.mark.parametrize("wavelength", [450.0, 589.3, 850.0])
def test_the_kernel_bends_rays_as_the_camera_does(optics, wavelength):
    """`RayGenerator` in single precision against `Camera.rays`: origins to 0.1 um, directions to 2e-6 (0.03 um)."""
    eye = {"radius": 13.4 if optics["eye"] == "le-grand" else 12.0}
    camera = scene_of(optics, eye=eye).camera
    mi = kernel.load()[0]
    pixels = np.random.default_rng(0).uniform(0.0, 300.0, (2000, 2))
    rays = camera.rays(pixels.astype(np.float32).astype(float), wavelength)
    x, y = (mi.Float(part.astype(np.float32)) for part in pixels.T)
    found, seen = RayGenerator(camera, 0.0).rays(x, y, mi.Spectrum(wavelength))
    inside = np.isfinite(rays.directions[:, 0])
    assert np.mean(np.asarray(seen) == inside) > 0.999  # but for rays on the pupil's very rim
    both = inside & np.asarray(seen)
    assert 0.2 < both.mean() < 0.8
    np.testing.assert_allclose(np.array(found.o).T[both], rays.origins[both], rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(np.array(found.d).T[both], rays.directions[both], rtol=0.0, atol=2e-6)


@needs_jit
@pytest.mark.parametrize("light", LIGHTS)
def test_light_leaves_through_the_media_once_and_the_microscopes_passes_them_twice(light):
    """Radiance of the same place on the retina with and without optics, in a line of light.

    The spotlight's is times T / n^2, T the media's transmission and n the vitreous' index, the microscope's T^2 / n^2.
    """
    wavelength = LIGHTS[light]["wavelength"]
    plain, through = (scene_of(optics, LIGHTS[light], instrument=UPRIGHT) for optics in (None, FLAT))
    transmission, n = float(media.transmission(wavelength, 60.0)), media.index("vitreous", wavelength)
    pose = plain.pose(np.array([0.3, -0.2, 5.0]))
    places = np.array([[0.4, -0.27, 0.01], [0.3, -0.2, 0.005]])
    values = []
    for scene in (plain, through):
        renderer = Renderer(scene, samples=64, noise=0.0)
        tile, background = renderer.tile(pose, 0, 1), renderer.background()
        column, row = np.floor(scene.camera.project(places)).astype(int).T
        values.append((tile.radiance[row - tile.crop.row, column - tile.crop.column, 0], background[row, column, 0]))
    (lit, ambient), (lit_through, ambient_through) = values
    # a pixel is as large as a tenth of the patch, and not the same in both frames
    np.testing.assert_allclose(lit_through / lit, transmission / n**2, rtol=0.03)
    np.testing.assert_allclose(ambient_through / ambient, transmission**2 / n**2, rtol=0.002)


@needs_jit
def test_the_frame_is_black_where_the_iris_hides_the_retina():
    scene = scene_of(FLAT)
    background = Renderer(scene).background()[..., 0]
    at = np.stack(np.meshgrid(np.arange(301), np.arange(301)), axis=-1)
    corners = scene.camera.shows(at)
    each = np.stack([corners[:-1, :-1], corners[1:, :-1], corners[:-1, 1:], corners[1:, 1:]])
    # a pixel with all its corners behind the iris may show a sliver of the pupil, and only on its rim
    rim = ~each.any(axis=0) & (background > 0.0)
    assert rim.sum() < 0.002 * rim.size
    assert np.all(background[each.all(axis=0)] > 0.0)
    assert 0.35 < np.mean(background > 0.0) < 0.45


@needs_jit
def test_a_patch_that_no_ray_can_outline_fills_what_the_pupil_shows():
    """A phakic eye without contact lens shows half a millimetre of retina, all of it inside the patch."""
    scene = scene_of({"eye": "navarro"}, instrument=UPRIGHT)
    tile = Renderer(scene).tile(scene.pose(np.array([0.0, 0.0, 8.0])), 0, 1)
    assert tile.crop.height == 300
    assert np.mean(tile.radiance > 0.0) > 0.4


@needs_jit
@pytest.mark.parametrize("light", ["line532", "ir850"])
def test_cone_recovers_the_pose_of_a_frame_through_a_flat_contact_lens(light):
    """A noiseless 600 px frame, pixels of 21 um: tip to 25 um and axis to 0.1 deg, as without optics.

    Told the same eye without its optics, `cone` is wrong by more than ten times that or refuses.
    """
    scene = scene_of(FLAT, light, 600, beam={"kind": "hard"}, power={"value": 0.25})
    pose = scene.pose(np.array([0.8, -0.6, 4.0]))
    renderer = Renderer(scene)
    frame = Exposure(renderer.background(), scene.sensor).frame([renderer.tile(pose, 0, 1)], scene.power.value)
    found = locate(frame, scene, localizer="cone")
    assert found
    assert np.linalg.norm(found.apex_mm - pose.apex) < 0.025
    assert np.degrees(np.arccos(min(1.0, found.axis @ pose.axis))) < 0.1
    naive = locate(frame, scene_of(None, light, 600, beam={"kind": "hard"}), localizer="cone")
    assert not naive or np.linalg.norm(naive.apex_mm - pose.apex) > 0.05
