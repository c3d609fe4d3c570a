"""Fixed pattern: what EMVA 1288 measures of a camera's frames is what the description says."""

from __future__ import annotations

import numpy as np
import pytest

from conespot.render.fixed_pattern import unevenness
from conespot.render.readout import expose
from conespot.scene.emva import Emva
from conespot.scene.fixed_pattern import FixedPattern, Nonuniformity

PATTERN = FixedPattern(
    serial=12,
    dsnu=Nonuniformity(pixel=20.0, row=8.0, column=12.0),
    prnu=Nonuniformity(pixel=0.02, row=0.008, column=0.012),
)
#: no step of a digital number is larger than a tenth of an electron, nothing clips
CAMERA = Emva(bits=16, gain=10.0, full_well=6000.0, black_level=1000.0, read_noise=5.0, fixed_pattern=PATTERN)


def mean_electrons(camera: Emva, light: float, frames: int = 24, side: int = 240) -> np.ndarray:
    """The mean of frames `[side, side]` [e-] in an even light of so many electrons."""
    signal = np.full((side, side, 1), light / camera.electrons_per_signal, np.float32)
    total = sum(expose(signal, camera, seed).astype(float) for seed in range(frames))
    return (total / frames - camera.black_level) / camera.gain


def split(mean: np.ndarray, temporal: float) -> tuple[float, float, float]:
    """Variances over pixels, rows and columns of a mean frame, EMVA 1288 release 4, with its noise `temporal` off."""
    rows, columns = mean.shape
    pixel = np.var(mean - mean.mean(axis=1, keepdims=True) - mean.mean(axis=0, keepdims=True) + mean.mean())
    pixel *= mean.size / ((rows - 1) * (columns - 1))
    by_row = np.var(mean.mean(axis=1), ddof=1) - pixel / columns
    by_column = np.var(mean.mean(axis=0), ddof=1) - pixel / rows
    return pixel - temporal, by_row, by_column


@pytest.mark.parametrize(("light", "nonuniformity"), [(0.0, PATTERN.dsnu), (4000.0, PATTERN.prnu)])
def test_rows_columns_and_pixels_scatter_as_emva_1288_would_measure(light: float, nonuniformity: Nonuniformity) -> None:
    """Mean of 24 frames in the dark and in the light: the split variances against the stated ones, within 4 sigma."""
    frames = 24
    dark = mean_electrons(CAMERA, 0.0, frames)
    mean = mean_electrons(CAMERA, light, frames) - (dark if light else 0.0)
    scale = light or 1.0
    noise = (light + 2.0 * CAMERA.read_noise**2 if light else CAMERA.read_noise**2) / frames
    found = split(mean, noise)
    stated = [scale * s for s in (nonuniformity.pixel, nonuniformity.row, nonuniformity.column)]
    side = len(mean)
    for variance, sigma, number in zip(found, stated, (side**2, side, side), strict=True):
        assert variance == pytest.approx(sigma**2, rel=4.0 * np.sqrt(2.0 / number) + 0.01)


def test_a_crop_has_the_pattern_of_the_whole_frame_and_another_serial_another_one() -> None:
    whole = unevenness(PATTERN, 0, 0, (40, 50))
    crop = unevenness(PATTERN, 7, 11, (20, 30))
    other = unevenness(PATTERN.model_copy(update={"serial": 13}), 0, 0, (40, 50))
    np.testing.assert_array_equal(crop.response, whole.response[7:27, 11:41])
    np.testing.assert_array_equal(crop.offset, whole.offset[7:27, 11:41])
    assert abs(np.corrcoef(whole.offset.ravel(), other.offset.ravel())[0, 1]) < 0.3


def test_frames_share_their_pattern_and_not_their_noise() -> None:
    signal = np.full((64, 64, 1), 2000.0 / CAMERA.electrons_per_signal, np.float32)
    one, two = (expose(signal, CAMERA, seed).astype(float) for seed in (1, 2))
    even = CAMERA.model_copy(update={"fixed_pattern": None})
    three, four = (expose(signal, even, seed).astype(float) for seed in (1, 2))
    assert np.corrcoef(one.ravel(), two.ravel())[0, 1] > 0.3
    assert abs(np.corrcoef(three.ravel(), four.ravel())[0, 1]) < 0.08


def test_dead_pixels_show_the_dark_and_hot_ones_shine_in_it() -> None:
    pattern = FixedPattern(hot=0.01, hot_current=2e5, dead=0.02)
    camera = CAMERA.model_copy(update={"fixed_pattern": pattern, "exposure_time": 0.01})
    bright = mean_electrons(camera, 4000.0, frames=1)
    dark = mean_electrons(camera, 0.0, frames=1)
    assert np.mean(bright < 100.0) == pytest.approx(0.02, abs=0.003)
    assert np.mean(dark > 1500.0) == pytest.approx(0.01, abs=0.002)
    assert np.median(dark[dark > 1500.0]) == pytest.approx(2000.0, rel=0.05)


def test_without_a_pattern_nothing_changes() -> None:
    signal = np.full((30, 30, 1), 1000.0 / CAMERA.electrons_per_signal, np.float32)
    even = CAMERA.model_copy(update={"fixed_pattern": FixedPattern()})
    none = CAMERA.model_copy(update={"fixed_pattern": None})
    np.testing.assert_array_equal(expose(signal, even, 5), expose(signal, none, 5))


def test_a_pattern_is_drawn_once_and_nobody_can_change_it_for_the_frames_to_come():
    """The same crop of an equal sensor, asked for twice."""
    first = unevenness(PATTERN, 0, 0, (8, 9))
    assert unevenness(PATTERN.model_copy(), 0, 0, (8, 9)) is first
    for plane in (first.response, first.offset, first.dark_current):
        with pytest.raises(ValueError, match="read-only"):
            plane += 1.0
