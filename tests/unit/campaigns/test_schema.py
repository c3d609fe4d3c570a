"""campaigns.schema: a file becomes combinations, and whatever is wrong is named with its line."""

import pytest

from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import base, combinations, override, read_campaign, resolved
from conespot.campaigns.sweep import MAX_COMBINATIONS
from conespot.scene import InputError
from conespot.scene.document import dump, shipped

POWER_SWEEP = """\
name: small
scene: paper-code
poses: 3
sweep:
  trajectory: [box, helix]
  scene.spotlights: [single, triple]
  scene.power.value:
    - 0.05 W
    - 1 W
"""


def cases(document):
    return [combination.campaign for combination in combinations(document)]


def complaint(document):
    with pytest.raises(InputError) as error:
        list(combinations(document))
    return str(error.value)


def test_a_sweep_is_the_cartesian_product_with_the_last_key_fastest(campaign):
    seen = [(c.trajectory.kind, len(c.scene.spotlights), c.scene.power.value) for c in cases(campaign(POWER_SWEEP))]
    assert seen == [(t, k, p) for t in ("box", "helix") for k in (1, 3) for p in (0.05, 1.0)]


def test_a_list_of_products_is_their_union(campaign):
    document = campaign("scene: paper\nsweep:\n - {trajectory: [box, helix]}\n - {scene.surface: [bumps]}\n")
    assert [(c.trajectory.kind, len(c.scene.surface.bumps)) for c in cases(document)] == [
        ("box", 0),
        ("helix", 0),
        ("box", 15),
    ]


def test_without_a_sweep_there_is_one_combination(campaign):
    assert len(cases(campaign("scene: paper\n"))) == 1


def test_the_name_is_the_files_unless_given(campaign):
    assert base(campaign("scene: paper\n", "dawn.yaml")).name == "dawn"
    assert base(campaign("name: dusk\nscene: paper\n", "dawn.yaml")).name == "dusk"


def test_swept_presets_keep_what_the_campaign_changes_in_them(campaign):
    document = campaign("scene: {camera: {resolution: 300}}\nsweep: {scene: [paper, paper-code]}\n")
    assert [(c.scene.eye.radius, c.scene.camera.resolution) for c in cases(document)] == [(12.0, 300), (12.5, 300)]


def test_a_preset_may_be_a_file_beside_the_campaign(campaign, tmp_path):
    (tmp_path / "mine.yaml").write_text("eye: {radius: 11 mm}\n")
    assert cases(campaign("scene: {preset: mine.yaml}\n"))[0].scene.eye.radius == 11.0


def test_a_swept_mapping_is_laid_on_the_preset(campaign):
    document = campaign("scene: paper\nsweep: {scene.beam: [{half_angle: 8 deg}, {kind: hard, half_angle: 9 deg}]}\n")
    assert [(c.scene.beam.kind, round(c.scene.beam.half_angle, 3)) for c in cases(document)] == [
        ("cycles", 0.14),
        ("hard", 0.157),
    ]


@pytest.mark.parametrize(
    ("item", "says"),
    [
        ("scene.power.value: [1 W, -1 W]", "c.yaml:3: scene.power.value: input should be greater than or equal to 0 W"),
        ("trajectory: [box, hellix]", "c.yaml:3: trajectory: unknown trajectory 'hellix'; did you mean 'helix'?"),
        (
            "scene.spotlihgts: [single]",
            "c.yaml:3: scene.spotlihgts: unknown key 'spotlihgts'; did you mean 'spotlights'?",
        ),
        ("trajectori: [box]", "c.yaml:3: sweep: 'trajectori' cannot be swept; did you mean 'trajectory'?"),
        ("scene.beam.half_angle: [9 deg, 90 deg]", "c.yaml:3: scene.beam.half_angle: input should be less than 90 deg"),
        ("scene.camera.height: [5 mm]", "c.yaml:3: scene: camera.height must put the camera above the eye"),
        ("poses: []", "c.yaml:3: sweep.poses: must be a list of values, got []"),
        ("poses: 5", "c.yaml:3: sweep.poses: must be a list of values, got 5"),
        ("name: [a, b]", "c.yaml:3: sweep: 'name' cannot be swept"),
    ],
)
def test_a_wrong_sweep_item_is_named_with_its_line(campaign, item, says):
    assert says in complaint(campaign(f"scene: paper\nsweep:\n  {item}\n"))


