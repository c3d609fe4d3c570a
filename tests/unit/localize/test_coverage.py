"""What stated sigmas rest on, and whether 95 % ellipsoids hold 95 % of the tips; `benchmarks/coverage.py` asks more."""

import math
from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
import pytest
from photographs import AMBIENT, NOISE, PEAK, READ, WHITE, albedo, fundus, photograph, scene_of
from scipy.ndimage import gaussian_filter
from scipy.stats import binom, chi2

from conespot.localize import Knowns, Localization, locate
from conespot.localize.edge.ribbon import Ribbon
from conespot.localize.edge.rounding import Rounding
from conespot.localize.field.roughness import Roughness
from conespot.localize.field.sandwich import rest_scatter
from conespot.localize.image import Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import ambient_irradiance, light
from conespot.localize.model.profile import Profile
from conespot.localize.model.residual import censored, incident_light, log_residuals
from conespot.localize.model.sight import look, window
from conespot.localize.model.view import Shown
from conespot.localize.theory.bounds import patch_pixels
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.sensor import Linear, Recorded

RCM_MM = 0.05


def rows(side=120):
    """Two derivatives that no mode of 16 bins or longer imitates."""
    y, x = np.mgrid[:side, :side] - side / 2.0
    around = np.exp(-0.5 * (x**2 + y**2) / 20.0**2)
    return np.stack([around * np.cos(2.0 * np.pi * x / 10.0), around * np.sin(2.0 * np.pi * (x + y) / 12.0)])


def shared(rng, width, side=120):
    """Noise of variance 1 that bins share with their neighbours as far as `width`."""
    noise = rng.standard_normal((side, side))
    if width:
        noise = 2.0 * math.sqrt(math.pi) * width * gaussian_filter(noise, width, mode="wrap")
    return noise


@pytest.mark.parametrize("width", [0.0, 1.0, 2.0])
def test_the_covariance_of_a_gradient_is_told_by_one_frames_residuals(width):
    jacobian, rng = rows(), np.random.default_rng(3)
    frames = [shared(rng, width) for _ in range(150)]
    gradients = np.array([np.einsum("phw,hw->p", jacobian, frame) for frame in frames])
    white = np.array([shared(rng, 0.0) for _ in range(8)])
    told = np.mean([rest_scatter(jacobian, frame, white) for frame in frames[:10]], axis=0)
    ratio = np.diag(told) / np.var(gradients, axis=0)
    np.testing.assert_allclose(ratio, 1.0, atol=0.35)  # 150 gradients know their variance to 12 %


def test_white_residuals_leave_the_information_as_it_is():
    jacobian = rows()
    flat = jacobian.reshape(2, -1)
    noise = [shared(np.random.default_rng(i), 0.0) for i in range(50)]
    told = np.mean([rest_scatter(jacobian, frame, np.array(noise[30:])) for frame in noise[:30]], axis=0)
    np.testing.assert_allclose(told, flat @ flat.T, atol=0.04 * float(np.trace(flat @ flat.T)))


def test_bins_that_share_their_rest_count_for_as_many_as_share_it():
    everywhere, none = np.ones((120, 120), bool), np.zeros((120, 120))
    for width, least, most in [(0.0, 1.0, 1.2), (1.0, 5.0, 14.0), (1.5, 10.0, 30.0)]:  # 4 pi width^2 share it
        seen = 0.1 * shared(np.random.default_rng(1), width)
        area = Roughness().measured(seen, none + 1e-8, everywhere, everywhere)[0].area
        assert least <= area <= most


def test_clipped_bins_make_up_for_those_that_are_measured_because_noise_left_them_dark():
    """At the true brightness, near white, the score's mean is zero; that of the measured bins alone is not."""
    rng, sigma = np.random.default_rng(2), 0.05
    for log_model in (-0.05, 0.0, 0.05):
        noisy = log_model + sigma * rng.standard_normal(200_000)
        clipped = noisy >= 0.0
        residual, worth = censored(np.full(int(clipped.sum()), -log_model), np.full(int(clipped.sum()), sigma))
        measured = (noisy[~clipped] - log_model) / sigma
        score = np.concatenate([measured, worth * residual / sigma])
        assert abs(score.mean()) < 4.0 * score.std() / math.sqrt(len(score))
        assert measured.sum() / len(noisy) < -0.2
        assert np.all((worth >= 0.0) & (worth <= 1.0))


