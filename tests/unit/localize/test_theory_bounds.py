"""Bounds and sensitivities against the published table and a prototype's measurements."""

import math

import numpy as np
import pytest

from conespot.localize.model.knowns import Knowns
from conespot.localize.theory.bounds import cramer_rao, error_budget
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.camera import Camera
from conespot.scene.scene import Scene

LOW, HIGH = (0.0, 0.0, 3.0), (2.0, 0.0, 6.0)


def scene_of(resolution, hard):
    return Scene(beam=HardBeam() if hard else CyclesBeam(), camera=Camera(resolution=resolution))


@pytest.mark.parametrize(
    ("resolution", "hard", "apex", "position_um"),
    [
        (5000, True, LOW, 0.05),
        (5000, True, HIGH, 0.03),
        (5000, False, LOW, 0.56),
        (5000, False, HIGH, 0.50),
        (1000, True, LOW, 0.58),
        (1000, True, HIGH, 0.35),
        (1000, False, LOW, 2.8),
        (1000, False, HIGH, 2.5),
    ],
)
def test_the_bound_is_the_tabulated_one(resolution, hard, apex, position_um):
    scene = scene_of(resolution, hard)
    bound = cramer_rao(scene, scene.pose(np.array(apex)))
    assert bound.position_mm * 1e3 == pytest.approx(position_um, rel=0.1, abs=0.005)


@pytest.mark.parametrize(("apex", "axis_deg"), [(LOW, 0.055), (HIGH, 0.023)])
def test_the_bound_of_the_axis_is_the_tabulated_one(apex, axis_deg):
    scene = scene_of(1000, hard=False)
    assert math.degrees(cramer_rao(scene, scene.pose(np.array(apex))).axis_rad) == pytest.approx(axis_deg, rel=0.05)


@pytest.mark.parametrize(("hard", "low", "high"), [(True, 12.0, 20.0), (False, 9.0, 13.0)])
def test_an_exact_rcm_tightens_the_bound_tenfold(hard, low, high):
    scene = scene_of(1000, hard)
    pose = scene.pose(np.array(HIGH))
    free, tied = (cramer_rao(scene, pose, knowns=Knowns(s, blur_sigma_mm=0.0)).position_mm for s in (None, 0.0))
    assert low < free / tied < high


def test_the_bound_falls_as_the_prior_tightens_and_never_below_the_exact_one():
    scene = scene_of(1000, hard=False)
    pose = scene.pose(np.array(LOW))
    bounds = [cramer_rao(scene, pose, knowns=Knowns(rcm_sigma_mm=s)).position_mm for s in (None, 0.1, 0.01, 0.0)]
    assert bounds == sorted(bounds, reverse=True)


def test_a_free_half_angle_costs_position_but_not_direction():
    scene = scene_of(1000, hard=True)
    pose = scene.pose(np.array(LOW))
    fixed = cramer_rao(scene, pose)
    unsure = cramer_rao(scene, pose, knowns=Knowns(rcm_sigma_mm=None, half_angle_sigma_deg=0.001))
    added = math.sqrt(unsure.position_mm**2 - fixed.position_mm**2)
    assert added * 1e3 == pytest.approx(0.34, rel=0.1)
    assert unsure.axis_rad == pytest.approx(fixed.axis_rad, rel=0.05)


@pytest.mark.parametrize(
    ("height", "half_angle_um", "sideways_um", "along_um"), [(3.0, 3.4, 12.0, 4.0), (6.0, 6.7, 25.0, 9.5)]
)
def test_the_error_budget_has_the_measured_sensitivities(height, half_angle_um, sideways_um, along_um):
    scene = scene_of(1000, hard=False)
    pose = scene.pose(np.array([0.0, 0.0, height]))
    budget = {
        c.quantity: c for c in error_budget(scene, pose, rcm=True, tolerances={"rcm_sideways": 0.1, "rcm_along": 0.1})
    }
    assert budget["half_angle"].position_mm * 1e3 == pytest.approx(half_angle_um, rel=0.05)
    assert math.degrees(budget["half_angle"].axis_rad) < 1e-3
    assert budget["rcm_sideways"].position_mm * 1e3 == pytest.approx(sideways_um, rel=0.15)
    assert math.degrees(budget["rcm_sideways"].axis_rad) == pytest.approx(0.24, rel=0.1)
    assert budget["rcm_along"].position_mm * 1e3 == pytest.approx(along_um, rel=0.1)


def test_three_spotlights_bound_the_roll_too():
    scene = Scene(spotlights="triple", camera=Camera(resolution=500))
    bound = cramer_rao(scene, scene.pose(np.array(LOW)))
    assert bound.covariance.shape == (6, 6)
    assert (
        bound.position_mm
        < cramer_rao(scene.model_copy(update={"spotlights": Scene().spotlights}), scene.pose(np.array(LOW))).position_mm
    )


def test_a_quantity_nothing_holds_is_said_to_be_undetermined():
    scene = scene_of(300, hard=True)
    off_frame = scene.pose(np.array([0.0, 0.0, 3.0]))
    tiny = scene.model_copy(update={"camera": Camera(resolution=16, focal_length=30000.0)})
    with pytest.raises(ValueError, match="no patch"):
        cramer_rao(tiny, scene.pose(np.array([6.0, 0.0, 6.0])))
    assert cramer_rao(scene, off_frame).position_mm > 0.0
