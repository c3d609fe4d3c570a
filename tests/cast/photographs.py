"""Frames cast ray by ray with scene's geometry only: texture, ambient light, a noisy sensor."""

from functools import lru_cache

import cv2
import numpy as np

from conespot.localize import SensorNoise
from conespot.scene.beam import HardBeam
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
    rays = scene.camera.rays(np.stack(np.meshgrid(x, y), axis=-1))
    return scene.surface.intersect(scene.eye, rays.origins, rays.directions)


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
    size = np.array(scene.camera.shape[::-1])
    k = rays or (16 if isinstance(scene.beam, HardBeam) else 4)
    plain = scene.model_copy(update={"surface": Scene().surface})
    wall = cast(plain, np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    electrons = np.nan_to_num(AMBIENT * albedo(texture, wall) * upward(scene, wall))  # black behind an iris
    outlines = [scene.camera.project(scene.outline(pose, i)) for i in range(len(scene.spotlights))]
    every = np.concatenate(outlines)
    low = np.floor(np.nanmin(every, axis=0)).astype(int).clip(2) - 2
    high = np.ceil(np.nanmax(every, axis=0)).astype(int).clip(0, size - 2) + 2
    patch = []
    for row in range(low[1], high[1]):
        x = low[0] + (np.arange((high[0] - low[0]) * k) + 0.5) / k
        points = cast(scene, x, row + (np.arange(k) + 0.5) / k)
        a = albedo(texture, points)
        both = np.stack([a * upward(scene, points), a * spotlight(scene, pose, points)])
        patch.append(np.nan_to_num(both).reshape(2, k, -1, k).mean(axis=(1, 3)))
    ambient, light = np.stack(patch, axis=1)
    region = electrons[low[1] : high[1], low[0] : high[0]]
    region[:] = AMBIENT * ambient + PEAK * light / np.quantile(light, 0.998)
    if noise:
        electrons = rng.poisson(electrons) + READ * rng.standard_normal(electrons.shape)
    return np.clip(np.round(electrons / WHITE * 4095.0), 0, 4095).astype(np.uint16)
