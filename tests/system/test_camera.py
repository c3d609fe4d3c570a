"""The camera's rays against those that Mitsuba's own sensor casts."""

import numpy as np
import pytest

from conespot.render import kernel
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
