"""The camera's rays against those that Mitsuba's own sensor casts, and those that the renderer makes."""

import numpy as np
import pytest

from conespot.render import kernel
from conespot.render.rays import RayGenerator
from conespot.render.stage import Stage
from conespot.scene import Camera, Scene
from conespot.scene.retina import UniformRetina


@pytest.mark.parametrize("camera", [Camera(resolution=1000), Camera(resolution=64, focal_length=40.0, height=60.0)])
def test_rays_are_those_of_mitsubas_perspective_sensor(camera):
    """All pixel centres of the border and of a diagonal; directions to single precision, origins on the rays.

    Mitsuba's begin at its near plane: their distance from the camera's rays is 1e-5 mm or less.
    """
    scene = Scene(camera=camera, retina=UniformRetina())
    stage = Stage(scene, {"type": "constant"}, scene.illumination, samples=1, shapes={})
    mi, _, _ = kernel.load()
    sensor = stage._scenes[0].sensors()[0]
    ticks = np.arange(0, camera.resolution, camera.resolution // 32)
    pixels = np.concatenate([[(k, 0), (0, k), (camera.resolution - 1, k), (k, k)] for k in ticks]) + 0.5
    # the film's crop is one pixel, in units of which the sensor takes a place
    cast = [sensor.sample_ray(0.0, 0.5, mi.Point2f(x, y), mi.Point2f(0.5))[0] for x, y in pixels.tolist()]
    origins, directions = (
        np.array([np.ravel(part) for part in parts]) for parts in ([r.o for r in cast], [r.d for r in cast])
    )
    rays = camera.rays(pixels)
    np.testing.assert_allclose(directions, rays.directions, rtol=0.0, atol=2e-7)
    offset = origins - rays.origins
    along = np.sum(offset * rays.directions, axis=1, keepdims=True)
    assert np.abs(offset - along * rays.directions).max() < 1e-5


@pytest.mark.parametrize("camera", [Camera(), Camera(resolution=64, focal_length=40.0, height=60.0)])
def test_the_renderers_own_rays_are_the_cameras(camera):
    """Film positions all over the frame: directions to single precision, 2e-7, and origins on the rays to 1e-5 mm."""
    mi, dr, kernel_in_use = kernel.load()
    if not kernel_in_use.vectorized:
        pytest.skip("the scalar variant has Mitsuba's own sensor")
    pixels = np.random.default_rng(0).uniform(0.0, camera.shape[::-1], (1000, 2)).astype(np.float32).astype(float)
    cast, _ = RayGenerator(camera, 90.0).rays(*(mi.Float(part) for part in pixels.T), dr.zeros(mi.Spectrum))
    rays = camera.rays(pixels)
    np.testing.assert_allclose(np.array(cast.d).T, rays.directions, rtol=0.0, atol=2e-7)
    offset = np.array(cast.o).T - rays.origins
    along = np.sum(offset * rays.directions, axis=1, keepdims=True)
    assert np.abs(offset - along * rays.directions).max() < 1e-5
    np.testing.assert_allclose(np.array(cast.o).T[:, 2], camera.height - 90.0, atol=1e-4)
