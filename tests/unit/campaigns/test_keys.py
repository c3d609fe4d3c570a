"""Every key is explained, and the JSON Schema takes what the program takes."""

import copy
import re

import jsonschema
import pytest

from conespot.campaigns.command import main
from conespot.campaigns.json_schema import campaign_schema, scene_schema
from conespot.campaigns.key_paths import keys_of, models_of
from conespot.campaigns.key_words import default_words
from conespot.campaigns.schema import Campaign
from conespot.scene.document import read_document, shipped
from conespot.scene.identity import defaults
from conespot.scene.keys import known_keys, meaning, quantity_of

KEYS = list(keys_of(Campaign))


def test_every_key_that_a_campaign_may_hold_is_explained():
    missing = []
    for key in KEYS:
        try:
            meaning(key.model, key.name)
        except (KeyError, TypeError):
            missing.append(f"{key.model.__name__}.{key.name}")
    assert not missing, "scene/data/keys.yaml explains every key"


def test_nothing_is_explained_that_is_no_key():
    models = {name.rpartition("__scene__")[2].replace("__", "."): m for name, m in models_of(Campaign).items()}
    stale = {name: keys - set(models[name].model_fields) for name, keys in known_keys().items() if name in models}
    assert set(known_keys()) - set(models) == set()
    assert not {name: keys for name, keys in stale.items() if keys}


def test_every_default_that_is_a_quantity_says_where_it_comes_from():
    silent = set()
    for key in KEYS:
        value = None if key.field.is_required() else defaults(key.model).get(key.name)
        stated = quantity_of(key.field) and isinstance(value, str) and not re.match(r"0(\.0)? ", value)
        if stated and not meaning(key.model, key.name).source:
            silent.add(f"{key.model.__name__}.{key.name}: {default_words(key)}")
    assert not silent


@pytest.fixture(scope="module")
def campaigns():
    return jsonschema.Draft202012Validator(campaign_schema())


@pytest.fixture(scope="module")
def scenes():
    return jsonschema.Draft202012Validator(scene_schema())


def test_the_schema_is_one(campaigns):
    jsonschema.Draft202012Validator.check_schema(campaigns.schema)


@pytest.mark.parametrize("name", sorted(shipped("campaigns", "")))
def test_every_shipped_campaign_is_one_by_the_schema(campaigns, name):
    found = jsonschema.exceptions.best_match(campaigns.iter_errors(read_document(shipped("campaigns", "")[name]).data))
    assert found is None, found.message[:500]


@pytest.mark.parametrize("name", sorted(shipped("scene", "presets")))
def test_every_preset_is_a_scene_by_the_schema(scenes, name):
    scenes.validate(read_document(shipped("scene", "presets")[name]).data)


WHOLE = {
    "name": "mine",
    "scene": {"preset": "theatre", "beam": {"half_angle": "9 deg"}, "camera": {"lens": {"blur": "5 um"}}},
    "trajectory": {"kind": "csv", "file": "tips.csv"},
    "knowledge": {"rcm_sigma": "free"},
    "sweep": {
        "scene.sensor": ["linear", {"kind": "srgb8", "white": "2 W/m2/sr"}],
        "scene.camera.resolution": [500, "640x360", [640, 360]],
        "world": {"ideal": {"scene.motion": "none"}, "real": {"scene.motion": {"rms": "0.1 mm"}}},
    },
}
WRONG = {
    "a misspelt key": ("scene", {"preset": "theatre", "beem": "hard"}),
    "a misspelt key of a kind": ("scene", {"beam": {"kind": "hard", "half_angel": "9 deg"}}),
    "a key of another kind": ("scene", {"beam": {"kind": "hard", "blend": 1}}),
    "a missing unit": ("scene", {"eye": {"radius": 12}}),
    "a unit of another quantity": ("scene", {"eye": {"radius": "12 deg"}}),
    "a word that is none": ("scene", {"retina": "fundos"}),
    "a swept key that is none": ("sweep", {"scene.power.values": ["1 W"]}),
    "a swept value that is none": ("sweep", {"scene.power.value": ["1 mm"]}),
    "a swept value without a list": ("sweep", {"scene.power.value": "1 W"}),
    "a choice with a key that is none": ("sweep", {"world": {"real": {"scene.motoin": "none"}}}),
    "a localizer that is none": ("localizers", ["con"]),
    "an outer key that is none": ("pose", 5),
}


def test_the_schema_takes_what_a_file_may_say(campaigns):
    campaigns.validate(WHOLE)


@pytest.mark.parametrize("wrong", WRONG)
def test_the_schema_marks(campaigns, wrong):
    key, value = WRONG[wrong]
    assert not campaigns.is_valid({**copy.deepcopy(WHOLE), key: value})


def test_explain_says_unit_default_source_and_bounds(capsys):
    assert main(["explain", "beam.half_angle"]) == 0
    said = capsys.readouterr().out
    assert "half the full cone" in said
    for line in ("unit     deg", "default  9 deg", "source   paper, Table II", "allowed  above 0 deg, below 90 deg"):
        assert line in said
    assert main(["explain", "sweep.scene.eye.radius"]) == 0
    assert "12.5 mm in paper-code" in capsys.readouterr().out


def test_explain_lists_the_keys_of_a_common_name_and_refuses_none(capsys):
    assert main(["explain", "kind"]) == 0
    assert "name more of the path" in capsys.readouterr().out
    assert main(["explain", "half_angel"]) == 2
    assert "did you mean 'half_angle" in capsys.readouterr().err
