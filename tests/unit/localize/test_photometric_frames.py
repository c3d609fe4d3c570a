"""The estimators on frames cast ray by ray with scene's geometry only: texture, ambient light, a noisy sensor."""

import math

import numpy as np
import pytest
from photographs import AMBIENT, NOISE, WHITE, albedo, cast, fundus, photograph, scene_of, upward

from conespot.localize import Knowns, Localization, Reference, locate
from conespot.localize.sequence import locate_sequence
from conespot.localize.theory.bounds import cramer_rao
from conespot.scene import InputError, Pose
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.eye import Eye
from conespot.scene.population import SEMI_AXES_SIGMA_MM
from conespot.scene.surface import Surface

FREE = Knowns(rcm_sigma_mm=None)


TIPS = ((1.0, 0.5, 4.0), (-1.5, -1.0, 3.0))


def miss_um(outcome, pose):
    assert isinstance(outcome, Localization), getattr(outcome, "reason", outcome)
    return 1e3 * float(np.linalg.norm(outcome.apex_mm - pose.apex))


def sigmas_off(outcome, pose):
    error = outcome.apex_mm - pose.apex
    return math.sqrt(float(error @ np.linalg.solve(outcome.covariance[:3, :3], error)))


def scene_pose(found):
    return Pose(found.apex_mm, found.axis)


@pytest.mark.parametrize("tip", TIPS)
def test_a_hard_patch_without_texture_is_found_near_the_bound(tip):
    scene = scene_of(HardBeam())
    pose = scene.pose(np.array(tip))
    found = locate(photograph(scene, pose), scene, "cone", knowns=FREE, noise=NOISE)
    bound = cramer_rao(scene, pose).position_mm * 1e3
    assert miss_um(found, pose) < 3.5 * bound
    assert sigmas_off(found, pose) < 4.0


@pytest.mark.slow
def test_the_mean_over_noise_of_a_hard_patch_is_unbiased_below_a_fiftieth_of_a_pixel():
    scene = scene_of(HardBeam())
    pose = scene.pose(np.array(TIPS[0]))
    found = locate(photograph(scene, pose, noise=False, rays=32), scene, "cone", knowns=FREE, noise=NOISE)
    outline, true = (scene.camera.project(scene.outline(p, 0)) for p in (scene_pose(found), pose))
    assert np.max(np.abs(outline - true)) < 0.02


@pytest.mark.parametrize("tip", TIPS)
def test_a_hard_patch_on_texture_is_found_to_microns(tip):
    scene = scene_of(HardBeam())
    pose = scene.pose(np.array(tip))
    found = locate(photograph(scene, pose, fundus(0.2)), scene, "cone", knowns=FREE, noise=NOISE)
    assert miss_um(found, pose) < 7.0
    assert sigmas_off(found, pose) < 4.5


@pytest.mark.parametrize("tip", TIPS)
def test_a_soft_patch_on_texture_is_found_when_the_rcm_is_known(tip):
    scene = scene_of(CyclesBeam())
    pose = scene.pose(np.array(tip))
    found = locate(photograph(scene, pose, fundus(0.2)), scene, "photometric", knowns=Knowns(0.01), noise=NOISE)
    assert miss_um(found, pose) < 15.0
    assert sigmas_off(found, pose) < 4.5


def test_a_reference_frame_makes_a_soft_patch_on_texture_sharper():
    scene = scene_of(CyclesBeam())
    pose, texture = scene.pose(np.array(TIPS[0])), fundus(0.2)
    far = scene.pose(np.array([-2.5, 2.5, 3.0]))
    lit = photograph(scene, pose, texture)
    reference = photograph(scene, far, texture, seed=1)
    found = locate(lit, scene, "photometric", knowns=Knowns(0.01), noise=NOISE, reference=reference)
    alone = locate(lit, scene, "photometric", knowns=Knowns(0.01), noise=NOISE)
    assert miss_um(found, pose) < 6.0
    assert np.trace(found.covariance[:3, :3]) < np.trace(alone.covariance[:3, :3])


@pytest.mark.slow
def test_the_mean_of_many_reference_frames_makes_a_hard_patch_on_coarse_texture_sharper():
    scene = scene_of(HardBeam())
    pose, texture = scene.pose(np.array(TIPS[0])), fundus(0.5)
    lit = photograph(scene, pose, texture)
    centres = np.arange(1000) + 0.5
    wall = cast(scene, centres, centres)
    unlit = Reference((AMBIENT / WHITE * albedo(texture, wall) * upward(scene, wall)).astype(np.float32), 1000.0)
    found = locate(lit, scene, "photometric", knowns=FREE, noise=NOISE, reference=unlit)
    alone = locate(lit, scene, "photometric", knowns=FREE, noise=NOISE)
    assert miss_um(found, pose) < 4.0
    assert np.trace(found.covariance[:3, :3]) < 0.8 * np.trace(alone.covariance[:3, :3])


@pytest.mark.slow
def test_soft_ellipsoids_on_texture_hold_what_they_state():
    scene, rng = scene_of(CyclesBeam()), np.random.default_rng(8)
    squares = []
    for seed, contrast in enumerate((0.1, 0.2, 0.4) * 3):
        tip = rng.uniform((-2.0, -2.0, 3.0), (2.0, 2.0, 5.0))
        pose = scene.pose(tip)
        rcm = tuple(np.array(scene.instrument.rcm) + 0.05 * rng.standard_normal(3))
        told = scene.model_copy(update={"instrument": scene.instrument.model_copy(update={"rcm": rcm})})
        lit = photograph(scene, pose, fundus(contrast, seed), seed, rays=2)
        found = locate(lit, told, "photometric", knowns=Knowns(0.05), noise=NOISE)
        assert found
        squares.append(sigmas_off(found, pose) ** 2)
    assert max(squares) < 14.2  # 99.7 % of a chi square with three degrees of freedom
    assert 0.25 < np.mean(squares) / 3.0 < 2.0


