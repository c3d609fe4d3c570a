"""results.assumptions: every number says what it assumes, row by row."""

import math

import pytest

from conespot.results.assumptions import Assumptions, assumptions, both_conventions, scene_of
from conespot.scene import load_scene


@pytest.fixture
def scene(make_campaign):
    return make_campaign()["scene"]


def test_the_preset_as_coded(scene):
    assert assumptions(scene, {"localizer": "paper-code", "sensor": "srgb8"}) == Assumptions(
        radius="12.5 mm",
        edge="Cycles blend 1 (fully soft), half angle 9 deg",
        power_convention="isotropic (I0 = P / 4 pi)",
        transfer="sRGB, 8 bit, white 1 W/m2/sr",
        threshold="fixed 50 of 255 after median 9, outline cut to whole pixels",
        ambiguity="RCM for one spotlight, least spread for several",
    )


def test_an_oracle_says_that_it_is_one(scene):
    assert "truth" in assumptions(scene, {"localizer": "paper-code-oracle"}).ambiguity
    assert assumptions(scene, {"localizer": "paper"}).threshold.startswith("Otsu")


def test_swept_values_overrule_the_scene(scene):
    found = assumptions(
        scene,
        {
            "localizer": "cone",
            "eye.radius": "11 mm",
            "beam.kind": "hard",
            "beam.half_angle": "7 deg",
            "scene.power.convention": "flux",
            "sensor": "linear",
        },
    )
    assert (found.radius, found.edge, found.transfer) == ("11 mm", "hard, half angle 7 deg", "linear")
    assert found.power_convention.startswith("flux")


def test_a_swept_preset_is_filled_in():
    radius = {name: assumptions({}, {"scene": name, "localizer": "x"}).radius for name in ("paper", "paper-code")}
    assert radius == {"paper": "12 mm", "paper-code": "12.5 mm"}
    assert scene_of({"preset": "paper", "eye": {"radius": "11 mm"}}, {})["eye"] == {"radius": "11 mm"}


def test_a_preset_that_is_a_file_is_not_opened(tmp_path):
    (tmp_path / "mine.yaml").write_text("eye: {radius: 11 mm}")
    assert assumptions({}, {"scene": str(tmp_path / "mine.yaml"), "localizer": "x"}).radius == "not stated"


@pytest.mark.parametrize(
    ("beam", "said"),
    [
        ({"kind": "hard", "half_angle": "9 deg"}, "hard, half angle 9 deg"),
        ({"kind": "cycles", "half_angle": "9 deg", "blend": 0.15}, "Cycles blend 0.15, half angle 9 deg"),
        ({"kind": "linear", "half_angle": "9 deg", "beam_width": "5 deg"}, "linear from 5 deg, half angle 9 deg"),
        ({"kind": "table", "angles": ["0 deg", "8 deg"], "intensities": [1, 0]}, "tabulated, half angle 8 deg"),
        ("{kind: hard}", "{kind: hard}"),
        ({"kind": "laser"}, "laser"),
        (None, "not stated"),
        ([1, 2], "not stated"),
    ],
)
def test_every_edge_profile_has_words(beam, said):
    assert assumptions({"beam": beam}, {}).edge == said


def test_a_run_that_states_nothing_is_said_to(scene):
    found = assumptions({}, {"localizer": "mine"})
    assert (found.radius, found.edge, found.transfer) == ("not stated",) * 3
    assert found.threshold == "see mine"


def test_one_isotropic_watt_is_three_milliwatts_of_flux(scene):
    watts = both_conventions(scene, 1.0)
    assert watts.axial_intensity == pytest.approx(1.0 / (4.0 * math.pi))
    # (P / 2) (1 - cos b) (1 - blend / 2)
    assert watts.flux_w == pytest.approx(0.5 * (1.0 - math.cos(math.radians(9.0))) * 0.5)
    assert watts.isotropic_w == pytest.approx(1.0)
    assert watts.words() == "1 W isotropic (3.08 mW flux)"


def test_the_conventions_are_each_others_inverse(scene):
    flux = {**scene, "power": {"value": "1 W", "convention": "flux"}}
    there = both_conventions(scene, 0.25).flux_w
    assert both_conventions(flux, there).isotropic_w == pytest.approx(0.25)
    assert both_conventions(flux, there).flux_w == pytest.approx(there)


def test_power_agrees_with_the_scene_room(scene):
    power = load_scene("paper-code").power
    assert both_conventions(scene, power.value).flux_w == pytest.approx(power.flux(load_scene("paper-code").beam))


def test_without_a_beam_or_a_convention_there_is_no_flux(scene):
    assert both_conventions({}, 1.0) is None
    assert both_conventions({"beam": scene["beam"], "power": {"convention": "lumen"}}, 1.0) is None
