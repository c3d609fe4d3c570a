"""The EMVA 1288 camera against the standard's own equations and its data sheet."""

import math

import numpy as np
import pytest
from scipy.stats import poisson as exact_poisson

from conespot.render import Crop, Exposure, Tile
from conespot.render.readout import demosaic, expose, metered_time, mosaic, normal_pairs, poisson
from conespot.scene import InputError
from conespot.scene.document import Document
from conespot.scene.emva import EMVA_PRESETS, BandPass, Emva, LongPass, Metering
from conespot.scene.illumination import LIGHTS, FlatBand
from conespot.scene.scene import read_scene
from conespot.scene.sensor import SENSORS, sensor_name
from conespot.scene.spectrum import tabulated


def photon_transfer(sensor: Emva, electrons: np.ndarray, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Mean and temporal variance of the values at mean electrons, from pairs of frames (EMVA 1288, 6.6)."""
    means, variances = [], []
    for k, level in enumerate(electrons):
        signal = np.full((400, 500, 1), (level - sensor.dark_current * sensor.exposure_time), np.float32)
        signal /= np.float32(sensor.electrons_per_signal)
        a, b = (expose(signal, sensor, seed + 2 * k + i).astype(float) for i in (0, 1))
        means.append((a.mean() + b.mean()) / 2.0)
        variances.append(np.mean((a - b) ** 2) / 2.0)
    return np.array(means), np.array(variances)


@pytest.mark.parametrize("chip", ["cmv12000-mono", "cmv12000-nir"])
def test_photon_transfer_gives_the_gain(chip):
    """Slope of variance over mean below 70 % of saturation; against the gain; within 1 %."""
    sensor = EMVA_PRESETS[chip]
    mean, variance = photon_transfer(sensor, np.linspace(200.0, 0.7 * sensor.saturation, 12))
    slope = np.polyfit(mean - sensor.black_level, variance, 1, w=1.0 / variance)[0]
    assert slope == pytest.approx(sensor.gain, rel=0.01)


def test_variance_follows_the_standard_at_every_level():
    """Variance at means of 2 to 9000 e-; against K^2 (read^2 + electrons) + 1/12; within 2 %, four sigmas."""
    sensor = Emva()
    electrons = np.array([2.0, 10.0, 29.0, 31.0, 100.0, 1000.0, 9000.0])
    _, variance = photon_transfer(sensor, electrons)
    expected = sensor.gain**2 * (sensor.read_noise**2 + electrons) + 1.0 / 12.0
    assert variance == pytest.approx(expected, rel=0.02)


def test_read_noise_in_the_dark():
    """Deviation of a dark frame; against 13 e- read noise with the dark current's shot noise and the rounding; 1 %."""
    sensor = Emva()
    dark = expose(np.zeros((500, 500, 1), np.float32), sensor, 5)
    electrons = math.sqrt(dark.var() - 1.0 / 12.0) / sensor.gain
    assert electrons == pytest.approx(math.sqrt(13.0**2 + 0.7), rel=0.01)
    assert dark.mean() == pytest.approx(sensor.black_level + 0.7 * sensor.gain, abs=0.05)


def test_saturation_is_the_full_well_or_the_converter():
    """Far too much light; against full well times gain, or 2^bits - 1 where the gain is higher."""
    bright = np.full((50, 50, 1), 1e6, np.float32)
    well = Emva(read_noise=0.0)
    assert np.all(expose(bright, well, 1) == round(well.full_well * well.gain + well.black_level))
    assert np.all(expose(bright, Emva(gain=1.0), 1) == 4095)
    assert Emva(gain=1.0).saturation == pytest.approx(4095 - 32)
    assert expose(bright, Emva(bits=8, gain=0.01), 1).dtype == np.uint8


def test_electrons_follow_the_standard_s_photon_count():
    """Electrons of 550 nm light; against 50.34 A t lambda E times the quantum efficiency (EMVA 1288, eq. 4); 0.1 %."""
    sensor = Emva(lens_transmission=1.0)
    radiance = 0.7  # W m-2 sr-1
    irradiance = math.pi * radiance / (4.0 * sensor.f_number**2) * 100.0  # uW/cm2
    photons = 50.34 * 5.5**2 * 10.0 * 0.550 * irradiance
    responsivity = float(sensor.responses["mono"](550.0))
    efficiency = responsivity * 1239.84 / 550.0
    assert radiance * responsivity * sensor.electrons_per_signal == pytest.approx(photons * efficiency, rel=1e-3)
    assert efficiency == pytest.approx(0.45, abs=0.02)  # the trace's 45 % near 555 nm


@pytest.mark.parametrize("mean", [0.003, 0.3, 4.0, 29.0, 31.0, 300.0])
def test_counts_are_poisson(mean):
    """Frequencies of 400,000 counts; against the exact distribution's cumulative one; Kolmogorov distance < 0.004."""
    normal, _ = normal_pairs(7, 0, 0, (400, 1000))
    counts = poisson(np.full(normal.shape, mean, np.float32), normal).ravel()
    k = np.arange(int(mean + 8 * math.sqrt(mean) + 8))
    ours = np.searchsorted(np.sort(counts), k, side="right") / counts.size
    assert np.max(np.abs(ours - exact_poisson.cdf(k, mean))) < 0.004


def test_a_pixel_s_noise_does_not_depend_on_the_crop():
    """A crop exposed alone, at even and odd offsets; against the same pixels of the full frame; equal bit for bit."""
    rng = np.random.default_rng(0)
    for name in ("cmv12000-mono", "cmv12000-rgb"):
        sensor = EMVA_PRESETS[name]
        frame = rng.random((150, 160, len(sensor.responses))).astype(np.float32) * 1e-1
        full = expose(frame, sensor, 11)
        for row, column in ((3, 5), (140, 100), (0, 159)):
            crop = expose(frame[row : row + 9, column : column + 30], sensor, 11, row, column)
            assert np.array_equal(crop, full[row : row + 9, column : column + 30])
        assert not np.array_equal(full, expose(frame, sensor, 12))


def test_frames_at_one_seed_repeat_and_seeds_differ():
    """Frames of an Exposure with a tile; against each other: same seed equal, another seed different noise."""
    sensor = EMVA_PRESETS["cmv12000-rgb"]
    background = np.full((40, 50, 3), 0.02, np.float32)
    tile = Tile(Crop(10, 12, 8, 9), np.full((8, 9, 3), 0.1, np.float32))
    exposure = Exposure(background, sensor)
    first = exposure.frame([tile], 1.0, seed=1)
    assert first.shape == (40, 50, 3)
    assert np.array_equal(first, exposure.frame([tile], 1.0, seed=1))
    assert not np.array_equal(first, exposure.frame([tile], 1.0, seed=2))
    assert first[12:16, 14:18].mean() > 2.0 * first[25:35, 30:45].mean()
    assert background.max() == np.float32(0.02)


def test_bayer_colours_come_back():
    """A flat colour through mosaic and interpolation; against itself, exactly."""
    flat = np.broadcast_to(np.array([100, 200, 50], np.uint16), (12, 14, 3))
    assert np.array_equal(demosaic(mosaic(flat, 0, 0)), flat)


def test_a_filter_passes_nothing_outside_its_band():
    """Responses behind a long-pass and a band-pass; against exactly 0 outside, and the bare chip inside."""
    bare = Emva(chip="cmv12000-nir").responses["mono"]
    long = Emva(chip="cmv12000-nir", filters=(LongPass(edge=800.0),)).responses["mono"]
    band = Emva(chip="cmv12000-nir", filters=(BandPass(low=830.0, high=870.0, transmission=0.5),)).responses["mono"]
    x = np.linspace(300.0, 1100.0, 8001)
    assert np.all(long(x[x < 800.0]) == 0.0)
    assert np.all(band(x[(x < 830.0) | (x > 870.0)]) == 0.0)
    assert long(850.0) == pytest.approx(float(bare(850.0)))
    assert band(850.0) == pytest.approx(0.5 * float(bare(850.0)))
    assert LIGHTS["led-b3"].spectrum.times(long).integral() == 0.0
    assert LIGHTS["line532"].spectrum.times(band).integral() == 0.0


@pytest.mark.parametrize("band", [(500.0, 600.0), (830.0, 870.0), (920.0, 960.0)])
def test_response_integrals(band):
    """Signal of a flat band behind the chip; against quantum efficiency times wavelength summed at 0.001 nm; 0.1 %."""
    sensor = Emva(chip="cmv12000-nir")
    signal = FlatBand(low=band[0], high=band[1]).spectrum.times(sensor.responses["mono"]).integral()
    x = np.linspace(*band, 100_001)
    truth = np.mean(tabulated("camera_qe_cmv12000", "qe_nir")(x) * x) / 1239.84
    assert signal == pytest.approx(truth, rel=1e-3)


def test_metering_puts_the_percentile_at_its_level():
    """A ramp of light, metered at the 90th percentile and 60 %; against electrons there; within 0.1 %."""
    sensor = Emva(metering=Metering(percentile=90.0, level=0.6))
    lit = np.linspace(0.0, 2.0, 10_001, dtype=np.float32)[:, None]
    time = metered_time(lit, sensor)
    rate = sensor.model_copy(update={"exposure_time": 1.0}).electrons_per_signal
    assert (1.8 * rate + sensor.dark_current) * time == pytest.approx(0.6 * sensor.saturation, rel=1e-3)
    kept = Exposure(np.zeros((9, 9, 1), np.float32), sensor).metered([], 1.0)
    assert kept == sensor


def test_sensors_are_named_in_files(tmp_path):
    """Names, and descriptions with filters, in a document; against the models; a misspelt one against a hint."""

    def sensor_of(sensor):
        return read_scene(Document("scene.yaml", {"sensor": sensor}, {}, tmp_path)).sensor

    assert sensor_of("cmv12000-nir") == SENSORS["cmv12000-nir"]
    changed = sensor_of(
        {
            "kind": "emva",
            "chip": "cmv12000-nir",
            "exposure_time": "5 ms",
            "filters": [{"kind": "longpass", "edge": "800 nm"}],
        }
    )
    assert changed == Emva(chip="cmv12000-nir", exposure_time=5e-3, filters=(LongPass(),))
    assert sensor_name(SENSORS["cmv12000-rgb"]) == "cmv12000-rgb"
    with pytest.raises(InputError, match="did you mean 'cmv12000-mono'"):
        sensor_of("cmv1200-mono")
