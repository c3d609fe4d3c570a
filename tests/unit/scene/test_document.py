"""Descriptions from files: read to the number, refused in one sentence with file, line and key."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from conespot.scene import InputError, Scene, load_scene
from conespot.scene.document import dump, find_document, merge, read_document
from conespot.scene.identity import identity
from conespot.scene.quantity import UNITS, format_quantity, parse_quantity
from conespot.scene.trajectory import AnyTrajectory

BAD = {
    "eye: {radus: 12 mm}": r"x.yaml:1: eye.radus: unknown key 'radus'; did you mean 'radius'\?",
    "camera: {resolution: 500}\neye:\n  radius: 12": r"x.yaml:3: eye.radius: 12 has no unit; .*'9 mm'",
    "eye: {radius: 12 deg}": r"x.yaml:1: eye.radius: expected a length .* got '12 deg'",
    "eye: [1]": "x.yaml:1: eye: ",
    "beam: {kind: cycles, half_angle: 0 deg}": "x.yaml:1: beam.half_angle: .*greater than 0",
    "beam: {kind: cycles, half_angle: 90 deg}": "x.yaml:1: beam.half_angle: .*less than",
    "beam: {kind: cyles}": "x.yaml:1: beam: .*'cyles'",
    "spotlights: trible": r"x.yaml:1: spotlights: unknown spotlight rig 'trible'; did you mean 'triple'\?",
    "camera: {resolution: 0}": "x.yaml:1: camera.resolution: ",
    "camera: {resolution: 1000000}": "x.yaml:1: camera.resolution: ",
    "power: {value: -1 W}": "x.yaml:1: power.value: ",
    "power: {value: 1 W, convention: watts}": "x.yaml:1: power.convention: ",
    "eye: {radius: .inf}": "x.yaml:1: eye.radius: ",
    "eye: &a {radius: 12 mm}\nx: *a": "x.yaml:1: anchors and aliases are not read",
    "a: !!python/object:os.system ls": "x.yaml:1: the tag",
    "eye: {radius: 12 mm}\neye: {radius: 13 mm}": "x.yaml:2: .*twice",
    "a: b: c": "x.yaml:1: not valid YAML",
    "- 1": "x.yaml:1: must hold `key: value` lines",
    "": "x.yaml: is empty",
    "# only a comment": "x.yaml: is empty",
    "a: \x00": "x.yaml: not valid YAML",
    "surface: {bumps: [{x: 20 mm, y: 0 mm}]}": "outside the eye",
    "camera: {height: 20 mm}": "above the eye",
    "[" * 5000: "x.yaml:1: nested too deeply",
    "preset: nopreset": "nopreset: no such scene preset",
}


@pytest.mark.parametrize("text", BAD, ids=lambda text: text[:24])
def test_a_bad_description_is_one_sentence_with_its_place(tmp_path, monkeypatch, text):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.yaml").write_text(text)
    with pytest.raises(InputError, match=BAD[text]) as raised:
        load_scene("x.yaml")
    assert "\n" not in str(raised.value)


def test_a_missing_file_is_named():
    with pytest.raises(InputError, match="nowhere.yaml: no such scene preset"):
        load_scene("nowhere.yaml")


@pytest.mark.parametrize("name", ["paper", "paper-code"])
def test_a_preset_survives_being_written_and_read(tmp_path, name):
    scene = load_scene(name)
    (tmp_path / "again.yaml").write_text(dump(scene))
    assert load_scene(tmp_path / "again.yaml") == scene
    assert identity(load_scene(tmp_path / "again.yaml")) == identity(scene)


def test_the_presets_differ_in_the_radius_alone():
    paper, code = load_scene("paper"), load_scene("paper-code-literal")
    assert (paper.eye.radius, code.eye.radius) == (12.0, 12.5)
    assert paper == code.model_copy(update={"eye": paper.eye})


def test_the_fitted_preset_differs_in_what_shows_as_white_alone_and_shows_the_same_background():
    fitted, literal = load_scene("paper-code"), load_scene("paper-code-literal")
    assert fitted == literal.model_copy(update={"sensor": fitted.sensor, "ambient": fitted.ambient})
    shown = [scene.ambient.irradiance / scene.sensor.white for scene in (fitted, literal)]
    assert shown[0] == pytest.approx(shown[1], rel=1e-12)
    assert (fitted.sensor.white, literal.sensor.white) == (0.25, 1.0)


def test_a_preset_can_be_changed_in_part(tmp_path):
    (tmp_path / "mine.yaml").write_text(
        "preset: paper-code\ncamera: {resolution: 800}\nbeam: {kind: hard, half_angle: 9 deg}\n"
    )
    scene = load_scene(tmp_path / "mine.yaml")
    assert scene.camera.resolution == 800
    assert scene.camera.height == 110.0
    assert scene.beam.kind == "hard"


def test_yaml_is_1_2(tmp_path):
    (tmp_path / "x.yaml").write_text("a: no\nb: 10:30\nc: 1e3\nd: 0o17\ne: 2026-11-22\n")
    data = read_document(tmp_path / "x.yaml").data
    assert data == {"a": "no", "b": "10:30", "c": 1000.0, "d": 15, "e": "2026-11-22"}


def test_merge_replaces_a_mapping_of_another_kind_as_a_whole():
    base = {"beam": {"kind": "cycles", "blend": 1, "half_angle": "9 deg"}, "eye": {"radius": "12 mm"}}
    assert merge(base, {"beam": {"kind": "hard"}})["beam"] == {"kind": "hard"}
    assert merge(base, {"beam": {"blend": 0.5}})["beam"] == {"kind": "cycles", "blend": 0.5, "half_angle": "9 deg"}


@given(st.sampled_from(sorted(UNITS)), st.floats(-1e6, 1e6).filter(lambda v: v == 0 or abs(v) > 1e-6))
def test_a_quantity_survives_being_written_and_read(kind, value):
    assert parse_quantity(format_quantity(value, kind), kind) == pytest.approx(value, rel=1e-11)


@given(st.text(max_size=12))
def test_any_text_is_a_quantity_or_a_value_error(text):
    try:
        parse_quantity(text, "length")
    except ValueError as error:
        assert str(error).startswith(("expected a length", "a length must be finite"))


def test_a_trajectory_file_is_read_in_order_and_complained_about_by_line(tmp_path):
    (tmp_path / "t.csv").write_text("x_mm,y_mm,z_mm\n0,0,3\n1,0,4\n")
    (tmp_path / "x.yaml").write_text("trajectory: {kind: csv, file: t.csv}")
    trajectory = read_document(tmp_path / "x.yaml").validate(AnyTrajectory, at=("trajectory",))
    assert trajectory.positions(2, None).tolist() == [[0, 0, 3], [1, 0, 4]]
    with pytest.raises(ValueError, match="2 positions but 3 poses"):
        trajectory.positions(3, None)
    (tmp_path / "t.csv").write_text("x_mm,y_mm,z_mm\n0,0,3\n1,zero,4\n")
    with pytest.raises(InputError, match="t.csv:3: x_mm, y_mm, z_mm must be finite numbers"):
        read_document(tmp_path / "x.yaml").validate(AnyTrajectory, at=("trajectory",))
    (tmp_path / "t.csv").write_text("x,y,z\n")
    with pytest.raises(InputError, match="t.csv:1: no column x_mm, y_mm, z_mm"):
        read_document(tmp_path / "x.yaml").validate(AnyTrajectory, at=("trajectory",))


def test_an_unknown_trajectory_is_refused_with_a_suggestion(tmp_path):
    (tmp_path / "x.yaml").write_text("trajectory: helixx")
    with pytest.raises(InputError, match=r"x.yaml:1: trajectory: unknown trajectory 'helixx'; did you mean 'helix'\?"):
        read_document(tmp_path / "x.yaml").validate(AnyTrajectory, at=("trajectory",))


def test_identity_is_that_of_the_content():
    assert identity(Scene()) == identity(Scene.model_validate({}))
    assert identity(Scene()) != identity(load_scene("paper-code"))
    assert identity(Scene(), 1) != identity(Scene(), 2)


def test_find_document_prefers_a_file_over_a_shipped_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert find_document("paper", "scene", "presets", "scene preset").name == "paper.yaml"
    (tmp_path / "paper").write_text("eye: {radius: 11 mm}")
    assert find_document("paper", "scene", "presets", "scene preset").name == "paper"