def test_a_wrong_item_of_a_block_list_is_named_with_its_own_line(campaign):
    text = POWER_SWEEP.replace("- 1 W", "- 1 kg")
    said = complaint(campaign(text))
    assert "c.yaml:9: scene.power.value: expected a power" in said
    assert "(in the combination trajectory: box, scene.spotlights: single, scene.power.value: 1 kg)" in said


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "scene: papr\n",
            "c.yaml:1: scene: papr: no such scene preset, neither a file nor shipped; did you mean 'paper'?",
        ),
        ("scene: paper\nposes: yes\n", "c.yaml:2: poses: input should be a valid integer, got 'yes'"),
        ("scene: paper\nposes: 0\n", "c.yaml:2: poses: input should be greater than or equal to 1, got 0"),
        (
            "scene: paper\nlocalisers: [paper]\n",
            "c.yaml:2: localisers: unknown key 'localisers'; did you mean 'localizers'?",
        ),
        (
            "scene: paper\nlocalizers: [papr]\n",
            "c.yaml:2: localizers.0: unknown localizer 'papr'; did you mean 'paper'?",
        ),
        ("scene: paper\nlocalizers: [paper, paper]\n", "c.yaml:2: localizers: every name may stand only once"),
        ("scene: paper\nsweep: 5\n", "c.yaml:2: sweep: must hold lines of `key: [values]`, got 5"),
        ("scene: 5\n", "c.yaml:1: scene: input should be a valid dictionary"),
        ("name: ../up\nscene: paper\n", "c.yaml:1: name: "),
    ],
)
def test_what_is_wrong_in_a_campaign_is_named_with_its_line(campaign, text, says):
    with pytest.raises(InputError) as error:
        make_plan(campaign(text))
    assert says in str(error.value)


def test_the_size_of_a_sweep_is_bounded(campaign):
    many = list(range(101))
    document = campaign(f"scene: paper\nsweep: {{seed: {many}, samples: {many}}}\n")
    assert f"more than {MAX_COMBINATIONS} combinations" in complaint(document)


def test_an_override_beats_the_file_and_its_sweep(campaign):
    document = override(campaign(POWER_SWEEP), "scene.power.value", "0.5 W", "--set scene.power.value")
    assert {c.scene.power.value for c in cases(document)} == {0.5}
    assert len(cases(document)) == 4


def test_an_override_inside_a_swept_value_reaches_every_item(campaign):
    document = campaign("scene: paper\nsweep: {trajectory: [helix, {kind: helix, turns: 2}]}\n")
    document = override(document, "trajectory.radius", "1 mm", "--set trajectory.radius")
    assert [(c.trajectory.radius, c.trajectory.turns) for c in cases(document)] == [(1.0, 3.5), (1.0, 2.0)]


def test_an_override_can_replace_or_add_a_swept_list(campaign):
    document = override(campaign(POWER_SWEEP), "sweep.trajectory", "[spiral]", "--set sweep.trajectory")
    document = override(document, "sweep.seed", "[1, 2]", "--set sweep.seed")
    assert [(c.trajectory.kind, c.seed) for c in cases(document)][:2] == [("spiral", 1), ("spiral", 2)]


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        (
            "scene.camera.resolutoin",
            "5",
            "--set x: scene.camera.resolutoin: unknown key 'resolutoin'; did you mean 'resolution'?",
        ),
        ("posse", "5", "--set x: posse: unknown key 'posse'; did you mean 'poses'?"),
        ("poses", "[", "--set x:1: not valid YAML"),
        ("poses", "", "--set x: poses: input should be a valid integer, got None"),
    ],
)
def test_a_wrong_override_is_named_as_such(campaign, key, value, says):
    with pytest.raises(InputError) as error:
        base(override(campaign(POWER_SWEEP), key, value, "--set x"))
    assert says in str(error.value)


@pytest.mark.parametrize("name", sorted(shipped("campaigns", "")))
def test_a_resolved_campaign_reads_back_to_the_same_combinations(tmp_path, name):
    document = read_campaign(name)
    path = tmp_path / "campaign.yaml"
    path.write_text(dump(resolved(document, {"python": "3"})))
    again = read_campaign(str(path))
    if "scene" in document.data:
        assert [c.model_dump(mode="json", exclude={"made_with"}) for c in cases(again)] == [
            c.model_dump(mode="json", exclude={"made_with"}) for c in cases(document)
        ]
    assert base(again).made_with == {"python": "3"}


def test_a_resolved_campaign_finds_its_csv_files_from_another_folder(tmp_path, campaign):
    (tmp_path / "tips.csv").write_text("x_mm,y_mm,z_mm\n0,0,3\n1,0,4\n")
    document = campaign("scene: paper\nposes: 2\ntrajectory: {kind: csv, file: tips.csv}\n")
    (tmp_path / "run").mkdir()
    path = tmp_path / "run" / "campaign.yaml"
    path.write_text(dump(resolved(document, {})))
    assert cases(read_campaign(str(path)))[0].trajectory.points == ((0.0, 0.0, 3.0), (1.0, 0.0, 4.0))
