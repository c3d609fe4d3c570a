"""campaigns.sweep: named choices, each of which settles keys that go together."""

import pytest

from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import combinations, override, resolved
from conespot.scene import InputError
from conespot.scene.document import dump

TEXT = """\
name: named
scene: {preset: paper-code, camera: {resolution: 300}}
poses: 2
sweep:
  light:
    white: {scene.illumination: led-b3}
    infrared: {scene.illumination: ir850, scene.sensor: cmv12000-nir-longpass800, samples: 32}
  world:
    as coded: {}
    in the text: {scene: paper, scene.camera.resolution: 400}
  trajectory: [box, helix]
"""


def cases(document):
    return [combination.campaign for combination in combinations(document)]


def test_a_choice_settles_its_keys_together_and_a_preset_goes_below_what_lies_within_it(campaign):
    white, infrared = cases(campaign(TEXT))[:4], cases(campaign(TEXT))[4:]
    assert {(c.scene.sensor.kind, c.samples) for c in white} == {("srgb8", 16)}
    assert {(c.scene.sensor.kind, c.samples) for c in infrared} == {("emva", 32)}
    sizes = [(c.scene.eye.radius, c.scene.camera.resolution, c.trajectory.kind) for c in white]
    assert sizes == [(12.5, 300, "box"), (12.5, 300, "helix"), (12.0, 400, "box"), (12.0, 400, "helix")]


def test_the_rows_of_named_choices_have_their_names_and_the_same_cases_as_listed_values(campaign):
    named = make_plan(campaign(TEXT))
    assert {(c.swept["light"], c.swept["world"]) for c in named.cases} == {
        (light, world) for light in ("white", "infrared") for world in ("as coded", "in the text")
    }
    listed = "scene: paper\nposes: 2\nsweep: {scene.illumination: [led-b3, ir850]}\n"
    choices = (
        "scene: paper\nposes: 2\nsweep: {light: {a: {scene.illumination: led-b3}, b: {scene.illumination: ir850}}}\n"
    )
    keys = [[case.key for case in make_plan(campaign(text)).cases] for text in (listed, choices)]
    assert keys[0] == keys[1]


def test_a_resolved_campaign_with_named_choices_reads_back_to_the_same_cases(campaign):
    document = campaign(TEXT)
    again = campaign(dump(resolved(document, {})), "again.yaml")
    assert [case.key for case in make_plan(again).cases] == [case.key for case in make_plan(document).cases]


def test_an_override_beats_the_choices_that_settle_the_same_key_or_one_above_it(campaign):
    small = override(campaign(TEXT), "scene.camera.resolution", "200", "--set")
    assert {c.scene.camera.resolution for c in cases(small)} == {200}
    assert {c.scene.eye.radius for c in cases(small)} == {12.0, 12.5}
    assert {c.samples for c in cases(override(campaign(TEXT), "samples", "8", "--set"))} == {8}


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("light: {a: {scene.ilumination: ir850}}", "c.yaml:3: scene.ilumination: unknown key"),
        ("light: {a: {lamp: ir850}}", "c.yaml:3: sweep.light.a: 'lamp' cannot be swept"),
        ("light: {a: ir850}", "c.yaml:3: sweep.light.a: must be a mapping of keys of the campaign, got 'ir850'"),
        ("light: {}", "c.yaml:3: sweep.light: must hold a choice"),
        ("power_w: {a: {}}", "c.yaml:3: sweep: 'power_w' cannot name choices"),
        ("Light: {a: {}}", "c.yaml:3: sweep: 'Light' cannot name choices"),
    ],
)
def test_a_wrong_choice_is_named_with_its_line(campaign, line, says):
    with pytest.raises(InputError) as error:
        cases(campaign(f"scene: paper\nsweep:\n  {line}\n"))
    assert says in str(error.value)
