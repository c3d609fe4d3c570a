"""What cannot be a scene is refused in one sentence that names file, line and key, and says how to mend it."""

import warnings

import numpy as np
import pytest

from conespot.scene import InputError, load_scene
from conespot.scene.motion import Tremor

PATTERN = "sensor: {kind: emva, chip: cmv12000-mono, exposure_time: 8 ms, fixed_pattern: {%s}}"
BLUR = "camera: {lens: {blur: {file: psf.csv}}}"


@pytest.fixture
def load(tmp_path):
    def read(text, psf=""):
        (tmp_path / "psf.csv").write_text(psf)
        (tmp_path / "s.yaml").write_text(f"preset: paper-code\n{text}\n")
        return load_scene(tmp_path / "s.yaml")

    return read


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("cameras: [{resolution: 300}]", "2: cameras: cameras have names: write cameras: {left: {...}, right"),
        ("cameras: [left, right]\ncamera: left", "cameras have names"),
        ("cameras: left\ncamera: left", "cameras have names"),
        ("camera: left", "there are none; write them as cameras: {left: {...}}"),
        ("camera: {zzz: 1}", "lens, calibration"),
        ("camera: {calibraton: a.yml}", "did you mean 'calibration'?"),
        ("camera: {distortion: {k1: 1e300}}", "at most 1e+12, got 1e+300"),
        (PATTERN % "prnu: {row: .inf}", "prnu.row: must be finite, got inf"),
        (PATTERN % "prnu: {row: 1000}", "prnu is relative to the response: 0.01 is 1 %"),
        (PATTERN % "dsnu: {pixel: .inf}", "dsnu.pixel: must be finite"),
        (PATTERN % "serial: true", "serial: expected a number, got true"),
        ("sensor: {kind: recorded, camera: linear, quality: true}", "2: sensor.quality: expected a number, got true"),
        ("sensor: {kind: linear, bits: true}", "sensor.bits: expected a number"),
        ("camera: {resolution: [300, true]}", "resolution: expected a number"),
        ("camera: {distortion: [true, 0, 0, 0]}", "k1: expected a number"),
        ("camera: {lens: {focus: -5 mm}}", "is behind the eye"),
        ("camera: {optics: {pupil: 1 um}}", "pupil: no eye's is narrower than 0.5 mm, got 0.001 mm"),
        ("motion: {kind: velocity, exposure: 20 s, velocity: [1 mm/s, 0 mm/s, 0 mm/s]}", "2: motion.exposure: input"),
        ("motion: {kind: velocity, velocity: [1 mm/s, 0 mm, 0 mm/s]}", "motion.velocity.1: expected a speed"),
        ("motion: {kind: shaking}", "unknown kind 'shaking'; known: velocity, tremor"),
        ("camera: {lens: abc}", "camera.lens: input should be a valid dictionary of keys and values, got 'abc'"),
        ("beam: {kind: hard, half_angle: 9}", "write an angle such as '9 deg'"),
        ("camera: {principal_point: [1e999 px, 1 px]}", "a number of pixels must be finite"),
        ("camera: {lens: {glare: 200 %}}", "glare: input should be less than 1, got '200 %'"),
        ("camera: {lens: {blur: {radii: [0 mm, 3 mm], values: [1, 0]}}}", "less than or equal to 1 mm, got '3 mm'"),
    ],
)
def test_what_cannot_be_is_refused_in_one_sentence_without_a_warning(load, text, said):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError) as error:
            load(text)
    assert said in str(error.value)
    assert "s.yaml:" in str(error.value)


@pytest.mark.parametrize(
    ("psf", "said"),
    [
        ("", "psf.csv: a point spread needs at least two lines"),
        ("r,v\n0,1\n2,nan\n", "psf.csv:3: radii are from 0 to 1 mm and values 0 or more, got 2, nan"),
        ("r,v\n0,1\n2,-1\n", "psf.csv:3: radii"),
        ("radius_px,v\n0,1\n2,0\n", "psf.csv:1: 'radius_px' names no length"),
    ],
)
def test_a_point_spread_that_cannot_be_is_refused_with_its_file_and_line(load, psf, said):
    with pytest.raises(InputError) as error:
        load(BLUR, psf)
    assert said in str(error.value)


@pytest.mark.parametrize("header", ["", "r,v\n", "radius_um,v\n", "radius [\u00b5m],v\n"])
def test_the_unit_of_a_point_spreads_header_is_obeyed(load, header):
    in_um = load(BLUR, f"{header}0,1\n5,0.5\n")
    assert in_um.camera.lens.blur.radii == (0.0, 0.005)
    assert load(BLUR, "radius_mm,v\n0,1\n0.005,0.5\n") == in_um


def test_a_share_may_be_written_in_percent(load):
    assert load("camera: {lens: {glare: 2 %}}") == load("camera: {lens: {glare: 0.02}}")
    assert load(PATTERN % "hot: 1 %") == load(PATTERN % "hot: 0.01")


def test_a_tremors_rms_scatters_from_seed_to_seed_by_no_more_than_its_band_says():
    """1 / (2 sqrt(3 B T)) over 10 s, of 60 seeds, whose own scatter is known to a third."""
    times = np.arange(0.0, 10.0, 1.0 / 60.0)
    for band in (1.0, 4.0):
        tremor = Tremor(bandwidth=band)
        found = [np.sqrt(np.mean(np.sum(tremor.displacement(times, seed) ** 2, axis=1))) for seed in range(60)]
        assert np.std(found) / tremor.rms < 1.33 * 0.5 / np.sqrt(3.0 * band * 10.0)
