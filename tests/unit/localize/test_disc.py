"""Soft patches with an optic disc under them, whose rim may pass for the end of the light."""

import math

import numpy as np
import pytest
from photographs import NOISE, READ, WHITE, fundus, photograph, scene_of
from scipy.ndimage import gaussian_filter

from conespot.localize import Knowns, Localization, SensorNoise, locate
from conespot.localize.disc.rings import find_round
from conespot.localize.disc.step import Disc
from conespot.localize.outcome import DISC_UNDER_IT
from conespot.scene.beam import CyclesBeam

TIP = (1.0, 0.5, 6.5)


def with_disc(texture, at, radius, times):
    """The `texture` with a disc about `at` [mm] that is so many times as bright."""
    y, x = np.mgrid[:1400, :1400]
    distance = np.hypot(0.01 * (x - 700) - at[0], 0.01 * (700 - y) - at[1])
    return texture * np.where(distance < radius, times, 1.0).astype(np.float32)


@pytest.mark.parametrize(
    ("times", "beside", "size", "refused"),
    [(1.0, 0.0, 0.8, False), (4.0, 0.25, 0.8, True), (3.0, 0.1, 0.85, True), (3.0, 1.3, 0.85, False)],
    ids=["mottle", "disc", "another", "disc across the rim"],
)
def test_a_disc_about_as_large_as_a_soft_patch_under_it_is_refused(times, beside, size, refused):
    scene = scene_of(CyclesBeam(), resolution=400)
    pose = scene.pose(np.array(TIP))
    outline = scene.outline(pose, 0, 64)
    middle, radius = outline.mean(axis=0), float(np.mean(np.linalg.norm(outline - outline.mean(axis=0), axis=1)))
    texture = with_disc(fundus(0.1), middle[:2] + [beside * radius, 0.0], size * radius, times)
    found = locate(photograph(scene, pose, texture), scene, "photometric", knowns=Knowns(0.05), noise=NOISE)
    if refused:
        assert getattr(found, "reason", None) == DISC_UNDER_IT
    else:
        assert isinstance(found, Localization)
        sigma = math.sqrt(float(np.trace(found.covariance[:3, :3])))
        assert np.linalg.norm(found.apex_mm - pose.apex) < 6.0 * sigma + 0.05


def test_a_blur_that_nobody_told_of_is_taken_for_no_disc():
    scene = scene_of(CyclesBeam(), resolution=400)
    pose = scene.pose(np.array([1.0, 0.5, 5.0]))
    electrons = 50.0 * gaussian_filter(photograph(scene, pose, noise=False) / 4095.0, 1.8) * WHITE
    noisy = np.random.default_rng(0).normal(electrons, np.sqrt(electrons + READ**2))
    image = np.round(noisy / (50.0 * WHITE) * 4095.0).clip(0.0, 4095.0).astype(np.uint16)
    noise = SensorNoise(levels=4095, electrons=50.0 * WHITE, read=READ)
    found = locate(image, scene, "photometric", knowns=Knowns(0.05), noise=noise)
    assert isinstance(found, Localization)
    assert np.linalg.norm(found.apex_mm - pose.apex) < 0.01


def test_a_discs_step_has_the_derivatives_that_it_says():
    y, x = np.mgrid[-1.5:1.5:31j, -1.5:1.5:31j]
    disc = Disc.at(np.array([0.1, -0.2]), 0.9).moved(np.array([0.0, 0.0, 0.02, 0.05, -0.03, 0.4, 0.2]))
    rows = disc.step(x, y)[1]
    for k, row in enumerate(rows):
        beside = [Disc(disc.first, disc.now + sign * 1e-5 * np.eye(7)[k]).step(x, y)[0] for sign in (1.0, -1.0)]
        assert np.allclose((beside[0] - beside[1]) / 2e-5, row, atol=1e-6)


def test_a_discs_middle_is_found_where_the_window_shows_half_of_it():
    rng = np.random.default_rng(1)
    y, x = np.mgrid[:60, :60] * 0.04
    albedo = Disc.at(np.array([2.4, 1.1]), 0.85).step(x, y)[0] + 0.1 * rng.standard_normal(x.shape)
    middle, radius, votes = find_round(albedo, np.full(x.shape, 0.01), np.ones(x.shape, bool), 0.04)
    assert np.linalg.norm(middle - [2.4, 1.1]) < 0.15
    assert radius == pytest.approx(0.85, abs=0.12)
    assert votes > 0.4