def test_a_model_that_takes_off_more_light_than_there_is_has_none():
    ambient = np.array([1.0, 1.0, 0.97])
    spotlights = np.array([2.0, -0.5, -1.9])  # the last as a fit on a clipped soft patch had it
    light = incident_light(ambient, spotlights)
    np.testing.assert_array_equal(light[:2], (ambient + spotlights)[:2])
    assert np.isnan(light[2])


@pytest.mark.parametrize("over_noise", [0.3, 1.0, 3.0, 30.0])
def test_a_surrounding_darker_than_the_noise_has_residuals_of_mean_nought(over_noise):
    rng, model, none = np.random.default_rng(4), np.full((400, 500), 0.01), np.zeros((400, 500))
    sigma = 0.01 / over_noise
    signal = model + sigma * rng.standard_normal(model.shape)
    shown = Shown(signal, none == 0.0, none > 0.0, none, none)
    residual, _ = log_residuals(shown, model, none + over_noise**-2)
    assert abs(residual.mean()) < 4.0 * residual.std() / math.sqrt(residual.size)


@lru_cache
def ground(side):
    """What the pixels of a frame see, and the ambient light there."""
    scene = scene_of(HardBeam(), resolution=side)
    sight = look(scene, window(0, 0, side, side))
    return sight.points.reshape(side, side, 3), ambient_irradiance(sight, scene).reshape(side, side)


def electrons(scene, pose, texture):
    """What a frame collects, as the model of the light has it: each pixel's mean is exact."""
    points, ambient = ground(scene.camera.resolution)
    pixels = patch_pixels(scene, pose)
    value = light(look(scene, pixels), pose, scene, Profile.of(scene.beam)).value
    lit = np.zeros_like(ambient)
    column, row = pixels.astype(int).T
    lit[row, column] = PEAK * value / np.quantile(value[value > 0.0], 0.998)
    return albedo(texture, points) * (AMBIENT * ambient + lit)


def brighter(signal, factor, seed):
    """A frame of `signal` electrons, `factor` times as bright."""
    rng = np.random.default_rng(seed)
    noisy = rng.poisson(factor * signal) + READ * rng.standard_normal(signal.shape)
    return np.clip(np.round(noisy / WHITE * 4095.0), 0, 4095).astype(np.uint16)


def misinformed(scene, rng):
    """The scene with an RCM that is off by its sigma."""
    rcm = tuple(np.array(scene.instrument.rcm) + RCM_MM * rng.standard_normal(3))
    return scene.model_copy(update={"instrument": scene.instrument.model_copy(update={"rcm": rcm})})


def square(found, pose):
    off = found.apex_mm - pose.apex
    return float(off @ np.linalg.solve(found.covariance[:3, :3], off))


@pytest.mark.parametrize("factor", [1.0, 1.5, 20.0])
def test_a_hard_patch_that_is_clipped_lies_within_its_sigmas_however_bright_it_is(factor):
    scene = scene_of(HardBeam(), resolution=400)
    pose = scene.pose(np.array([1.0, 0.5, 4.0]))
    signal = photograph(scene, pose, noise=False, rays=24) / 4095.0 * WHITE
    for seed in range(3):
        told = misinformed(scene, np.random.default_rng(seed))
        found = locate(brighter(signal, factor, seed), told, "photometric", noise=NOISE)
        assert isinstance(found, Localization), found.reason
        assert square(found, pose) < 21.1  # 99.99 % of chi-squared of three degrees
        # small as it is, the patch is not held on the RCM that is told
        assert math.sqrt(float(found.covariance[3, 3])) > 1e-4


RECORDER = Recorded(camera=Linear(bits=12), quality=85, range="limited")


def recorded(signal, seed):
    """A frame of eight bits that went through JPEG, of `signal` electrons."""
    codes = np.round(RECORDER.code(brighter(signal, 0.8, seed) / 4095.0)).astype(np.uint8)
    file = cv2.imencode(".jpg", codes, [cv2.IMWRITE_JPEG_QUALITY, RECORDER.quality])[1]
    return cv2.imdecode(file, cv2.IMREAD_GRAYSCALE)


def dark(scene, pose):
    """Electrons over an even retina with a tenth of the ambient light."""
    return electrons(scene, pose, None) - 0.9 * AMBIENT * ground(scene.camera.resolution)[1]


