"""The camera: where it is, what its pixels see along, and what it does not see."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conespot.scene import Camera, load_scene

CAMERAS = [Camera(), Camera(resolution=64, focal_length=20.0, height=40.0)]


def test_camera_is_table_ii():
    camera = load_scene("paper-code").camera
    assert math.degrees(camera.full_fov) == pytest.approx(6.8673, abs=5e-5)
    assert camera.pixel_pitch * 5000 == pytest.approx(13.2)
    assert camera.pixel_pitch == pytest.approx(2.64e-3)


def test_the_pole_is_the_image_centre_and_y_runs_down():
    camera = Camera(resolution=1000)
    np.testing.assert_allclose(camera.project([0.0, 0.0, 0.0]), [500.0, 500.0])
    x, y = camera.project([1.0, 2.0, 0.0])
    assert x > 500.0 > y


@given(st.sampled_from(CAMERAS), st.floats(-1.0, 2.0), st.floats(-1.0, 2.0), st.floats(0.1, 200.0))
def test_projecting_inverts_rays(camera, across, down, distance):
    """Pixels in the frame and as far again beyond it, points anywhere on their rays: to 1e-9 of the frame."""
    height, width = camera.shape
    pixel = np.array([across * width, down * height])
    ray = camera.rays(pixel)
    assert np.linalg.norm(ray.directions) == pytest.approx(1.0, abs=1e-15)
    found = camera.project(ray.origins + distance * ray.directions)
    np.testing.assert_allclose(found, pixel, rtol=0.0, atol=1e-9 * width)


@given(st.sampled_from(CAMERAS), st.floats(-50, 50), st.floats(-50, 50), st.floats(0, 60))
def test_a_point_beside_or_above_the_pinhole_is_not_seen(camera, x, y, above):
    assert np.all(np.isnan(camera.project([x, y, camera.height + above])))


@pytest.mark.parametrize("camera", CAMERAS)
def test_rays_change_from_pixel_to_pixel_as_their_derivatives_say(camera):
    """Central differences over 0.02 px, whose own error is rounding: 1e-12 of a ray, 1e-7 of the derivative."""
    height, width = camera.shape
    pixels = np.random.default_rng(0).uniform([0, 0], [width, height], (50, 2))
    rays = camera.rays(pixels)
    for axis, name in ((0, "x"), (1, "y")):
        step = 0.01 * np.eye(2)[axis]
        more, less = camera.rays(pixels + step), camera.rays(pixels - step)
        for part in ("origins", "directions"):
            change, ahead, behind = getattr(rays, f"{part}_by_{name}"), getattr(more, part), getattr(less, part)
            slack = 1e-13 + 1e-7 * np.abs(change).max()
            np.testing.assert_allclose(ahead - behind, 0.02 * change, rtol=0.0, atol=slack)


def test_rays_are_asked_for_in_any_shape():
    pixels = np.random.default_rng(0).uniform(0, 5000, (4, 7, 2))
    many = Camera().rays(pixels)
    assert many.directions.shape == many.directions_by_x.shape == (4, 7, 3)
    np.testing.assert_array_equal(many.directions[3, 5], Camera().rays(pixels[3, 5]).directions)