def test_the_colours_of_a_vessel_take_it_off_the_albedo():
    scene, grey, red = scene_of(CyclesBeam()), fundus(0.05, 2), fundus(0.4, 3)
    pose = scene.pose(np.array(TIPS[0]))
    channels = [photograph(scene, pose, grey * red**share, seed, rays=2) for seed, share in enumerate((0.2, 1.0, 1.2))]
    colour = locate(np.stack(channels, axis=2), scene, "photometric", knowns=FREE, noise=NOISE)
    alone = locate(channels[0], scene, "photometric", knowns=FREE, noise=NOISE)
    assert sigmas_off(colour, pose) < 4.0
    assert np.trace(colour.covariance[:3, :3]) < 0.9 * np.trace(alone.covariance[:3, :3])


def test_three_soft_patches_hold_the_tip_that_one_does_not():
    scene = scene_of(CyclesBeam(), "triple")
    pose = scene.pose(np.array(TIPS[0]))
    found = locate(photograph(scene, pose, fundus(0.1), rays=2), scene, "photometric", knowns=FREE, noise=NOISE)
    assert miss_um(found, pose) < 10.0
    assert sigmas_off(found, pose) < 4.0


def test_three_patches_give_the_tip_and_the_roll():
    scene = scene_of(HardBeam(), "triple")
    pose = scene.pose(np.array(TIPS[0]))
    found = locate(photograph(scene, pose, fundus(0.2), rays=8), scene, "cone", knowns=FREE, noise=NOISE)
    assert miss_um(found, pose) < 3.0
    assert math.degrees(abs(found.roll)) < 0.05
    assert found.covariance.shape == (6, 6)


def test_a_wrong_rcm_is_refused_or_inside_the_stated_uncertainty():
    scene = scene_of(HardBeam())
    pose = scene.pose(np.array(TIPS[0]))
    wrong = scene.model_copy(update={"instrument": scene.instrument.model_copy(update={"rcm": (6.5, 0.0, 22.0)})})
    found = locate(photograph(scene, pose), wrong, "cone", knowns=Knowns(0.01), noise=NOISE)
    assert not found
    assert "remote centre of motion" in found.reason


def test_free_soft_patches_on_texture_are_never_returned_far_off():
    scene = scene_of(CyclesBeam())
    for seed, tip in enumerate(TIPS):
        pose = scene.pose(np.array(tip))
        lit = photograph(scene, pose, fundus(0.4, seed))
        found = locate(lit, scene, "photometric", knowns=FREE, noise=NOISE)
        if found:
            sigma = math.sqrt(float(np.trace(found.covariance[:3, :3])))
            assert miss_um(found, pose) < 6e3 * sigma + 50.0


@pytest.mark.parametrize("localizer", ["cone", "photometric"])
def test_a_frame_without_a_patch_is_a_failure_with_a_reason(localizer):
    scene = scene_of(HardBeam(), resolution=200)
    empty = np.random.default_rng(0).normal(80.0, 6.0, (200, 200)).astype(np.uint16)
    assert locate(empty, scene, localizer).reason


def test_a_sequence_learns_the_retina_that_single_frames_cannot_see():
    scene = scene_of(CyclesBeam())
    texture = fundus(0.2)
    poses = [scene.pose(np.array([2.0 * math.sin(t), 2.0 * math.cos(t), 3.5])) for t in np.linspace(0.0, 5.5, 6)]
    frames = [photograph(scene, pose, texture, seed=i, rays=2) for i, pose in enumerate(poses)]
    result = locate_sequence(lambda: frames, scene, knowns=Knowns(0.01), noise=NOISE)
    assert result.learnt_from == 6
    assert np.mean([miss_um(o, p) for o, p in zip(result.outcomes, poses, strict=True)]) < 4.0


def test_knowns_refuse_nonsense_and_published_methods_refuse_knowns():
    with pytest.raises(InputError, match="rcm_sigma_mm"):
        Knowns(rcm_sigma_mm=-1.0)
    scene = scene_of(HardBeam(), resolution=100)
    with pytest.raises(InputError, match="no softness"):
        cramer_rao(scene, scene.pose(np.array([0.0, 0.0, 4.0])), knowns=Knowns(softness_sigma=0.1))
    with pytest.raises(InputError, match="no use for knowns"):
        locate(np.zeros((100, 100), np.uint8), scene, "paper", knowns=FREE)


def test_an_eye_of_unknown_shape_is_estimated_beside_the_pose():
    """Told the mean eye of the population, its shape free within the population's scatter: one hard frame suffices."""
    scene = scene_of(HardBeam(), eye=Eye(radius=10.311), surface=Surface.model_validate({"population": 2}))
    told = scene.model_copy(update={"surface": Surface.model_validate({"population": "mean"})})
    apex = np.array([0.5, 0.3, 4.0])
    image = photograph(scene, scene.pose(apex), rays=8)
    guess, exact = (
        locate(image, told, "cone", knowns=Knowns(rcm_sigma_mm=None, semi_axes_sigma_mm=sigma), noise=NOISE)
        for sigma in (SEMI_AXES_SIGMA_MM, 0.0)
    )
    assert guess
    off = guess.apex_mm - apex
    assert off @ np.linalg.solve(guess.covariance[:3, :3], off) < 16.3  # 99.9 % of answers
    assert np.linalg.norm(off) < 0.015
    assert not exact or np.linalg.norm(exact.apex_mm - apex) > 3.0 * np.linalg.norm(off)
