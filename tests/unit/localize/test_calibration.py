"""Calibration on frames cast ray by ray with scene's geometry only."""

import math
from functools import lru_cache

import cv2
import numpy as np
import pytest

from conespot.localize import SensorNoise
from conespot.localize.calibration import NAMES, calibrate
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.camera import Camera
from conespot.scene.scene import Scene
from conespot.scene.sensor import Linear
from conespot.scene.spotlights import spotlight_axes

PEAK, AMBIENT, READ = 9000.0, 200.0, 15.0


WHITE = 1.25 * PEAK


NOISE = SensorNoise(levels=4095, electrons=WHITE, read=READ)


def scene_of(beam, spotlights="single", resolution=1000, **more):
    return Scene(beam=beam, spotlights=spotlights, camera=Camera(resolution=resolution), sensor=Linear(bits=12), **more)


@lru_cache
def fundus(contrast, seed=1):
    """A log albedo with a fundus' spectrum, as a map over 14 x 14 mm; rms `contrast`."""
    rng = np.random.default_rng(seed)
    n = 1400
    k = np.hypot(np.fft.fftfreq(n, 0.01)[:, None], np.fft.rfftfreq(n, 0.01))
    k[0, 0] = np.inf
    field = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((n, n))) * k**-1.3 / (1.0 + (k / 8.0) ** 2), (n, n))
    return np.exp(contrast * field / field.std()).astype(np.float32)


def albedo(texture, points):
    if texture is None:
        return np.ones(points.shape[:-1])
    u = (points[..., 0] / 0.01 + 700.0).astype(np.float32)
    v = (700.0 - points[..., 1] / 0.01).astype(np.float32)
    return cv2.remap(texture, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def cast(scene, x, y):
    rays = scene.camera.rays(np.stack(np.meshgrid(x, y), axis=-1)).directions
    return scene.surface.intersect(scene.eye, scene.camera.centre, rays)


def upward(scene, points):
    """Cosine of incidence of the microscope's light."""
    return (scene.eye.radius - points[..., 2]) / scene.eye.radius


def spotlight(scene, pose, points):
    outward = points - scene.eye.centre
    normals = scene.surface.normals(scene.eye, outward / np.linalg.norm(outward, axis=-1, keepdims=True))
    to = points - pose.apex
    d = np.linalg.norm(to, axis=-1)
    profile = sum(scene.beam.intensity(to @ axis / d) for axis in spotlight_axes(pose, scene.spotlights))
    return profile * -np.sum(normals * to, axis=-1) / d**3


def photograph(scene, pose, texture=None, seed=0, rays=None, noise=True):
    """A 12-bit frame: 9000 e- where the patch is brightest, 200 e- of ambient light, 15 e- of read noise."""
    rng = np.random.default_rng(seed)
    side = scene.camera.resolution
    k = rays or (16 if isinstance(scene.beam, HardBeam) else 4)
    centres = np.arange(side) + 0.5
    plain = scene.model_copy(update={"surface": Scene().surface})
    wall = cast(plain, centres, centres)
    electrons = AMBIENT * albedo(texture, wall) * upward(scene, wall)
    outlines = [scene.camera.project(scene.outline(pose, i)) for i in range(len(scene.spotlights))]
    every = np.concatenate(outlines)
    low = np.floor(np.nanmin(every, axis=0)).astype(int).clip(2) - 2
    high = np.ceil(np.nanmax(every, axis=0)).astype(int).clip(0, side - 2) + 2
    patch = []
    for row in range(low[1], high[1]):
        x = low[0] + (np.arange((high[0] - low[0]) * k) + 0.5) / k
        points = cast(scene, x, row + (np.arange(k) + 0.5) / k)
        a = albedo(texture, points)
        both = np.stack([a * upward(scene, points), a * spotlight(scene, pose, points)])
        patch.append(both.reshape(2, k, -1, k).mean(axis=(1, 3)))
    ambient, light = np.stack(patch, axis=1)
    region = electrons[low[1] : high[1], low[0] : high[0]]
    region[:] = AMBIENT * ambient + PEAK * light / np.quantile(light, 0.998)
    if noise:
        electrons = rng.poisson(electrons) + READ * rng.standard_normal(electrons.shape)
    return np.clip(np.round(electrons / WHITE * 4095.0), 0, 4095).astype(np.uint16)


def test_calibration_finds_the_half_angle_of_a_rig_and_says_that_the_size_of_the_scene_is_hidden():
    true = scene_of(HardBeam(half_angle=math.radians(9.03)), "triple")
    believed = scene_of(HardBeam(), "triple")
    poses = [true.pose(np.array([1.5 * math.sin(t), 1.5 * math.cos(t), 3.0 + 0.3 * t])) for t in range(4)]
    frames = [photograph(true, pose, seed=i, rays=6) for i, pose in enumerate(poses)]
    found = calibrate(lambda: frames, believed, noise=NOISE)
    assert math.degrees(found.values[0]) == pytest.approx(9.03, abs=2e-3)
    assert found.observable["half_angle"]
    assert not found.observable["camera_height"]
    assert "camera_height: not observable" in found.statement()


def test_calibration_finds_the_softness_of_the_edge_over_a_texture_and_states_an_honest_sigma():
    """A blend of 0.3 believed to be 0.35, eight frames over a fundus' texture; within 4 sigmas, and to 0.02."""
    true = scene_of(CyclesBeam(blend=0.3))
    believed = scene_of(CyclesBeam(blend=0.35))
    poses = [true.pose(np.array([2.0 * math.sin(t), 2.0 * math.cos(t), 2.5 + 0.4 * t])) for t in range(8)]
    frames = [photograph(true, pose, fundus(0.2), seed=i) for i, pose in enumerate(poses)]
    found = calibrate(lambda: frames, believed, noise=NOISE)
    softness = NAMES.index("softness")
    assert found.observable["softness"]
    assert found.values[softness] == pytest.approx(0.3, abs=0.02)
    assert abs(found.values[softness] - 0.3) < 4.0 * found.sigmas[softness]
    assert found.applied(believed).beam.blend == pytest.approx(found.values[softness])


def test_one_spotlight_tells_neither_half_angle_nor_camera_height_and_says_so():
    """Half angle, height and RCM are off; what is not observable keeps a wide sigma and stays as it was."""
    true = scene_of(HardBeam(half_angle=math.radians(9.03)), instrument={"rcm": (6.05, -0.04, 22.1)})
    believed = scene_of(HardBeam())
    poses = [true.pose(np.array([2.0 * math.sin(t), 2.0 * math.cos(t), 2.5 + 0.4 * t])) for t in range(6)]
    frames = [photograph(true, pose, seed=i, rays=6) for i, pose in enumerate(poses)]
    found = calibrate(lambda: frames, believed, noise=NOISE)
    truth = np.array([math.radians(9.03), 0.0, 12.0, 110.0, 6.05, -0.04, 22.1])
    assert np.all(np.abs(found.values - truth) < 4.0 * found.sigmas)
    assert not found.observable["half_angle"]
    assert not found.observable["camera_height"]
    assert found.applied(believed).camera == believed.camera
    assert "softness" not in found.statement()
