"""What the error budget says of bumps and sensors."""

import math

import numpy as np
import pytest

from conespot.localize.model.knowns import Knowns
from conespot.localize.model.outline import fit_outline
from conespot.localize.theory.assessment import electrons_of, tied
from conespot.localize.theory.bounds import Electrons, cramer_rao, smoothed_over
from conespot.scene.camera import Camera
from conespot.scene.emva import Emva
from conespot.scene.scene import Scene
from conespot.scene.sensor import Linear
from conespot.scene.surface import SURFACES

TIP = np.array([0.0, 0.0, 6.0])  # its outline crosses a bump


def test_a_smooth_surface_taken_for_smooth_moves_nothing():
    scene = Scene()
    assert np.abs(smoothed_over(scene, scene.pose(TIP), rcm=False)).max() < 1e-9


def test_the_step_off_the_truth_is_where_a_whole_fit_of_the_bumpy_outline_ends():
    bumpy = Scene(surface=SURFACES["bumps-literal"], camera=Camera(resolution=1000))
    pose = bumpy.pose(TIP)
    pixels = bumpy.camera.project(bumpy.outline(pose, 0, 256))
    fit = fit_outline(pixels, Scene(camera=bumpy.camera), knowns=Knowns(rcm_sigma_mm=None), start=pose, robust=False)
    step = smoothed_over(bumpy, pose, rcm=False)
    assert np.linalg.norm(step[:3]) > 0.02
    np.testing.assert_allclose(fit.estimate.pose.apex - pose.apex, step[:3], atol=0.1 * np.linalg.norm(step[:3]))


def test_a_camera_is_metered_as_it_says_and_any_other_sensor_stands_for_9000_electrons():
    assert electrons_of(Scene(sensor=Linear())) == Electrons()
    camera = Emva(full_well=10000.0, gain=0.3, read_noise=12.0)
    found = electrons_of(Scene(sensor=camera))
    assert found.peak == pytest.approx(8000.0)
    assert found.background == pytest.approx(math.sqrt(144.0 + 1.0 / (12.0 * 0.09)))


@pytest.mark.parametrize("sigma", [None, 0.05, 0.0])
def test_knowing_the_rcm_afterwards_is_knowing_it_from_the_start(sigma):
    scene = Scene(camera=Camera(resolution=500))
    pose = scene.pose(TIP)
    after = tied(cramer_rao(scene, pose), scene, pose, sigma)
    before = cramer_rao(scene, pose, knowns=Knowns(rcm_sigma_mm=sigma))
    assert after.position_mm == pytest.approx(before.position_mm, rel=1e-3)
    assert after.axis_rad == pytest.approx(before.axis_rad, rel=1e-3)
