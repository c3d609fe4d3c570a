"""Frames of a camera as a microscope has it: oblong, aslant, off centre and distorted."""

import math
import os
import subprocess
import sys

import cv2
import numpy as np
import pytest

from conespot.render import Renderer, kernel
from conespot.render.rays import RayGenerator
from conespot.scene import Camera, Scene
from conespot.scene.beam import HardBeam
from conespot.scene.distortion import Distortion
from conespot.scene.eye import Globe
from conespot.scene.retina import UniformRetina
from conespot.scene.spotlights import spotlight_axes

REAL = Camera(
    resolution=(480, 270),
    pixel_aspect=1.05,
    principal_point=(250.0, 128.0),
    distortion=Distortion(k1=-20.0, k2=800.0, p1=0.2, p2=-0.3),
    tilt=math.radians(5.0),
    azimuth=math.radians(30.0),
    roll=math.radians(20.0),
    look_at=(0.3, -0.2, 0.0),
)
needs_jit = pytest.mark.skipif(
    not kernel.load()[2].vectorized, reason="the scalar variant has Mitsuba's own sensor, which is a plain pinhole"
)


@needs_jit
@pytest.mark.parametrize("lens", [REAL.distortion, Distortion(k1=-80.0, k2=12000.0)])
def test_the_renderers_rays_are_those_of_a_real_camera(lens):
    """Film positions all over the frame, through an ordinary and a wild lens: projected back, to 0.01 px."""
    mi, dr, _ = kernel.load()
    camera = REAL.model_copy(update={"distortion": lens})
    pixels = np.random.default_rng(0).uniform(0.0, camera.shape[::-1], (1000, 2)).astype(np.float32).astype(float)
    cast, _ = RayGenerator(camera, 90.0).rays(*(mi.Float(part) for part in pixels.T), dr.zeros(mi.Spectrum))
    rays = camera.rays(pixels)
    np.testing.assert_allclose(np.array(cast.d).T, rays.directions, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(camera.project(np.array(cast.o).T.astype(float)), pixels, rtol=0.0, atol=0.01)


def chords(outline, lines, axis):
    """How long the lines of pixels are within a convex outline `[N, 2]` [px]: means of 16 chords across each."""
    along, across = outline[:, 1 - axis], outline[:, axis]
    at = lines[:, None] + (np.arange(16) - 7.5) / 16.0
    ends = []
    for line in at.ravel():
        k = np.flatnonzero((across > line) != (np.roll(across, -1) > line))
        share = (line - across[k]) / (np.roll(across, -1)[k] - across[k])
        ends.append(np.ptp(along[k] + share * (np.roll(along, -1)[k] - along[k])) if len(k) else 0.0)
    return np.reshape(ends, at.shape).mean(axis=1)


@needs_jit
@pytest.mark.parametrize(
    "interreflection", [None, pytest.param(Globe(bounces=1), marks=pytest.mark.slow)], ids=["direct", "path"]
)
def test_the_edge_of_a_patch_lies_where_the_closed_forms_outline_is_projected(interreflection):
    """A hard beam on a nearly black retina, its radiance over the closed form's: rows and columns against the outline.

    The chords of 64 samples a pixel are off by 0.06 px in the root mean square at most, and by 0.02 px in the mean.
    """
    scene = Scene(camera=REAL, beam=HardBeam(), retina=UniformRetina(albedo=0.001), interreflection=interreflection)
    pose = scene.pose(np.array([0.8, 0.4, 4.0]))
    tile = Renderer(scene, samples=64, noise=0.0).tile(pose, 0, seed=1)
    y, x = (np.arange(s.start, s.stop) + 0.5 for s in tile.crop.slices)
    rays = scene.camera.rays(np.stack(np.meshgrid(x, y), axis=-1))
    points = scene.surface.intersect(scene.eye, rays.origins, rays.directions)
    to = points - pose.apex
    distance = np.linalg.norm(to, axis=-1)
    cosine = np.sum(to * (points - scene.eye.centre), axis=-1) / distance / scene.eye.radius
    expected = 0.001 / math.pi * cosine / (4.0 * math.pi * (1e-3 * distance) ** 2)
    inside = to @ spotlight_axes(pose, scene.spotlights)[0] / distance > math.cos(scene.beam.half_angle)
    seen = tile.radiance[..., 0] / expected
    outline = scene.camera.project(scene.outline(pose, 0, 2000))
    inside = inside.astype(np.uint8)
    assert np.count_nonzero(inside) > 1500
    np.testing.assert_allclose(seen[cv2.erode(inside, np.ones((3, 3))) == 1], 1.0, atol=2e-3)
    assert seen[cv2.dilate(inside, np.ones((3, 3))) == 0].max() < 2e-3
    for axis, lines in enumerate((x, y)):
        off = seen.sum(axis=axis) - chords(outline, lines, axis)
        assert math.sqrt(np.mean(off**2)) < 0.06
        assert abs(np.mean(off)) < 0.02


def test_without_a_jit_variant_a_camera_that_is_no_plain_pinhole_is_refused_in_a_sentence():
    """The scalar variant in a process of its own: an oblong frame straight from above renders, one aslant does not."""
    code = """
from conespot.render import Renderer
from conespot.scene import Camera, Scene
from conespot.scene.retina import UniformRetina
for camera in (Camera(resolution=(32, 16)), Camera(resolution=32, tilt=0.1)):
    print(Renderer(Scene(camera=camera, retina=UniformRetina()), samples=1).background().shape)
"""
    environment = {**os.environ, "CONESPOT_VARIANT": "scalar_spectral", "CONESPOT_CACHE": "off"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=300)
    assert done.stdout == "(16, 32, 1)\n"
    assert done.stderr.splitlines()[-1].startswith("conespot.render.kernel.KernelError: a camera that is aslant")
