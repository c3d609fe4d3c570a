"""Tips so near the wall that their patches are a few pixels wide: found, or refused for that."""

import numpy as np
import pytest

from conespot import locate
from conespot.localize.model.forward import light
from conespot.localize.model.profile import Profile
from conespot.localize.model.sight import look, window
from conespot.localize.outcome import FEW_PIXELS
from conespot.scene import Pose
from conespot.scene.beam import HardBeam
from conespot.scene.camera import Camera
from conespot.scene.scene import Scene
from conespot.scene.sensor import Linear


@pytest.fixture(scope="module")
def sees_the_wall():
    """A camera of 1500 px that clips a tip's light near the wall, and what it shows of one so far away [mm]."""
    scene = Scene(beam=HardBeam(), camera=Camera(resolution=1500), sensor=Linear(bits=12, white=1.0))

    def shown(distance, *, hot=0):
        pixels = np.full((1500, 1500), 0.01)
        pose = None
        if distance:
            axis = Pose.through((1.0, 0.5, 1.0), scene.instrument.rcm).axis
            wall = np.array([1.0, 0.5, 1.0]) + float(scene.eye.intersect(np.array([1.0, 0.5, 1.0]), axis)) * axis
            pose = Pose.through(wall - distance * axis, scene.instrument.rcm)
            low = scene.camera.project(scene.outline(pose, 0)).min(axis=0).astype(int) - 4
            sight = look(scene, window(low[1], low[0], 40, 40))
            lit = light(sight, pose, scene, Profile.of(scene.beam)).value.reshape(40, 40)
            pixels[low[1] : low[1] + 40, low[0] : low[0] + 40] += 300.0 * lit / lit.max()
        rng = np.random.default_rng(4)
        pixels += rng.normal(0.0, 0.002, pixels.shape)
        pixels[rng.integers(0, 1500, hot), rng.integers(0, 1500, hot)] = 1.0
        return np.clip(np.rint(4095.0 * pixels), 0, 4095).astype(np.uint16), pose

    return scene, shown


def test_a_tip_so_near_the_wall_that_rings_are_too_wide_is_found(sees_the_wall):
    scene, shown = sees_the_wall
    image, pose = shown(0.3, hot=30)
    found = locate(image, scene, "cone")
    assert found, found.reason
    off = found.apex_mm - pose.apex
    assert np.linalg.norm(off) < 0.02
    assert off @ np.linalg.solve(found.covariance[:3, :3], off) < 16.3  # chi-squared of three: once in a thousand


def test_a_patch_of_a_few_pixels_is_refused_for_what_it_is(sees_the_wall):
    scene, shown = sees_the_wall
    assert locate(shown(0.15)[0], scene, "cone").reason == FEW_PIXELS


@pytest.mark.slow
def test_hot_pixels_are_no_patch(sees_the_wall):
    scene, shown = sees_the_wall
    assert not locate(shown(None, hot=200)[0], scene, "cone")
