"""Calibration on frames cast ray by ray with scene's geometry only."""

import math

import numpy as np
import pytest
from moving import MovingNeedle
from photographs import NOISE, fundus, photograph, scene_of

from conespot.localize import Knowns, locate
from conespot.localize.blur import shared_blur
from conespot.localize.calibration import NAMES, Calibration, Width, calibrate
from conespot.localize.model.quantity import quantity
from conespot.scene.beam import CyclesBeam, HardBeam


@pytest.mark.slow
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


@pytest.mark.slow
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
    truth = np.array([math.radians(9.03), 0.0, 12.0, 110.0, 12.0, 12.0, 12.0, 0.0, 0.0, 6.05, -0.04, 22.1])
    assert np.all(np.abs(found.values - truth) < 4.0 * found.sigmas)
    assert not found.observable["half_angle"]
    assert not found.observable["camera_height"]
    assert found.applied(believed).camera == believed.camera
    assert "softness" not in found.statement()


def test_a_microscope_that_leans_is_found_and_an_answer_that_knows_it_may_lean_holds_its_tip():
    """One degree, told none, on frames of one spotlight, of whose half angle nothing false is claimed."""
    told = scene_of(HardBeam(), resolution=400)
    true = told.model_copy(
        update={"camera": told.camera.model_copy(update={"tilt": math.radians(1.0), "azimuth": 0.5})}
    )
    poses = [true.pose(np.array([2.5 * math.sin(1.7 * t), 2.5 * math.cos(1.7 * t), 2.5 + 0.4 * t])) for t in range(6)]
    frames = [photograph(true, pose, seed=i, rays=8) for i, pose in enumerate(poses)]
    found = calibrate(lambda: frames, told, width=Width(camera_tilt_deg=2.0), noise=NOISE)
    camera = found.applied(told).camera
    for name, value in (("camera_tilt_x", math.cos(0.5)), ("camera_tilt_y", math.sin(0.5))):
        at = NAMES.index(name)
        assert found.observable[name]
        assert abs(found.values[at] - math.radians(value)) < 3.0 * found.sigmas[at]
        assert quantity(name).read(told.model_copy(update={"camera": camera})) == pytest.approx(found.values[at])
    assert abs(found.values[0] - math.radians(9.0)) < 4.0 * found.sigmas[0]
    sure, unsure = (
        locate(frames[1], told, "cone", noise=NOISE, knowns=Knowns(camera_tilt_sigma_deg=sigma)) for sigma in (0.0, 1.0)
    )
    off = [one.apex_mm - poses[1].apex for one in (sure, unsure)]
    squares = [o @ np.linalg.solve(one.covariance[:3, :3], o) for o, one in zip(off, (sure, unsure), strict=True)]
    assert squares[0] > 100.0
    assert squares[1] < 16.0


@pytest.mark.parametrize("blur_mm", [0.0, 0.06])
def test_a_sequence_shows_the_lens_blur_that_its_scene_does_not_tell_and_claims_none_where_there_is_none(blur_mm):
    needle = MovingNeedle(300, exposure_s=0.0, blur_mm=blur_mm)
    sharp = needle.scene.model_copy(update={"camera": needle.scene.camera.model_copy(update={"lens": None})})
    found = shared_blur([needle.frame(0.3 * k) for k in range(3)], sharp)
    assert found.observable == (blur_mm > 0.0)
    assert abs(found.variance - blur_mm**2) < 3.0 * found.sigma
    assert quantity("blur").value(found.applied(sharp)) == pytest.approx(found.variance if blur_mm else 0.0)
    assert ("not observable" in found.statement()) == (blur_mm == 0.0)


def test_quantities_that_a_sequence_confounds_are_said_and_those_that_it_does_not_show_are_not():
    covariance = np.diag(np.square([1e-3, 1e-9, 0.01, 0.1, 1e-9, 1e-9, 1e-9, 1e-9, 1e-9, 0.01, 0.01, 0.02]))
    covariance[0, 2] = covariance[2, 0] = -0.9 * 1e-3 * 0.01
    covariance[0, 3] = covariance[3, 0] = 0.8 * 1e-3 * 0.1
    shown = {name: name != "camera_height" for name in NAMES}
    found = Calibration(np.zeros(12), covariance, shown, 5, np.ones(12))
    assert found.correlations() == "half_angle and eye_radius: correlation -0.90"
