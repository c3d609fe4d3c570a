"""Residual blur and glare of pictures that are known in closed form."""

import numpy as np
import pytest
from scipy.special import erf

from conespot.render.blur import Blur, weights
from conespot.render.exposure import Exposure
from conespot.render.tile import Crop, Tile
from conespot.scene import Camera
from conespot.scene.lens import Lens
from conespot.scene.point_spread import GaussianSpread, TabulatedSpread
from conespot.scene.sensor import Linear

PITCH = Camera(resolution=400).pixel_pitch


def gaussian_table(sigma):
    radii = np.linspace(0.0, 5.0 * sigma, 200)
    return TabulatedSpread(radii=tuple(radii), values=tuple(np.exp(-((radii / sigma) ** 2) / 2.0)))


def blurred(spread, glare=0.0, **camera):
    return Blur(Camera(**{"resolution": 400, "lens": Lens(blur=spread, glare=glare), **camera}), rays=False)


@pytest.mark.parametrize("kind", ["gaussian", "table"])
@pytest.mark.parametrize(("sigma", "within"), [(1.0, 0.02), (2.0, 0.006), (4.0, 0.002)])
def test_a_knife_edge_becomes_an_error_function(kind, sigma, within):
    """A straight edge within a pixel, its values means over pixels; against the means of the error function.

    What is left is the sharp picture's sampling: it falls with the square of sigma, whatever the weights.
    """
    spread = GaussianSpread(sigma=sigma * PITCH) if kind == "gaussian" else gaussian_table(sigma * PITCH)
    at = 200.3
    x = np.arange(400)
    sharp = np.tile(np.clip(x + 1.0 - at, 0.0, 1.0), (400, 1)).astype(np.float32)[..., None]
    row = blurred(spread).frame(sharp)[200, :, 0]
    fine = np.arange(400 * 64) / 64.0 + 1.0 / 128.0
    expected = (0.5 + 0.5 * erf((fine - at) / (np.sqrt(2.0) * sigma))).reshape(400, 64).mean(axis=1)
    assert np.abs(row - expected).max() < within


@pytest.mark.parametrize("sigma", [0.01, 0.1, 0.3, 0.6, 1.0, 3.0])
def test_weights_have_the_spreads_own_variance(sigma):
    """Second moments of the weights along both sides of an oblong pixel, against sigma squared in pixels."""
    found = weights(GaussianSpread(sigma=1e-2 * sigma), 0.8e-2, 1e-2)
    assert found.sum() == pytest.approx(1.0, abs=1e-12)
    assert found.min() >= 0.0
    for axis, pitch in ((0, 0.8), (1, 1.0)):
        profile = found.sum(axis=axis)
        places = np.arange(len(profile)) - len(profile) // 2
        expected = (sigma / pitch) ** 2
        assert np.sum(profile * places**2) == pytest.approx(expected, rel=2e-4, abs=1e-6)


def test_a_table_keeps_its_own_spread():
    """A cone of 6 px, and a core with a wide halo; second moments per axis against 3 r^2 / 20 and the sum's, 1 %."""
    cone = TabulatedSpread(radii=(0.0, 6e-3), values=(1.0, 0.0))
    radii = np.linspace(0.0, 40.0, 800)
    light = np.exp(-(radii**2) / 2.0) + 0.01 * np.exp(-(radii**2) / 2.0 / 64.0)  # of 1 px, and of 8 px
    halo = TabulatedSpread(radii=tuple(1e-3 * radii), values=tuple(light))
    for spread, expected in ((cone, 3.0 * 6.0**2 / 20.0), (halo, (1.0 + 0.01 * 64.0 * 64.0) / (1.0 + 0.01 * 64.0))):
        profile = weights(spread, 1e-3, 1e-3).sum(axis=0)
        places = np.arange(len(profile)) - len(profile) // 2
        assert np.sum(profile * places**2) == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("spread", [GaussianSpread(sigma=2.0 * PITCH), gaussian_table(2.0 * PITCH)])
@pytest.mark.parametrize("crop", [Crop(100, 120, 30, 20), Crop(0, 390, 12, 10)])
def test_no_light_is_lost(spread, crop):
    """Sum of a tile in the middle and one in the frame's corner, before and after, to 1e-6, with glare too."""
    rng = np.random.default_rng(0)
    sharp = Tile(crop, rng.uniform(0.0, 1.0, (crop.height, crop.width, 3)).astype(np.float32))
    before = sharp.radiance.sum(axis=(0, 1), dtype=float)
    after = blurred(spread).tile(sharp)
    assert after.radiance.sum(axis=(0, 1), dtype=float) == pytest.approx(before, rel=1e-6)
    scattered = blurred(spread, glare=0.1).tile(sharp)
    total = scattered.radiance.sum(axis=(0, 1), dtype=float) + 400.0**2 * scattered.glare
    assert total == pytest.approx(before, rel=1e-6)


def test_a_tile_and_a_frame_are_spread_alike():
    """A tile, blurred and laid into a black frame, against the frame with the sharp tile blurred whole."""
    rng = np.random.default_rng(1)
    blur = blurred(GaussianSpread(sigma=1.5 * PITCH), glare=0.05)
    for crop in (Crop(100, 120, 30, 20), Crop(380, 0, 20, 25)):
        sharp = Tile(crop, rng.uniform(0.0, 1.0, (crop.height, crop.width, 1)).astype(np.float32))
        frame, laid = np.zeros((2, 400, 400, 1), np.float32)
        frame[crop.slices] = sharp.radiance
        tile = blur.tile(sharp)
        laid += tile.glare
        laid[tile.crop.slices] += tile.radiance
        np.testing.assert_allclose(laid, blur.frame(frame), atol=1e-6)


def test_glare_is_its_share_of_the_mean_everywhere():
    """A frame of two tiles on an uneven background at 0.3 W, against (1 - g) L + g mean(L), as the sensor has it."""
    rng = np.random.default_rng(2)
    glare, power = 0.03, 0.3
    blur = blurred(None, glare)
    background = rng.uniform(0.0, 0.2, (400, 400, 1)).astype(np.float32)
    tiles = [Tile(Crop(50, 60, 70, 80), rng.uniform(0.0, 1.0, (70, 80, 1)).astype(np.float32)) for _ in range(2)]
    total = background.copy()
    for tile in tiles:
        total[tile.crop.slices] += np.float32(power) * tile.radiance
    sensor = Linear(bits=16)
    expected = (1.0 - glare) * total + glare * total.mean(dtype=float)
    exposure = Exposure(blur.frame(background), sensor)
    frame = exposure.frame([blur.tile(tile) for tile in tiles], power)
    values = np.clip(expected[..., 0] / sensor.white, 0.0, 1.0) * sensor.full_scale
    assert np.abs(frame - values).max() < 0.6
    with exposure.shown([blur.tile(tile) for tile in tiles], power) as shown:
        np.testing.assert_array_equal(shown, frame)
    with exposure.shown((), 0.0) as dark:  # it was taken back everywhere
        np.testing.assert_array_equal(dark, exposure.frame((), 0.0))


def test_noise_of_single_pixels_falls_as_said():
    """Standard deviation of white noise through the weights, against `steadiness`, 3 %."""
    blur = blurred(GaussianSpread(sigma=1.5 * PITCH))
    noise = np.random.default_rng(3).normal(1.0, 0.1, (400, 400, 1)).astype(np.float32)
    assert noise.std() / blur.frame(noise).std() == pytest.approx(blur.steadiness, rel=0.03)
