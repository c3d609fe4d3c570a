"""The presets `theatre`, `theatre-4k` and `theatre-ideal`, and what the campaign `reality` makes of them."""

import numpy as np

from conespot.campaigns.schema import combinations, read_campaign
from conespot.scene import load_scene
from conespot.scene.exposure_limits import scene_exposure

#: what a light brings along
_LIGHT = {"illumination", "power"}


def test_the_effects_of_the_campaign_are_those_of_the_theatre_and_together_all_of_them():
    cases = {case.chosen["effect"]: case.campaign.scene for case in combinations(read_campaign("reality"))}
    ideal, theatre = cases.pop("ideal"), cases.pop("theatre")
    assert _leaves(ideal) == _leaves(load_scene("theatre-ideal"))
    assert _leaves(theatre) == _leaves(load_scene("theatre"))
    first = _leaves(ideal)
    together = dict(first)
    for scene in cases.values():
        own = _leaves(scene)
        if "sensor.camera.kind" in own:  # a recorder has the camera within it
            own |= {key.replace(".camera", ""): own.pop(key) for key in list(own) if key.startswith("sensor.camera.")}
        together |= {key: value for key, value in own.items() if first.get(key, 0.0) != value}
    theatre = {key.replace("sensor.camera.", "sensor."): value for key, value in _leaves(load_scene("theatre")).items()}
    assert {**together, "sensor.kind": ""} == {**theatre, "sensor.kind": ""}


def _leaves(data, path=()):
    data = data.model_dump(mode="json", exclude=_LIGHT) if not isinstance(data, dict) else data
    found = {}
    for key, value in data.items():
        at = (*path, str(key))
        found |= _leaves(value, at) if isinstance(value, dict) else {".".join(at): value}
    return {key: value for key, value in found.items() if value is not None}


def test_the_theatre_in_4k_has_twice_the_pixels_on_the_same_field():
    hd, uhd = load_scene("theatre"), load_scene("theatre-4k")
    points = np.array([[0.0, 0.0, 0.0], [2.0, 1.0, 0.2], [-2.0, 0.5, 0.2]])
    np.testing.assert_allclose(uhd.camera.project(points), 2.0 * hd.camera.project(points), atol=1e-6)
    assert uhd.sensor.camera.f_number == 2.0 * hd.sensor.camera.f_number
    changed = {key for key, value in _leaves(uhd).items() if _leaves(hd)[key] != value}
    assert changed == {
        "camera.resolution",
        "camera.sensor_width",
        "camera.focal_length",
        "sensor.camera.f_number",
    }


def test_the_theatre_shows_the_whole_outline_of_every_pose_of_the_campaign():
    case = next(c for c in combinations(read_campaign("reality")) if c.chosen["effect"] == "theatre")
    scene = case.campaign.scene
    tips = case.campaign.trajectory.positions(24, np.random.default_rng(0))
    columns, rows = scene.camera.resolution
    for tip in tips:
        outline = scene.camera.project(scene.outline(scene.pose(tip), 0))
        assert np.all((outline > 0.0) & (outline < (columns, rows)))
        assert np.all(scene.camera.shows(outline))


def test_the_theatre_reaches_the_dose_of_its_light_after_eight_minutes_on_one_place():
    scene = load_scene("theatre")
    exposed = scene_exposure(scene, [scene.pose(np.array([1.5, 0.0, 3.0]))], scene.power.value)
    assert 7.0 < exposed.seconds_to_dose / 60.0 < 10.0
    assert exposed.thermal_ratio < 0.1
