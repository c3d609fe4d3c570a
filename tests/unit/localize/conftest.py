"""Frames of a noise-free uniform retina in closed form, pixel centre by pixel centre, for the localizers' tests."""

from types import SimpleNamespace

import numpy as np
import pytest

from conespot.scene import Scene, load_scene
from conespot.scene.camera import Camera
from conespot.scene.retina import UniformRetina
from conespot.scene.spotlights import RIGS, spotlight_axes


def make_scene(preset="paper-code-literal", *, resolution=1000, rig="single", **parts):
    scene = load_scene(preset)
    camera = Camera(resolution=resolution)
    return Scene(**{**dict(scene), "camera": camera, "spotlights": RIGS[rig], "retina": UniformRetina(), **parts})


def tiles(scene, pose):
    """Radiance at 1 W of every spotlight: (column, row) of the upper left pixel, and `[h, w]`."""
    return [_tile(scene, pose, axis, k) for k, axis in enumerate(spotlight_axes(pose, scene.spotlights))]


def _tile(scene, pose, axis, spotlight):
    side = scene.camera.resolution
    edge = scene.camera.project(scene.outline(pose, spotlight))
    low = np.clip(np.floor(edge.min(axis=0)).astype(int) - 8, 0, side)
    high = np.clip(np.ceil(edge.max(axis=0)).astype(int) + 8, 0, side)
    x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
    rays = scene.camera.rays(np.stack([x, y], axis=-1)).directions
    pinhole = scene.camera.centre
    wall = pinhole + scene.eye.intersect(pinhole, rays)[..., None] * rays
    light = wall - pose.apex
    square = np.sum(light * light, axis=-1)
    light /= np.sqrt(square)[..., None]
    cosine = np.sum(light * (wall - scene.eye.centre), axis=-1) / scene.eye.radius
    intensity = scene.beam.intensity(light @ axis) / (4.0 * np.pi)  # W/sr for 1 W, isotropic
    irradiance = intensity * np.maximum(cosine, 0.0) / square * 1e6  # W/m2: lengths are mm
    return low, scene.retina.albedo / np.pi * irradiance


def srgb8(radiance):
    lit = np.clip(radiance, 0.0, 1.0)
    curve = np.where(lit <= 0.0031308, 12.92 * lit, 1.055 * np.maximum(lit, 1e-12) ** (1.0 / 2.4) - 0.055)
    return np.round(255.0 * curve).astype(np.uint8)


def expose(scene, parts, power_w=1.0, background=0.0191):
    """The frame `[H, W]` uint8; a background of 0.0191 W/m2/sr is the authors' grey 37."""
    side = scene.camera.resolution
    low = np.min([corner for corner, _ in parts], axis=0)
    high = np.max([corner + tile.shape[::-1] for corner, tile in parts], axis=0)
    radiance = np.full((high[1] - low[1], high[0] - low[0]), background)
    for corner, tile in parts:
        column, row = corner - low
        radiance[row : row + tile.shape[0], column : column + tile.shape[1]] += power_w * tile
    image = np.full((side, side), srgb8(np.array(background)), np.uint8)
    image[low[1] : high[1], low[0] : high[0]] = srgb8(radiance)
    return image


def frame(scene, pose, power_w=1.0, background=0.0191):
    return expose(scene, tiles(scene, pose), power_w, background)


@pytest.fixture(scope="session")
def frames():
    """Scenes and their frames: `make_scene`, `tiles` at 1 W, `expose` of tiles, and `frame` for both at once."""
    return SimpleNamespace(make_scene=make_scene, tiles=tiles, expose=expose, frame=frame)
