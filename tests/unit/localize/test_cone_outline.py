"""The exact cone-surface curve: from points on it to the pose, without an image."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from conespot.localize.model.knowns import Knowns
from conespot.localize.model.outline import fit_outline
from conespot.scene.beam import HardBeam
from conespot.scene.camera import Camera
from conespot.scene.scene import Scene
from conespot.scene.spotlights import RIGS

FREE = Knowns(rcm_sigma_mm=None)


def outline(scene, pose, points=200):
    return np.concatenate([scene.camera.project(scene.outline(pose, k, points)) for k in range(len(scene.spotlights))])


@settings(max_examples=150, deadline=None)
@given(
    x=st.floats(-5.0, 5.0),
    y=st.floats(-5.0, 5.0),
    z=st.floats(0.3, 9.0),
    half_angle=st.floats(5.0, 15.0),
    port=st.floats(0.0, 360.0),
    radius=st.floats(11.0, 12.5),
)
def test_a_noise_free_outline_gives_the_tip_to_a_nanometre_anywhere_in_the_volume(x, y, z, half_angle, port, radius):
    rcm = (6.0 * math.cos(math.radians(port)), 6.0 * math.sin(math.radians(port)), 22.0)
    scene = Scene(
        eye={"radius": radius},
        camera=Camera(resolution=1000),
        instrument={"rcm": rcm},
        beam=HardBeam(half_angle=math.radians(half_angle)),
    )
    apex = np.array([x, y, z])
    assume(scene.depth(apex) > 0.3)
    pose = scene.pose(apex)
    fit = fit_outline(outline(scene, pose), scene, knowns=FREE)
    assert fit is not None
    assert np.linalg.norm(fit.estimate.pose.apex - apex) < 1e-6
    assert np.arccos(min(1.0, fit.estimate.pose.axis @ pose.axis)) < 1e-6


@pytest.mark.parametrize("kind", ["single", "triple"])
def test_half_an_outline_is_enough_without_noise(kind):
    scene = Scene(spotlights=RIGS[kind], beam=HardBeam())
    pose = scene.pose(np.array([1.0, -1.5, 4.0]))
    points = outline(scene, pose)
    spots = np.repeat(np.arange(len(scene.spotlights)), 200)
    kept = points[:, 0] > np.median(points[:, 0])
    fit = fit_outline(points[kept], scene, spots=spots[kept], knowns=FREE, start=pose_near(pose))
    assert fit is not None
    assert np.linalg.norm(fit.estimate.pose.apex - pose.apex) < 1e-6


def pose_near(pose):
    from conespot.localize.model.forward import moved

    return moved(pose, np.array([0.03, -0.02, 0.04, 0.005, -0.004]))


def test_three_outlines_tell_the_roll():
    from conespot.localize.model.forward import moved

    scene = Scene(spotlights=RIGS["triple"], beam=HardBeam())
    straight = scene.pose(np.array([-1.0, 0.5, 3.5]))
    rolled = moved(straight, np.array([0.0, 0.0, 0.0, 0.0, 0.0, math.radians(7.0)]))
    spots = np.repeat(np.arange(3), 200)
    fit = fit_outline(outline(scene, rolled), scene, spots=spots, knowns=FREE, start=straight)
    assert fit is not None
    assert fit.estimate.pose.roll == pytest.approx(rolled.roll, abs=1e-8)
    np.testing.assert_allclose(fit.estimate.pose.rotation(), rolled.rotation(), atol=1e-8)


def test_a_free_half_angle_is_found_from_three_outlines():
    true = Scene(spotlights=RIGS["triple"], beam=HardBeam(half_angle=math.radians(9.05)))
    believed = Scene(spotlights=RIGS["triple"], beam=HardBeam(half_angle=math.radians(9.0)))
    pose = true.pose(np.array([0.5, 1.0, 3.0]))
    knowns = Knowns(rcm_sigma_mm=None, half_angle_sigma_deg=None)
    spots = np.repeat(np.arange(3), 200)
    fit = fit_outline(outline(true, pose), believed, spots=spots, knowns=knowns, start=pose, robust=False)
    assert fit is not None
    assert math.degrees(fit.estimate.scene.beam.half_angle) == pytest.approx(9.05, abs=1e-6)


def test_wild_points_on_a_vessel_do_not_pull_the_cone():
    scene = Scene(beam=HardBeam())
    pose = scene.pose(np.array([1.0, 0.0, 4.0]))
    rng = np.random.default_rng(3)
    points = outline(scene, pose) + rng.normal(0.0, 0.1, (200, 2))
    points[40:50] += 12.0
    fit = fit_outline(points, scene, sigma=0.1)
    assert fit is not None
    assert np.linalg.norm(fit.estimate.pose.apex - pose.apex) < 3e-3
