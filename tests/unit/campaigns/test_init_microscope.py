"""`campaign init --microscope`: what it writes is a scene, whatever is answered, and says how well it is known."""

import pytest

from conespot.campaigns.command import main
from conespot.campaigns.own_scene import described_scene
from conespot.scene.emva import Emva
from conespot.scene.sensor import Recorded

CALIBRATION = """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix {rows: 3, cols: 3, dt: d, data: [8000., 0., 319.5, 0., 8000., 239.5, 0., 0., 1.]}
distortion_coefficients: !!opencv-matrix {rows: 1, cols: 5, dt: d, data: [-0.1, 0., 0., 0., 0.]}
"""


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def written(*options, name="my_microscope.yaml"):
    assert main(["init", "--microscope", name, *options]) == 0
    return described_scene(name, [], "test")


def test_the_defaults_are_a_scene_whose_row_shows_the_field_that_was_asked_for(tmp_path):
    scene, knowledge = written()
    left, right = scene.camera.rays([[0.0, 540.0], [1920.0, 540.0]]).directions
    assert 110.0 * (right[0] / -right[2] - left[0] / -left[2]) == pytest.approx(13.2)
    assert scene.camera.size_words == "1920 x 1080 px"
    assert isinstance(scene.sensor, Emva)
    assert (scene.sensor.full_scale, scene.sensor.black_level, scene.sensor.read_noise) == (4095, 0.0, 15.0)
    assert scene.sensor.saturation == pytest.approx(10_000.0)
    assert knowledge.rcm_sigma == pytest.approx(0.05)
    assert max(map(len, (tmp_path / "my_microscope.yaml").read_text().splitlines())) <= 120


def test_every_answer_arrives():
    options = {
        "pixels": "640x480", "field": "8 mm", "distance": "180 mm", "values": "srgb-colour", "range": "limited",
        "electrons": "5000", "radius": "11.5 mm", "trocar": "5 mm, 1 mm, 21 mm", "trocar-sigma": "20 um",
        "rig": "triple", "half-angle": "7 deg", "edge": "soft", "alignment": "left",
    }  # fmt: skip
    scene, knowledge = written(*[part for name, value in options.items() for part in (f"--{name}", value)])
    assert scene.camera.shape == (480, 640)
    assert scene.camera.height == 180.0
    assert isinstance(scene.sensor, Recorded)
    assert scene.sensor.range == "limited"
    assert scene.sensor.camera.saturation == pytest.approx(5000.0)
    assert scene.sensor.responses.keys() == {"red", "green", "blue"}
    assert scene.eye.radius == 11.5
    assert scene.instrument.rcm == (5.0, 1.0, 21.0)
    assert knowledge.rcm_sigma == pytest.approx(0.02)
    assert len(scene.spotlights) == 3
    assert scene.beam.softness == 1.0
    assert scene.storage.alignment == "left"


def test_a_calibration_of_opencv_is_taken_as_it_is(tmp_path):
    (tmp_path / "camera.yml").write_text(CALIBRATION)
    (tmp_path / "eyes").mkdir()
    scene, _ = written("--calibration", "camera.yml", name="eyes/mine.yaml")
    assert scene.camera.shape == (480, 640)
    assert scene.camera.focal_length_px == pytest.approx(8000.0)
    assert scene.camera.distortion.k1 == -0.1


def test_a_bad_calibration_is_named_by_its_option_and_nothing_is_written(tmp_path, capsys):
    (tmp_path / "rat.yml").write_text("hello")
    assert main(["init", "--microscope", "x.yaml", "--defaults", "--calibration", "rat.yml"]) == 2
    assert "campaign: --calibration: rat.yml: is no calibration" in capsys.readouterr().err
    assert not (tmp_path / "x.yaml").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--microscope", "--field", "13"], "--field: "),
        (["--microscope", "--pixels", "1920"], "--pixels: expected columns and rows such as 1920x1080"),
        (["--microscope", "--calibration", "no.yml"], "no.yml: no such file; answer none"),
        (["--microscope", "--values", "sgrb"], "did you mean 'srgb'?"),
        (["--microscope", "--poses", "3"], "--poses: is asked of a campaign; leave --microscope out"),
        (["--field", "13 mm"], "--field: is asked of a microscope; add --microscope"),
        (["--microscope", "--trocar", "0 mm, 0 mm"], "expected three lengths"),
    ],
)
def test_an_answer_that_is_none_is_one_sentence_and_nothing_is_written(tmp_path, capsys, options, said):
    assert main(["init", *options]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_where_nobody_can_be_asked_it_says_that_nothing_was(capsys):
    written("--field", "8 mm")
    assert "no terminal to ask on, so 16 questions took their defaults" in capsys.readouterr().err
    written("--defaults", name="x.yaml")
    assert not capsys.readouterr().err


def test_nothing_is_written_over(tmp_path, capsys):
    written()
    assert main(["init", "--microscope"]) == 2
    assert "is there already" in capsys.readouterr().err
