"""Spectra and lights: their integrals, names and files."""

import numpy as np
import pytest

from conespot.scene import InputError
from conespot.scene.document import Document
from conespot.scene.illumination import LIGHTS, Ambient, FlatBand, Line, MeasuredLight
from conespot.scene.scene import Scene, read_scene
from conespot.scene.spectrum import Curve, mean_of, tabulated


@pytest.mark.parametrize("name", LIGHTS)
def test_a_light_integrates_to_its_watts(name):
    """Trapezoid of the density on a 0.01 nm grid; against 1; within 1e-4 (within rounding on the light's own grid)."""
    spectrum = LIGHTS[name].spectrum
    x = np.arange(300.0, 1100.0, 0.01)
    assert np.trapezoid(spectrum(x), x) == pytest.approx(1.0, rel=1e-4)
    assert spectrum.integral() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "centroid"),
    [("ir850", 855.0), ("ir940", 943.0), ("line532", 532.0), ("line660", 660.0), ("led-b3", 564.0)],
)
def test_lights_sit_where_their_data_sheets_say(name, centroid):
    """Centroid wavelength; against the data sheet's; within 1 nm."""
    assert LIGHTS[name].spectrum.mean_wavelength == pytest.approx(centroid, abs=1.0)


@pytest.mark.parametrize("band", [(500.0, 600.0), (830.0, 870.0), (920.0, 960.0)])
@pytest.mark.parametrize("table", ["halogen", "flat"])
def test_band_integrals_match_a_fine_sum(band, table):
    """Integral of light times quantum efficiency over a band; against a sum on a 0.001 nm grid; within 0.1 %."""
    light = LIGHTS["halogen"].spectrum if table == "halogen" else FlatBand(low=400.0, high=1000.0).spectrum
    efficiency = tabulated("camera_qe_cmv12000", "qe_nir").cut(*band)
    x = np.linspace(*band, 100_001)
    truth = np.trapezoid(light(x) * tabulated("camera_qe_cmv12000", "qe_nir")(x), x)
    assert light.times(efficiency).integral() == pytest.approx(truth, rel=1e-3)


def test_a_curve_is_zero_outside_its_band():
    """Values just outside a cut; against exactly 0."""
    cut = LIGHTS["halogen"].spectrum.cut(800.0, 900.0)
    assert np.all(cut(np.array([799.999, 900.001, 500.0])) == 0.0)
    assert np.all(cut(np.array([800.0, 900.0])) > 0.0)
    assert (
        Curve(np.array([400.0, 500.0]), np.ones(2)).times(Curve(np.array([600.0, 700.0]), np.ones(2))).integral() == 0.0
    )


def test_mean_of_a_constant_is_the_constant():
    """Mean of 3 over LED-B3; against 3."""
    constant = Curve(np.array([300.0, 1100.0]), np.full(2, 3.0))
    assert mean_of(LIGHTS["led-b3"].spectrum, constant) == pytest.approx(3.0)


@pytest.mark.parametrize("bad", [([400.0], [1.0]), ([500.0, 400.0], [1.0, 1.0]), ([400.0, 500.0], [1.0, np.nan])])
def test_a_bad_curve_is_refused(bad):
    """One point, falling wavelengths, NaN; each a ValueError."""
    with pytest.raises(ValueError, match="spectrum"):
        Curve(np.array(bad[0]), np.array(bad[1]))


def scene_of(tmp_path, **data) -> Scene:
    return read_scene(Document("scene.yaml", data, {}, tmp_path))


def test_names_stand_for_lights(tmp_path):
    """`illumination: ir850`; against the lamp it names, also for the ambient light."""
    scene = scene_of(tmp_path, illumination="ir850", ambient={"illumination": "led-b3"})
    assert scene.illumination == LIGHTS["ir850"]
    assert scene.ambient == Ambient(illumination=LIGHTS["led-b3"])
    flat = {"kind": "flat", "low": "500 nm", "high": "600 nm"}
    assert scene_of(tmp_path, illumination=flat).illumination == FlatBand(low=500.0, high=600.0)
    assert scene_of(tmp_path, illumination={"kind": "line", "wavelength": "633 nm"}).illumination == Line(
        wavelength=633.0
    )


def test_a_file_is_a_light(tmp_path):
    """A CSV file of two columns with comment and header; against the triangle it holds, normalised."""
    (tmp_path / "lamp.csv").write_text("# mine\nnm,power\n500,0\n550,7\n600,0\n")
    light = scene_of(tmp_path, illumination={"kind": "csv", "file": "lamp.csv"}).illumination
    assert isinstance(light, MeasuredLight)
    assert light.spectrum(550.0) == pytest.approx(1.0 / 50.0)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("500,1\n", "two lines"),
        ("500,1\n600\n", "lamp.csv:2"),
        ("500,1\n600,x\n", "lamp.csv:2"),
        ("500,nan\n600,1\n", "finite"),
        ("500,-1\n600,1\n", "negative"),
        ("500,0\n600,0\n", "zero everywhere"),
        ("600,1\n500,1\n", "increase"),
        ("200,1\n500,1\n", "300 to 1100"),
        (None, "cannot be read"),
    ],
)
def test_a_bad_spectrum_file_is_one_sentence(tmp_path, content, says):
    """Files that hold no light; against an InputError that names the file and the fault."""
    if content is not None:
        (tmp_path / "lamp.csv").write_text(content)
    with pytest.raises(InputError, match=says):
        scene_of(tmp_path, illumination={"kind": "csv", "file": "lamp.csv"})


def test_a_misspelt_light_gets_a_hint(tmp_path):
    """`ir580`; against an error that proposes ir850."""
    with pytest.raises(InputError, match="did you mean 'ir850'"):
        scene_of(tmp_path, illumination="ir580")
