"""The edge fit on frames of the image model itself: how near the bound it is, and whether its covariance is honest."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from conespot.localize import Knowns, SensorNoise
from conespot.localize.edge.fit import fit_edge
from conespot.localize.edge.ribbon import Ribbon
from conespot.localize.edge.rim import Rim
from conespot.localize.edge.saturated import SaturatedFit
from conespot.localize.edge.strips import Strips, score_covariance
from conespot.localize.image import Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import ambient_irradiance, light, moved
from conespot.localize.model.profile import Profile
from conespot.localize.model.residual import RESIDUAL, log_likelihood
from conespot.localize.model.sight import look, window
from conespot.localize.model.view import outline
from conespot.localize.theory.bounds import cramer_rao
from conespot.scene import Pose, Scene, load_scene
from conespot.scene.beam import CyclesBeam, HardBeam, LinearBeam
from conespot.scene.camera import Camera
from conespot.scene.sensor import Linear, Srgb8
from conespot.scene.spotlights import RIGS
from conespot.scene.surface import Surface
from conespot.scene.vignetting import seen_whole

PEAK, AMBIENT, READ = 9000.0, 200.0, 15.0
NOISE = SensorNoise(levels=4095, electrons=1.25 * PEAK, read=READ)
TIPS = np.array([[1.0, 0.5, 4.0], [-1.5, -1.0, 3.0], [0.4, -2.0, 4.5], [-0.6, 1.2, 5.0]])


def radiance(scene, pose, albedo=lambda points: 1.0):
    """Where the patch is (row, column), and its ambient and its spotlight radiance `[h, w]`, both times the albedo."""
    low, high = (
        f(scene.camera.project(scene.outline(pose, 0)), axis=0).astype(int) + margin
        for f, margin in ((np.min, -12), (np.max, 12))
    )
    size = high - low
    sight = look(scene, window(low[1], low[0], size[1], size[0]))
    colour = albedo(sight.points)
    spot = light(sight, pose, scene, Profile.of(scene.beam)).value
    shape = (size[1], size[0])
    return low[::-1], (colour * ambient_irradiance(sight, scene)).reshape(shape), (colour * spot).reshape(shape)


def counted(scene, pose, seed, albedo=lambda points: 1.0):
    """A 12-bit frame with shot and read noise; only around the patch is anything shown."""
    corner, ambient, spot = radiance(scene, pose, albedo)
    rng = np.random.default_rng(seed)
    electrons = AMBIENT * ambient + PEAK * spot / np.quantile(spot, 0.998)
    electrons = rng.poisson(electrons) + READ * rng.standard_normal(electrons.shape)
    return placed(scene, corner, np.clip(np.round(electrons / (1.25 * PEAK) * 4095.0), 0, 4095).astype(np.uint16))


def clipped(scene, pose, contrast, ambient_level=0.02, albedo=lambda points: 1.0):
    """An 8-bit sRGB frame on which the spotlight is `contrast` times the ambient light, cut off at white."""
    corner, ambient, spot = radiance(scene, pose, albedo)
    lit = np.clip(ambient_level * (ambient + contrast * spot / spot.max()), 0.0, 1.0)
    code = np.where(lit <= 0.0031308, 12.92 * lit, 1.055 * np.maximum(lit, 1e-9) ** (1.0 / 2.4) - 0.055)
    return placed(scene, corner, np.round(255.0 * code).astype(np.uint8))


def placed(scene, corner, cut):
    image = np.full((scene.camera.resolution,) * 2, np.median(cut[0]), cut.dtype)
    image[corner[0] : corner[0] + cut.shape[0], corner[1] : corner[1] + cut.shape[1]] = cut
    return image


def near(pose, seed, step=(0.02, 0.02, 0.03, 1e-3, 1e-3)):
    return moved(pose, np.random.default_rng(seed).choice([-1.0, 1.0], 5) * np.array(step))


def fitted(image, scene, start, knowns, noise):
    return fit_edge(Frame(image, scene.sensor), Estimate(start, scene), knowns, noise)


def test_an_albedo_that_varies_slowly_under_a_soft_edge_speaks_against_no_beam():
    """It looks like a turned axis, and then the beam like a narrower one: its score was 7.5 of its sigmas."""
    scene = Scene(beam=CyclesBeam(), camera=Camera(resolution=1000), sensor=Linear(bits=12))
    pose = scene.pose(TIPS[1])
    image = counted(
        scene, pose, 1, lambda points: 1.0 + 0.08 * np.sin(1.3 * points[:, 0] + 0.5) * np.cos(0.9 * points[:, 1])
    )
    fit = fitted(image, scene, near(pose, 1), Knowns(), NOISE)
    assert chi_square(fit, pose) < 11.3
    assert all(abs(score) < 3.0 for score in fit.suspicions(scene).values())


def error(fit, pose):
    return 1e3 * float(np.linalg.norm(fit.estimate.pose.apex - pose.apex))


def chi_square(fit, pose):
    off = fit.estimate.pose.apex - pose.apex
    return float(off @ np.linalg.solve(fit.covariance[:3, :3], off))


def vessels(points):
    """Albedo with dark stripes a quarter of a millimetre apart."""
    return 1.0 - 0.4 * np.exp(-np.square(np.sin(12.0 * points[:, 0] + 3.0 * points[:, 1])) / 0.05)


@pytest.mark.parametrize("beam", [HardBeam(), CyclesBeam()], ids=["hard", "soft"])
def test_over_a_uniform_retina_the_error_is_near_the_bound_and_stated(beam):
    scene = Scene(beam=beam, camera=Camera(resolution=1000), sensor=Linear(bits=12))
    errors, bounds, chi = [], [], []
    for k, tip in enumerate(TIPS):
        pose = scene.pose(tip)
        bounds += [1e3 * cramer_rao(scene, pose, knowns=Knowns(rcm_sigma_mm=0.01)).position_mm] * 10
        for seed in range(10):
            fit = fitted(counted(scene, pose, 100 * k + seed), scene, near(pose, seed), Knowns(0.01), NOISE)
            errors.append(error(fit, pose))
            chi.append(chi_square(fit, pose))
            assert fit.settled
    ratio = np.sqrt(np.mean(np.square(errors)) / np.mean(np.square(bounds)))
    assert ratio < 1.5
    assert np.mean(np.array(chi) < 7.815) >= 0.85
    assert np.mean(chi) > 0.3 * 3.0


def test_vessels_across_a_hard_edge_widen_the_covariance_and_stay_inside_it():
    scene = Scene(beam=HardBeam(), camera=Camera(resolution=1000), sensor=Linear(bits=12))
    pose = scene.pose(TIPS[0])
    plain = fitted(counted(scene, pose, 1), scene, near(pose, 1), Knowns(None), NOISE)
    striped = fitted(counted(scene, pose, 1, vessels), scene, near(pose, 1), Knowns(None), NOISE)
    assert np.trace(striped.covariance[:3, :3]) > np.trace(plain.covariance[:3, :3])
    assert chi_square(striped, pose) < 11.3


@pytest.mark.parametrize("contrast", [300.0, 3000.0, 30000.0])
def test_a_sharp_patch_clipped_throughout_without_a_stated_noise_is_measured_by_its_clipped_pixels(contrast):
    scene = Scene(beam=HardBeam(), camera=Camera(resolution=1000), sensor=Srgb8())
    for k, tip in enumerate(TIPS):
        pose = scene.pose(tip)
        fit = fitted(clipped(scene, pose, contrast), scene, near(pose, k), Knowns(0.01), scene.sensor.noise)
        assert isinstance(fit, SaturatedFit)
        assert fit.settled
        assert error(fit, pose) < 15.0
        assert chi_square(fit, pose) < 11.3


def test_channels_that_clip_at_different_places_are_fitted_jointly():
    scene = Scene(beam=CyclesBeam(), camera=Camera(resolution=1000), sensor=Srgb8())
    pose = scene.pose(TIPS[1])
    contrasts = (2000.0, 500.0, 60.0)
    colour = np.stack([clipped(scene, pose, c, albedo=vessels) for c in contrasts], axis=-1)
    fit = fitted(colour, scene, near(pose, 2), Knowns(0.01), scene.sensor.noise)
    assert len(fit.gains) == 3
    assert np.all(np.diff(fit.gains) < 0.0)
    assert error(fit, pose) < 5.0


def test_an_unknown_bump_under_the_outline_moves_the_tip_by_a_few_micrometres():
    rough = Scene(beam=HardBeam(), camera=Camera(resolution=1000), sensor=Linear(bits=12), surface="bumps-literal")
    smooth = rough.model_copy(update={"surface": Surface()})
    pose = smooth.pose(np.array([-1.72, 0.07, 2.87]))
    displaced = np.linalg.norm(
        rough.camera.project(rough.outline(pose, 0)) - smooth.camera.project(smooth.outline(pose, 0)), axis=1
    )
    assert displaced.max() > 0.5
    fit = fitted(counted(rough, pose, 3), smooth, near(pose, 3), Knowns(0.01), NOISE)
    assert error(fit, pose) < 5.0
    assert chi_square(fit, pose) < 11.3


@pytest.mark.parametrize(
    "spectrum",
    [
        lambda m: np.ones(160),
        lambda m: 1.0 / np.abs(1.0 - 0.9 * np.exp(2j * np.pi * m / 160)) ** 2,
        lambda m: 1.0 + 20.0 / np.square(1.0 + np.square(m / 4.0)),
    ],
    ids=["white", "a step in ten forgotten", "falling with the fourth power"],
)
def test_the_covariance_of_correlated_strips_holds_for_the_harmonics_the_fit_takes_away(spectrum):
    rng = np.random.default_rng(4)
    count, angle = 160, np.arange(160) * 2.0 * np.pi / 160
    rows = np.stack([np.ones(count), np.cos(angle), np.sin(angle)], axis=1)
    parts = np.einsum("sp,sq->spq", rows, rows)
    strips = Strips(np.arange(count), np.zeros(count), np.arange(count), (slice(0, count),))
    power = spectrum(np.minimum(np.arange(count), count - np.arange(count)))
    chi = []
    for _ in range(150):
        series = np.real(np.fft.ifft(np.fft.fft(rng.standard_normal(count)) * np.sqrt(power)))
        step = np.linalg.solve(rows.T @ rows, rows.T @ series)
        meat = score_covariance(strips, (series - rows @ step)[:, None] * rows, parts)
        covariance = np.linalg.solve(rows.T @ rows, np.linalg.solve(rows.T @ rows, meat).T)
        chi.append(step @ np.linalg.solve(covariance, step) / 3.0)
    assert 0.6 < np.mean(chi) < 1.6


@given(
    st.sampled_from([HardBeam(), CyclesBeam(), LinearBeam()]),
    st.floats(-0.2, 1.2),
    st.floats(0.01, 0.3),
    st.floats(0.01, 0.3),
)
def test_a_pixels_mean_of_the_profile_is_its_integral(beam, where, wide, high):
    profile = Profile.of(beam)
    span = profile.knots[-1] - profile.knots[0] if len(profile.knots) > 1 else 1e-3
    w, p, q = (np.array([x]) for x in (profile.knots[0] + where * span, wide * span, high * span))
    mean, slope = profile.mean(w, p, q)
    nodes = (np.arange(400) + 0.5) / 200.0 - 1.0
    offsets = (wide * nodes[:, None] + high * nodes) * span
    assert abs(mean[0] - profile.value(w[0] + offsets).mean()) < 2e-3
    step = 1e-5 * span
    sides = [profile.mean(w + s, p, q)[0][0] for s in (step, -step)]
    assert slope[0] * span == pytest.approx((sides[0] - sides[1]) / 2e-5, rel=2e-2, abs=2e-2)


def test_strips_that_cannot_be_told_leave_no_covariance_and_no_error():
    strips = Strips(np.arange(40), np.zeros(40), np.arange(40), (slice(0, 40),))
    parts = np.tile(np.eye(2), (40, 1, 1))
    parts[3, 0, 0] = np.nan
    assert np.all(np.isinf(score_covariance(strips, np.ones((40, 2)), parts)))


def test_bins_whose_light_the_iris_cuts_take_no_part():
    """Three patches near the rim of the theatre's pupil: of one the ray through the lens' middle sees two thirds."""
    scene = load_scene("theatre")
    scene = scene.model_copy(update={"camera": scene.camera.with_columns(640), "spotlights": RIGS["triple"]})
    at = Estimate(Pose.through(np.array([-1.477, 0.26, 4.117]), np.asarray(scene.instrument.rcm)), scene)
    frame = Frame(np.zeros(scene.camera.shape, np.uint8), scene.sensor)
    band = Ribbon.along(frame, at, side=1, inner=4.0, outer=4.0)
    assert band is not None
    assert seen_whole(scene.camera, band.pixels).all()
    whole, shown = (
        np.mean([by(scene.camera.project(scene.outline(at.pose, k, 90))).mean() for k in range(3)])
        for by in (lambda q: seen_whole(scene.camera, q), scene.camera.shows)
    )
    assert band.covered == pytest.approx(whole, abs=0.02)
    assert whole < shown - 0.1
    # a fit that follows has no such bins to leave out
    followed = [Rim.about(outline(at, k, 64), scene, 1, 4.0, 4.0) is not None for k in range(3)]
    assert followed == [seen_whole(scene.camera, outline(at, k, 64)).all() for k in range(3)]
    assert set(followed) == {True, False}


def test_a_mean_log_likelihood_is_that_of_normal_residuals_with_gross_ones_cut():
    """Against scipy's normal density; what is 40 sigmas off counts as it does at the cut."""
    rng = np.random.default_rng(0)
    sigma = rng.uniform(0.02, 0.3, 500)
    whitened = np.append(rng.standard_normal(499), 40.0)
    kept = np.clip(whitened, -RESIDUAL.gross, RESIDUAL.gross)
    expected = norm.logpdf(kept * sigma, scale=sigma).mean()
    assert log_likelihood(whitened, np.square(sigma)) == pytest.approx(expected, rel=1e-12)


def test_an_edge_over_vessels_is_less_likely_than_over_an_even_retina():
    scene = Scene(beam=HardBeam(), camera=Camera(resolution=1000), sensor=Linear(bits=12))
    pose = scene.pose(TIPS[0])
    even, striped = (
        fitted(counted(scene, pose, 1, *albedo), scene, near(pose, 1), Knowns(0.01), NOISE)
        for albedo in ((), (vessels,))
    )
    assert even.likelihood > striped.likelihood + 0.1
