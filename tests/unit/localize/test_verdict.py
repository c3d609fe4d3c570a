"""What contradicts the model is refused with its reason, and what does not comes with its covariance."""

import math

import numpy as np
import pytest

from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.solve import inverse
from conespot.localize.outcome import COVERED, UNCERTAIN, Localization
from conespot.localize.verdict import (
    BEHIND,
    MISFIT,
    MISSES_RCM,
    OUTSIDE,
    UNSETTLED,
    VERDICT,
    WRONG_BEAM,
    judged,
)
from conespot.scene import Pose
from conespot.scene.beam import HardBeam
from conespot.scene.document import Document
from conespot.scene.scene import Scene, read_scene
from conespot.scene.spotlights import RIGS

TIP = np.array([1.0, 0.5, 4.0])
SIGMAS = np.array([2e-3, 2e-3, 5e-3, 4e-4, 4e-4])
FINE = {"misfit": 1.0, "covered": 1.0, "settled": True}


def verdict(pose=None, sigmas=SIGMAS, inflation=1.0, knowns=Knowns(0.01), scene=Scene(), **more):  # noqa: B008
    estimate = Estimate(scene.pose(TIP) if pose is None else pose, scene)
    return judged(estimate, inflation * np.diag(np.square(sigmas)), scene, knowns, **{**FINE, **more})


def test_a_fit_that_agrees_with_its_model_comes_with_its_covariance():
    found = verdict()
    assert isinstance(found, Localization)
    np.testing.assert_array_equal(found.apex_mm, TIP)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), SIGMAS, rtol=1e-3)


def test_light_of_many_colours_seen_through_the_eyes_optics_leaves_it_open_how_far_from_the_wall_a_tip_is():
    data = {"retina": "fundus", "sensor": "cmv12000-mono", "camera": {"resolution": 400, "optics": {"contact": "flat"}}}
    white, green = (
        read_scene(Document("test", {**data, "eye": {"radius": "12 mm"}, "illumination": light}))
        for light in ("led-b3", "line532")
    )
    many, one = (verdict(sigmas=1e-2 * SIGMAS, scene=scene) for scene in (white, green))
    wider = many.covariance[:3, :3] - one.covariance[:3, :3]
    farther = white.image_size_sigma * many.distance.along_mm
    np.testing.assert_allclose(wider, np.square(farther) * np.outer(many.axis, many.axis), rtol=0.01, atol=1e-11)


def test_correlated_residuals_widen_the_covariance():
    np.testing.assert_allclose(verdict(inflation=4.0).covariance, 4.0 * verdict().covariance, rtol=1e-3)


def test_no_stated_error_is_below_what_optics_resolve():
    found = verdict(sigmas=np.full(5, 1e-12))
    assert np.all(np.sqrt(np.diag(found.covariance)) > 1e-6)


def test_quantities_beside_the_pose_are_in_the_covariance_and_left_out_of_it():
    information = np.diag(1.0 / np.square([*SIGMAS, 1e-3]))
    information[2, 5] = information[5, 2] = 0.6 * math.sqrt(information[2, 2] * information[5, 5])
    scene, knowns = Scene(), Knowns(0.01, half_angle_sigma_deg=0.05)
    found = judged(Estimate(scene.pose(TIP), scene), inverse(information), scene, knowns, **FINE)
    assert found.covariance.shape == (5, 5)
    assert math.sqrt(found.covariance[2, 2]) == pytest.approx(SIGMAS[2] / 0.8, rel=1e-3)


@pytest.mark.parametrize(("core", "answered"), [(0.2, True), (0.33, False)])
def test_a_core_far_wider_than_fibres_have_is_an_optic_disc_and_no_patch(core, answered):
    scene, knowns = Scene(beam=HardBeam()), Knowns(0.01).doubting_core
    wider = scene.model_copy(update={"beam": HardBeam(source_diameter=core)})
    found = judged(Estimate(scene.pose(TIP), wider), np.diag(np.square(SIGMAS)), scene, knowns, **FINE)
    assert isinstance(found, Localization) if answered else found.reason == WRONG_BEAM
    told = judged(Estimate(scene.pose(TIP), wider), np.diag(np.square(SIGMAS)), wider, knowns, **FINE)
    assert isinstance(told, Localization)


def test_a_rig_has_its_roll_and_its_error():
    scene = Scene(spotlights=RIGS["triple"])
    bare = scene.pose(TIP)
    pose = Pose(bare.apex, bare.axis, 0.2)
    found = verdict(pose, sigmas=np.append(SIGMAS, 1e-3), scene=scene)
    assert found.roll == 0.2
    assert found.covariance.shape == (6, 6)


def turned(pose, angle):
    axis = pose.axis + math.tan(angle) * np.cross(pose.axis, [0.0, 1.0, 0.0])
    return Pose(pose.apex, axis / np.linalg.norm(axis))


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ({"covered": 0.2}, COVERED),
        ({"pose": Pose(np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, -1.0]))}, OUTSIDE),
        ({"pose": Pose(np.array([6.1, 0.0, 22.3]), -np.array([0.1, 0.0, 0.3]) / math.hypot(0.1, 0.3))}, BEHIND),
        ({"sigmas": SIGMAS * 100.0}, UNCERTAIN),
        ({"sigmas": np.array([1e-3, 1e-3, math.inf, 1e-3, 1e-3])}, UNCERTAIN),
        ({"inflation": -1.0}, UNCERTAIN),
        ({"pose": turned(Scene().pose(TIP), 0.02)}, MISSES_RCM),
        ({"misfit": 4.0}, MISFIT),
        ({"settled": False}, UNSETTLED),
    ],
)
def test_what_contradicts_the_model_is_refused_with_the_reason(more, reason):
    refused = verdict(**more)
    assert not refused
    assert refused.reason == reason


def test_a_missed_rcm_is_no_contradiction_where_it_is_not_known_or_not_known_that_well():
    pose = turned(Scene().pose(TIP), 0.02)
    assert verdict(pose, knowns=Knowns(rcm_sigma_mm=None))
    assert verdict(pose, knowns=Knowns(rcm_sigma_mm=0.2))
    assert verdict(pose, sigmas=SIGMAS * [1.0, 1.0, 1.0, 20.0, 20.0])


def test_a_free_fit_may_be_less_uncertain_before_it_is_refused():
    between = np.full(5, 0.5 * (VERDICT.largest_free_sigma_mm + VERDICT.largest_sigma_mm) / math.sqrt(3.0))
    assert verdict(sigmas=between)
    assert verdict(sigmas=between, knowns=Knowns(rcm_sigma_mm=None)).reason == UNCERTAIN
