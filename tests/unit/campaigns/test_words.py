"""A key below a word (`sensor: linear`) changes what the word stands for; names of lights tell what they are."""

import pytest

from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import combinations, override, read_campaign, resolved
from conespot.scene import InputError
from conespot.scene.document import dump


@pytest.fixture
def campaign(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(text, name="c.yaml"):
        (tmp_path / name).write_text(text)
        return read_campaign(name)

    return write


def scenes(document):
    return [combination.campaign.scene for combination in combinations(document)]


def test_a_swept_key_below_a_sensor_named_by_a_word_keeps_that_sensor(campaign):
    document = campaign(
        "scene: {preset: paper-code, sensor: linear}\nsweep: {scene.sensor.white: [0.5 W/m2/sr, 1 W/m2/sr]}\n"
    )
    assert [(s.sensor.kind, s.sensor.white) for s in scenes(document)] == [("linear", 0.5), ("linear", 1.0)]


def test_a_word_of_the_preset_a_file_or_a_swept_item_is_kept_alike(campaign, tmp_path):
    (tmp_path / "own.yaml").write_text("sensor: linear\nretina: fundus-dark\nambient: {illumination: xenon}\n")
    text = "scene: own.yaml\nsweep: {scene.sensor.white: [2 W/m2/sr], scene.sensor: [linear, srgb8-colour]}\n"
    found = scenes(override(campaign(text), "scene.retina.detail", "0.1", "--set"))
    assert [(s.sensor.kind, s.sensor.white) for s in found] == [("linear", 2.0), ("srgb8", 2.0)]
    assert found[1].sensor.colour
    assert {(s.retina.pigmentation, s.retina.detail) for s in found} == {("dark", 0.1)}


@pytest.mark.parametrize(
    ("word", "key", "value", "kept"),
    [
        ("sensor: cmv12000-mono", "scene.sensor.full_well", "9000", {"kind": "emva", "metering": True}),
        ("illumination: line660", "scene.illumination.width", "3 nm", {"wavelength": 660.0}),
        ("surface: bumps", "scene.surface.semi_axes", "[1, 1, 0.95]", {"bumps": True}),
        ("retina: nasal", "scene.retina.water", "false", {"site": "nasal"}),
    ],
)
def test_an_override_below_a_word_keeps_the_rest(campaign, word, key, value, kept):
    document = override(campaign(f"scene: {{preset: paper-code, {word}}}\n"), key, value, "--set")
    part = getattr(scenes(document)[0], key.split(".")[1])
    for name, expected in kept.items():
        found = getattr(part, name)
        assert bool(found) if expected is True else found == expected


def test_a_key_that_the_word_s_kind_does_not_have_is_refused(campaign):
    document = override(campaign("scene: {preset: paper-code, sensor: linear}\n"), "scene.sensor.gain", "1", "--set")
    with pytest.raises(InputError, match=r"--set: scene.sensor.gain: unknown key 'gain'"):
        scenes(document)


def test_what_is_below_a_word_reads_back_from_the_run_folder(campaign, tmp_path):
    document = campaign("scene: {preset: paper, sensor: linear}\nsweep: {scene.sensor.white: [1 W/m2/sr, 2 W/m2/sr]}\n")
    (tmp_path / "again.yaml").write_text(dump(resolved(document, {})))
    assert make_plan(read_campaign("again.yaml")).identity == make_plan(document).identity


@pytest.mark.parametrize(
    ("light", "name"),
    [
        ("white", "white"),
        ("{kind: flat}", "white"),
        ("{kind: flat, low: 400 nm, high: 700 nm}", "white"),
        ("{kind: flat, low: 500 nm, high: 600 nm}", "500-600 nm"),
        ("{kind: flat, name: white, low: 600 nm, high: 700 nm}", "600-700 nm"),
        ("{kind: flat, name: green, low: 500 nm, high: 600 nm}", "green"),
        ("{kind: line, wavelength: 589.3 nm}", "line 589.3 nm"),
        ("{kind: line, name: line532, wavelength: 660 nm}", "line 660 nm"),
        ("line532", "line532"),
    ],
)
def test_a_light_is_called_what_it_is(campaign, light, name):
    plan = make_plan(override(campaign("scene: paper-code\n"), "scene.illumination", light, "--set"))
    assert plan.cases[0].labels["illumination"] == name


def test_bands_by_their_edges_have_names_to_compare_them_by(campaign):
    plan = make_plan(campaign("scene: paper\nsweep: {scene.illumination.low: [500 nm, 400 nm]}\n"))
    assert [case.labels["illumination"] for case in plan.cases] == ["500-700 nm", "white"]


def test_values_that_differ_in_writing_alone_are_one_case(campaign):
    text = "scene: paper\nsweep: {scene.beam.blend: [0.1, 0.10, 1.0e-1], scene.eye.radius: [12 mm, 12.0 mm, 1.2 cm]}\n"
    assert len(make_plan(campaign(text)).cases) == 1


def test_cases_that_differ_never_share_all_their_labels(campaign):
    text = (
        "scene: paper\nsweep: {trajectory: [helix, {kind: helix, turns: 2}], "
        "scene.power.value: [0.1 W, 0.1000000001 W], scene.beam.blend: [1, 0.3333333333, 0.3333333334]}\n"
    )
    cases = make_plan(campaign(text)).cases
    assert len({str({**case.labels, **case.swept}) for case in cases}) == len(cases) == 12


def test_a_file_named_on_the_command_line_is_one_of_the_working_folder(campaign, tmp_path, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "tips here.csv").write_text("x_mm,y_mm,z_mm\n0,0,4\n")
    campaign("scene: paper\nposes: 1\n")
    monkeypatch.chdir(tmp_path / "elsewhere")
    for name in ("tips here.csv", "./tips here.csv", str(tmp_path / "elsewhere" / "tips here.csv")):
        document = read_campaign("../c.yaml")
        for key, value in (("trajectory", f"{{kind: csv, file: '{name}'}}"), ("trajectory.file", f"'{name}'")):
            document = override(document, key, value, "--set")
        assert make_plan(document).groups[0].positions.tolist() == [[0.0, 0.0, 4.0]]
