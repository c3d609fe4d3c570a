"""The albedo's cosine modes and what is left of it beyond them."""

import math

import numpy as np
import pytest

from conespot.localize import Knowns
from conespot.localize.field.albedo import Modes, even
from conespot.localize.field.roughness import Roughness
from conespot.localize.field.settings import FIELD
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.view import Bins, Window
from conespot.scene.camera import Camera
from conespot.scene.scene import Scene

FUNDUS = even(FIELD.fundus)


def test_the_modes_products_are_those_of_their_sums():
    rng = np.random.default_rng(1)
    modes = Modes.over(40, 56, 0.02)
    weights = rng.uniform(size=(40, 56))
    each = (modes.along_y[:, None, :, None] * modes.along_x[None, :, None, :]).reshape(-1, 40 * 56)
    assert np.allclose(modes.gram(weights), (each * weights.ravel()) @ each.T)
    assert np.allclose(modes.project(weights[None])[:, 0], each @ weights.ravel())
    coefficients = rng.standard_normal(len(each))
    assert np.allclose(modes.field(coefficients).ravel(), coefficients @ each)


@pytest.mark.parametrize("fine", [1e-5, 1e-2])
def test_each_octave_of_the_spectrum_is_learnt_by_itself(fine):
    rng = np.random.default_rng(2)
    modes = Modes.over(200, 200, 0.01)
    true = np.full(len(FUNDUS), 3e-4)
    true[4:] = fine
    variances = 1.0 / modes.precision(true)
    amplitudes = FUNDUS
    for _ in range(20):
        coefficients = rng.standard_normal(len(variances)) * np.sqrt(variances)
        amplitudes = modes.learnt(coefficients, 0.0 * variances, amplitudes)
    shown = np.flatnonzero(np.bincount(modes.octave[1:]) > 20)
    assert len(shown) > 2
    assert np.allclose(np.log10(amplitudes[shown]), np.log10(true[shown]), atol=0.35)


def test_an_octave_that_the_pose_imitates_is_taken_to_be_like_the_next_finer_one():
    modes = Modes.over(200, 200, 0.02)
    first = modes.octave[1:].min()
    hidden = modes.octave == first
    true = 1.0 / modes.precision(np.full(len(FUNDUS), 1e-3))
    coefficients = np.where(hidden, 0.0, np.sqrt(true))
    amplitudes = FUNDUS
    for _ in range(30):
        variances = np.where(hidden, 1.0 / modes.precision(amplitudes), 0.0)
        amplitudes = modes.learnt(coefficients, variances, amplitudes)
    assert amplitudes[first] == pytest.approx(1e-3, rel=0.05)


def test_where_the_albedo_is_rough_bins_are_told_apart_from_where_it_is_smooth():
    rng = np.random.default_rng(3)
    residual = 0.01 * rng.standard_normal((120, 120))
    residual[:, 50:60] -= 0.4 * np.sin(np.linspace(0.0, math.pi, 10))
    everywhere = np.ones(residual.shape, bool)
    roughness = Roughness()
    for _ in range(4):
        roughness, local = roughness.measured(residual, np.full(residual.shape, 0.01**2), everywhere, everywhere)
    assert roughness.scatter < 0.01
    assert np.median(local[:, 53:57]) > 100.0 * np.median(local[:, 80:])


def test_noise_that_neighbours_share_counts_once():
    rng = np.random.default_rng(4)
    alone = rng.standard_normal((120, 120))
    shared = np.kron(rng.standard_normal((40, 40)), np.ones((3, 3)))
    everywhere = np.ones(alone.shape, bool)
    areas = [Roughness(0.01).measured(0.02 * r, np.full(r.shape, 1e-6), everywhere, everywhere)[0].area
             for r in (alone, shared)]  # fmt: skip
    assert areas[0] < 1.3
    assert areas[1] > 3.0


def test_a_bin_between_three_patches_counts_in_one_window_only():
    scene = Scene(spotlights="triple", camera=Camera(resolution=1000))
    estimate = Estimate(scene.pose(np.array([1.0, 0.5, 4.0])), scene)
    count = np.zeros((1000, 1000), int)
    for spotlight in range(3):
        at = Window.around(estimate, spotlight, 1000, 0.15)
        seen = Bins(at, estimate, Knowns(), spotlight).seen.reshape(at.height, at.width)
        count[at.row : at.row + at.height, at.column : at.column + at.width] += seen
    assert count.max() == 1
