"""Where the localizers expect the shaft and its shadow, against where Mitsuba renders them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from conespot.localize.model.forward import moved
from conespot.localize.model.occlusion import covered
from conespot.localize.model.sight import window
from conespot.render import Renderer
from conespot.scene import Camera, Scene
from conespot.scene.illumination import Ambient
from conespot.scene.retina import UniformRetina
from conespot.scene.spotlights import Instrument, Shaft
from conespot.scene.surface import Surface

SIDE = 300
TIPS = {"beside the middle": [3.0, 1.0, 4.0], "low": [-2.0, -1.5, 1.0]}
LIGHTS = {"from the camera": (0.0, 0.0), "from the side": (20.0, 100.0), "along the shaft": (15.0, 0.0)}


def scene_of(tilt, azimuth, **parts):
    ambient = Ambient(irradiance=2.0, tilt=math.radians(tilt), azimuth=math.radians(azimuth))
    instrument = Instrument(shaft=Shaft(length=12.0, albedo=0.0))
    given = {"camera": Camera(resolution=SIDE), "retina": UniformRetina(), "instrument": instrument}
    return Scene(ambient=ambient, **given, **parts)


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize("tip", TIPS)
def test_every_pixel_the_shaft_or_its_shadow_changes_is_covered_and_hardly_another(light, tip):
    scene = scene_of(*LIGHTS[light])
    pose = scene.pose(np.array(TIPS[tip]))
    renderer = Renderer(scene, samples=32)
    change = np.abs(renderer.background(pose) / renderer.background() - 1.0)[..., 0]
    pixels = window(0, 0, SIDE, SIDE)
    mask = covered(pixels, pose, scene, slack=0.0).reshape(SIDE, SIDE)
    assert (change > 0.5).sum() > 500
    assert not np.any((change > 0.01) & ~mask)
    # all of it black but for a rim of 1.3 pixels
    inside = covered(pixels, pose, scene, slack=-0.1).reshape(SIDE, SIDE)
    assert change[inside].min() > 0.9
    assert inside.sum() > 0.5 * mask.sum()


def test_slack_covers_a_shaft_that_is_a_little_elsewhere():
    scene = scene_of(20.0, 100.0, surface=Surface(semi_axes=(1.0, 1.0, 1.1)))
    pose = scene.pose(np.array([1.0, 0.5, 3.0]))
    pixels = window(0, 0, SIDE, SIDE)
    true = covered(pixels, pose, scene, slack=0.0)
    for step in np.vstack([0.04 * np.eye(3), -0.04 * np.eye(3)]):
        there = moved(pose, np.array([*step, 0.0, 0.0]))
        assert not np.any(true & ~covered(pixels, there, scene, slack=0.05))
    assert true.sum() < covered(pixels, pose, scene).sum() < 1.5 * true.sum()


def test_without_a_shaft_nothing_is_covered():
    scene = Scene(camera=Camera(resolution=50))
    assert not covered(window(0, 0, 50, 50), scene.pose(np.array([0.0, 0.0, 4.0])), scene).any()


def test_a_bin_counts_as_soon_as_any_of_its_pixels_does():
    scene = scene_of(20.0, 100.0)
    pose = scene.pose(np.array([1.0, 0.5, 3.0]))
    fine = covered(window(0, 0, SIDE, SIDE), pose, scene, slack=0.0).reshape(SIDE // 3, 3, SIDE // 3, 3)
    coarse = covered(window(0, 0, SIDE // 3, SIDE // 3, 3), pose, scene, side=3.0, slack=0.0)
    assert not np.any(fine.mean(axis=(1, 3)).ravel()[~coarse])
    assert fine.mean() < coarse.mean() < 2.0 * fine.mean()
