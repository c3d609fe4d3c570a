"""Spreads of the source that nobody tells: where a hand went in an exposure, and the core of a fibre."""

import numpy as np
import pytest
from moving import MovingNeedle
from photographs import AMBIENT, NOISE, PEAK, READ, WHITE, cast, scene_of, spotlight
from scipy.stats import binom, chi2

from conespot.localize import Knowns, locate
from conespot.localize.model.quantity import QUANTITIES
from conespot.localize.model.smear import sag_sigma, smear_sigma, way_covariance
from conespot.localize.verdict import WRONG_BEAM
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.motion import Tremor
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene

TIP, EXPOSURE = np.array([0.9, -0.6, 4.0]), 0.008
TREMOR = Tremor(exposure=EXPOSURE)


def along(scene, way, parts=16):
    """Poses of a tip that goes straight along `way` [mm], TIP in its middle."""
    shares = (np.arange(parts) + 0.5) / parts - 0.5
    return [Pose.through(TIP + share * way, scene.instrument.rcm) for share in shares]


def over_core(scene, diameter, parts=100):
    """Poses whose tips are spread over a disc across the needle."""
    pose = scene.pose(TIP)
    radius, angle = diameter / 2.0 * np.sqrt((np.arange(parts) + 0.5) / parts), np.arange(parts) * 2.399963
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1) @ pose.rotation()[:, :2].T
    return [Pose(pose.apex + off, pose.axis) for off in disc]


def exposed(scene, poses, seed, k=6):
    """A frame of 12 bits over an even retina, the mean over poses."""
    outlines = np.concatenate([scene.camera.project(scene.outline(pose, 0)) for pose in poses])
    low, high = np.floor(outlines.min(axis=0)).astype(int) - 2, np.ceil(outlines.max(axis=0)).astype(int) + 2
    x, y = (low[i] + (np.arange((high[i] - low[i]) * k) + 0.5) / k for i in (0, 1))
    points = cast(scene, x, y)
    light = sum(spotlight(scene, pose, points) for pose in poses)
    light = light.reshape(high[1] - low[1], k, -1, k).mean(axis=(1, 3))
    electrons = np.full(scene.camera.shape, AMBIENT)
    electrons[low[1] : high[1], low[0] : high[0]] += PEAK * light / np.quantile(light, 0.998)
    rng = np.random.default_rng(seed)
    electrons = rng.poisson(electrons) + READ * rng.standard_normal(electrons.shape)
    return np.clip(np.round(electrons / WHITE * 4095.0), 0, 4095).astype(np.uint16)


def test_a_tremors_smear_is_what_its_way_scatters_in_the_mean():
    ways = [TREMOR.sway(time, 0.02, seed=2) for time in np.arange(0.0, 60.0, 0.0731)]
    scatter = np.mean([np.var(way, axis=0) for way in ways], axis=0)
    np.testing.assert_allclose(scatter, TREMOR.smear(0.02) ** 2, rtol=0.1)
    # short against its waves it is a steady velocity
    speed = 2.0 * np.pi * TREMOR.rms / np.sqrt(3.0) * np.sqrt(81.0 + 4.0 / 12.0)
    assert TREMOR.smear(1e-3) == pytest.approx(speed * 1e-3 / np.sqrt(12.0), rel=1e-3)


def test_a_tremors_sag_is_how_far_its_mean_place_is_off_the_middle_one():
    ways = [TREMOR.sway(time, 0.02, seed=2) for time in np.arange(0.0, 60.0, 0.0731)]
    # both ends of a way count as half
    means = np.array([np.trapezoid(way, axis=0) / (len(way) - 1) for way in ways])
    np.testing.assert_allclose(np.mean(np.square(means), axis=0), TREMOR.sag(0.02) ** 2, rtol=0.1)
    assert sag_sigma(Scene(motion=TREMOR)) == TREMOR.sag(EXPOSURE)
    assert sag_sigma(Scene()) == 0.0


@pytest.mark.slow
def test_a_tremors_bent_way_is_in_its_tips_ellipsoids():
    """With the mean place taken for the middle one, 25 of 40 such tips were inside."""
    needle = MovingNeedle(500, seed=1, exposure_s=EXPOSURE, blur_mm=0.0057, emva=True, beam=HardBeam(), instants=24)
    rng, inside, scene = np.random.default_rng(5), 0, needle.scene
    for time in rng.uniform(0.0, 100.0, 24):
        rcm = tuple(map(float, np.asarray(scene.instrument.rcm) + 0.05 * rng.standard_normal(3)))
        told = scene.model_copy(update={"instrument": scene.instrument.model_copy(update={"rcm": rcm})})
        found = locate(needle.frame(float(time)), told, "photometric")
        assert found, found.reason
        off = found.apex_mm - needle.tip(time)
        inside += off @ np.linalg.solve(found.covariance[:3, :3], off) < chi2.ppf(0.95, 3)
    assert inside >= binom.ppf(0.005, 24, 0.95)


def test_what_is_known_of_a_way_are_the_moments_of_a_gaussian_velocity():
    scene = Scene(motion=TREMOR)
    own = smear_sigma(scene)
    ways = own * np.random.default_rng(1).standard_normal((200_000, 3))
    known = Knowns().within(scene)
    products = np.einsum("ki,kj->kij", ways, ways)
    for each in (each for each in QUANTITIES if each.known == "smear_sigma_mm"):
        i, j = ("xyz".index(axis) for axis in each.name[-2:])
        assert each.value(scene) == pytest.approx(np.mean(products[:, i, j]), abs=0.02 * own**2)
        assert known.sigma(each) == pytest.approx(np.std(products[:, i, j]), rel=0.02)
        np.testing.assert_allclose(way_covariance(each.write(scene, 3e-4))[i, j], 3e-4)
    assert not any(each.known == "smear_sigma_mm" for each in Knowns().within(Scene()).free)


@pytest.mark.parametrize("beam", [HardBeam(), CyclesBeam()], ids=lambda beam: beam.words)
def test_a_patch_that_smears_in_a_way_nobody_tells_is_measured_within_four_sigmas(beam):
    scene = scene_of(beam, resolution=400)
    told = scene.model_copy(update={"motion": TREMOR})
    for seed, way in enumerate(([0.08, 0.0, 0.0], [0.0, 0.06, 0.05])):
        found = locate(exposed(scene, along(scene, np.array(way)), seed), told, "photometric", noise=NOISE)
        assert found, found.reason
        off, sigma = (np.linalg.norm(found.apex_mm - TIP), np.sqrt(np.trace(found.covariance[:3, :3])))
        assert off < min(0.03, 4.0 * sigma)


@pytest.mark.slow
def test_a_core_that_nobody_told_of_is_fitted_or_refused():
    """Taken for a blur it puts them 23 um off, 24 of their own sigmas."""
    scene = scene_of(HardBeam(), resolution=500)
    for seed in range(2):
        found = locate(exposed(scene, over_core(scene, 0.1), seed), scene, "photometric", noise=NOISE)
        if found:
            off = found.apex_mm - TIP
            assert off @ np.linalg.solve(found.covariance[:3, :3], off) < 25.0


def test_a_motion_that_nobody_told_of_is_no_blur():
    """Taken for one it put tips 9 to 50 um off: it widens each part of an outline by what that part moves."""
    needle = MovingNeedle(400, seed=1, exposure_s=EXPOSURE, blur_mm=0.0057, emva=True, beam=HardBeam(), instants=24)
    still = needle.scene.model_copy(update={"motion": None})
    found = locate(needle.frame(86.0), still, "photometric")
    assert not found
    assert found.reason == WRONG_BEAM