def test_what_a_jpeg_rounds_at_the_foot_of_an_edge_is_predicted():
    """It brightens the dark foot of a step all around, and moved tips along the axis."""
    scene = scene_of(HardBeam(), resolution=500).model_copy(update={"sensor": RECORDER})
    pose = scene.pose(np.array([1.0, 0.5, 4.0]))
    signal = dark(scene, pose)
    frame = Frame(recorded(signal, 0), RECORDER)
    band = Ribbon.along(frame, Estimate(pose, scene), side=1, inner=5.0, outer=3.0)
    rounding, _ = Rounding.of(frame, band, RECORDER.noise)
    model = 0.8 * signal[band.at.row + band.cells[0], band.at.column + band.cells[1]] / WHITE
    foot = (model > 0.003) & (model < 0.05)
    seen, mended = (
        RECORDER.code(np.maximum(shown.signal[foot], 0.0)) - RECORDER.code(model[foot])
        for shown in (band.shown[0], rounding.without(model))
    )
    assert seen.mean() > 2.0
    assert abs(mended.mean()) < 1.0
    assert mended.std() < 0.7 * seen.std()


@pytest.mark.slow
def test_what_a_jpeg_rounds_at_hard_edges_is_in_the_model_and_nearly_in_the_ellipsoids():
    """88 of 100 ellipsoids hold, where 95 should; as noise alone 76 did, with 1.8 a coordinate."""
    scene, rng, squares = scene_of(HardBeam(), resolution=500), np.random.default_rng(6), []
    noise = replace(RECORDER.noise, electrons=WHITE, read=READ)
    for seed in range(100):
        pose = scene.pose(rng.uniform((-1.5, -1.5, 3.0), (1.5, 1.5, 4.5)))
        told = misinformed(scene, rng).model_copy(update={"sensor": RECORDER})
        found = locate(recorded(dark(scene, pose), seed), told, "photometric", noise=noise)
        assert found, found.reason
        squares.append(square(found, pose))
    assert np.mean(squares) / 3.0 < 1.5
    assert sum(value < chi2.ppf(0.95, 3) for value in squares) > 82


def holds(squares):
    """Whether the 99 % interval of a binomial contains 95 % of the answers."""
    inside = sum(value < chi2.ppf(0.95, 3) for value in squares)
    return binom.cdf(inside, len(squares), 0.95) > 0.005 and binom.sf(inside - 1, len(squares), 0.95) > 0.005


def test_a_half_angle_that_is_told_wrongly_with_its_sigma_leaves_hard_tips_in_their_ellipsoids():
    """9.2 deg +- 0.2 where 9 is true: 60 to 80 um off along the axis if it is held."""
    scene, rng = scene_of(HardBeam(), resolution=400), np.random.default_rng(8)
    squares = []
    for number in range(12):
        pose = scene.pose(rng.uniform((-1.5, -1.5, 3.0), (1.5, 1.5, 4.5)))
        told = misinformed(scene, rng).model_copy(update={"beam": scene.beam.stretched(math.radians(9.2))})
        frame = brighter(electrons(scene, pose, None), 1.0, number)
        found = locate(frame, told, "cone", noise=NOISE, knowns=Knowns(half_angle_sigma_deg=0.2))
        assert isinstance(found, Localization), found.reason
        squares.append(square(found, pose))
    assert holds(squares), squares


@pytest.mark.slow
@pytest.mark.parametrize(
    ("beam", "contrast", "factor"),
    [(HardBeam(), 0.0, 1.0), (HardBeam(), 0.0, 1.4), (HardBeam(), 0.2, 1.0), (CyclesBeam(), 0.0, 1.0),
     (CyclesBeam(), 0.2, 1.0)],
    ids=["hard", "hard, clipped in part", "hard on texture", "soft", "soft on texture"],
)  # fmt: skip
def test_ellipsoids_of_95_percent_hold_95_percent_of_the_tips(beam, contrast, factor):
    scene, rng = scene_of(beam, resolution=500), np.random.default_rng(5)
    squares, refused = [], 0
    for number in range(30 if contrast else 8):
        pose = scene.pose(rng.uniform((-1.5, -1.5, 3.0), (1.5, 1.5, 4.5)))
        texture = fundus(contrast, number) if contrast else None
        signal = electrons(scene, pose, texture)
        for seed in range(2 if contrast else 12):
            found = locate(
                brighter(signal, factor, [number, seed]), misinformed(scene, rng), "photometric", noise=NOISE
            )
            if found:
                squares.append(square(found, pose))
            else:
                refused += 1
    assert refused <= 0.02 * len(squares)
    assert holds(squares), np.mean([value < chi2.ppf(0.95, 3) for value in squares])
