"""campaigns.plan: cases by content, groups that share renderings, seeds that depend on nothing else."""

import re

import numpy as np
import pytest

from conespot.campaigns.plan import frame_seed, make_plan, tile_seed
from conespot.campaigns.plan_words import describe
from conespot.campaigns.schema import Campaign, override, read_campaign
from conespot.scene import Eye, InputError, Scene


@pytest.fixture
def plan(tmp_path):
    def make(text):
        (tmp_path / "c.yaml").write_text(text)
        return make_plan(read_campaign(str(tmp_path / "c.yaml")))

    return make


def test_powers_and_localizers_cost_no_rendering(plan):
    """Renderings of a campaign over one power and one localizer, against seven powers and two localizers: equal."""
    one = plan("scene: paper\nposes: 4\nsweep: {scene.spotlights: [single, triple]}\n")
    many = plan(
        "scene: paper\nposes: 4\nlocalizers: [paper, paper-code]\n"
        "sweep:\n  scene.spotlights: [single, triple]\n"
        "  scene.power.value: [0.1 W, 0.2 W, 0.3 W, 0.4 W, 0.5 W, 0.6 W, 1 W]\n"
    )
    assert one.tiles == many.tiles == 4 + 12
    assert one.scenes == many.scenes == 2
    assert many.frames == 7 * one.frames
    assert many.rows == 14 * one.rows
    assert [u.pose for u in many.units()] == [u.pose for u in one.units()]


def test_the_shipped_power_sweep_is_2800_frames_of_800_tiles():
    sweep = make_plan(read_campaign("power_sweep"))
    assert (len(sweep.cases), sweep.frames, sweep.rows, sweep.tiles, sweep.scenes) == (28, 2800, 5600, 800, 2)


def test_a_case_is_what_it_holds_and_not_how_it_is_written(plan):
    one = plan("scene: {preset: paper, power: {value: 500 mW}}\n")
    other = plan("name: other\nscene: {preset: paper}\nsweep: {scene.power.value: [0.5 W]}\n")
    assert [c.key for c in one.cases] == [c.key for c in other.cases]
    assert one.identity == other.identity
    assert plan("scene: {preset: paper}\nseed: 2\n").cases[0].key != one.cases[0].key


def test_a_case_that_two_products_hold_stands_once_with_the_localizers_of_both(plan):
    both = plan("scene: paper\nsweep:\n - {localizers: [[paper]]}\n - {localizers: [[paper-code, paper]]}\n")
    assert [c.localizers for c in both.cases] == [("paper", "paper-code")]


def test_a_table_of_positions_is_the_same_case_from_any_folder(plan, tmp_path):
    rows = "x_mm,y_mm,z_mm\n0,0,3\n"
    (tmp_path / "a.csv").write_text(rows)
    (tmp_path / "b.csv").write_text(rows)
    text = "scene: paper\nposes: 1\ntrajectory: {kind: csv, file: %s.csv}\n"
    assert plan(text % "a").identity == plan(text % "b").identity


def test_random_positions_are_the_same_in_every_scene_and_change_with_the_seed(plan):
    text = "scene: paper\nposes: 5\ntrajectory: random\nseed: {}\nsweep: {{scene.surface: [smooth, bumps]}}\n"
    first, second = plan(text.format(1)).groups
    assert np.array_equal(first.positions, second.positions)
    assert not np.array_equal(first.positions, plan(text.format(2)).groups[0].positions)


def test_seeds_differ_by_pose_spotlight_case_and_campaign_seed_alone(plan):
    text = "scene: paper\nposes: 3\nseed: {}\nsweep: {{scene.spotlights: [triple], scene.power.value: [0.5 W, 1 W]}}\n"
    one = plan(text.format(1))
    tiles = [tile_seed(one, u, k) for u in one.units() for k in range(3)]
    frames = [frame_seed(u, c) for u in one.units() for c in one.cases]
    assert len({*tiles, *frames}) == 15
    assert tiles == [tile_seed(plan(text.format(1)), u, k) for u in one.units() for k in range(3)]
    other = plan(text.format(2))
    assert not {tile_seed(other, u, k) for u in other.units() for k in range(3)} & set(tiles)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "scene: paper\ntrajectory: {kind: helix, start_height: 20 mm}\n",
            r"c\.yaml:2: pose \d+ of the helix: the tip at .* is outside the eye \(radius 12 mm\)",
        ),
        (
            "scene: paper\nsweep:\n  trajectory:\n   - box\n   - {kind: line, end: [30 mm, 0 mm, 3 mm]}\n",
            r"c\.yaml:5: pose",
        ),
        (
            "scene: paper\ntrajectory: {kind: line, start: [6 mm, 0 mm, 22 mm]}\n",
            "coincides with the remote centre of motion|outside",
        ),
        ("description: nothing\n", "scene: is required but missing"),
        ("theory: [table-1]\nposes: 3\n", "scene: is required but missing"),
        (
            "scene: paper\nposes: 100000\nsweep: {scene.surface: [smooth, bumps], seed: [1, 2, 3, 4, 5, 6]}\n",
            "more than 1000000 rows",
        ),
    ],
)
def test_a_campaign_that_cannot_be_planned_says_why(plan, text, says):
    with pytest.raises(InputError, match=says):
        plan(text)


def test_too_few_positions_in_a_file_are_refused(plan, tmp_path):
    (tmp_path / "tips.csv").write_text("x_mm,y_mm,z_mm\n0,0,3\n")
    with pytest.raises(InputError, match="has 1 positions but 100 poses are asked for"):
        plan("scene: paper\ntrajectory: {kind: csv, file: tips.csv}\n")


def test_standing_columns_tell_the_papers_sweeps_apart(plan):
    case = plan("scene: paper-code\nsweep: {trajectory: [helix], scene.surface: [bumps]}\n").cases[0]
    assert case.labels == {
        "trajectory": "helix",
        "spotlights": "single",
        "power_w": 1.0,
        "illumination": "white",
        "surface": "bumps",
        "sensor": "srgb8",
        "resolution_px": 5000,
    }
    assert case.swept == {}


def test_other_swept_keys_become_columns_as_they_are_written(plan):
    first = "{scene.beam.half_angle: [8 deg, 9.5 deg], scene.beam.blend: [0.5]}"
    text = f"scene: paper\nsweep:\n - {first}\n - {{samples: [4]}}\n"
    assert [c.swept for c in plan(text).cases] == [
        {"beam.half_angle": "8 deg", "beam.blend": 0.5, "samples": 16},
        {"beam.half_angle": "9.5 deg", "beam.blend": 0.5, "samples": 16},
        {"beam.half_angle": "9 deg", "beam.blend": 1, "samples": 4},
    ]


def test_swept_presets_are_called_by_their_names(plan):
    for key in ("scene", "scene.preset"):
        cases = plan(f"scene: {{camera: {{resolution: 300}}}}\nsweep: {{{key}: [paper, paper-code]}}\n").cases
        assert [c.swept for c in cases] == [{key: "paper"}, {key: "paper-code"}]


def test_two_helices_bear_different_names(plan):
    cases = plan("scene: paper\nsweep: {trajectory: [{kind: helix, turns: 2}, {kind: helix, turns: 1}, box]}\n").cases
    assert [c.labels["trajectory"] for c in cases] == ["{kind: helix, turns: 2}", "{kind: helix, turns: 1}", "box"]


def test_the_description_states_both_power_conventions_and_the_renderings():
    document = override(read_campaign("power_sweep"), "poses", "10", "--poses")
    text = "\n".join(describe(make_plan(document), workers=2))
    assert "1 W isotropic = 3.078 mW flux" in text
    assert "80 tiles and 2 backgrounds are rendered" in text
    assert "280 frames, 560 localizations" in text


def test_the_description_is_a_table_of_what_varies_and_not_a_line_a_case():
    plan = make_plan(override(read_campaign("power_sweep"), "poses", "10", "--poses"))
    lines = [re.split(r"\s{2,}", line.strip()) for line in describe(plan, workers=2)]
    table = dict(line for line in lines if len(line) == 2)
    assert table["trajectory"] == "box, helix"
    assert table["spotlights"] == "single, triple"
    assert table["in all"] == "white, smooth, srgb8, 5000 px, paper-code and paper"
    assert table["power"] == "0.05 W isotropic = 0.1539 mW flux"
    assert len(lines) < len(plan.cases)
    assert not [line for line in lines if plan.cases[0].key in line]


def test_of_many_values_the_first_and_the_last_are_shown_and_how_many(plan):
    powers = ", ".join(f"{p} W" for p in range(1, 41))
    text = "\n".join(describe(plan(f"scene: paper\nposes: 1\nsweep: {{scene.power.value: [{powers}]}}\n"), 1))
    assert "(40 in all)" in text
    assert "40 W isotropic" in text
    assert " 20 W" not in text


def test_memory_grows_with_workers_and_disk_with_frames_that_are_kept(plan):
    text = "scene: {{preset: paper, camera: {{resolution: 1000}}}}\nposes: 10\nframes: {}\n"
    few, kept = (list(describe(plan(text.format(frames)), n))[-1] for frames, n in (("false", 1), ("true", 3)))
    assert few == "about 1.1 GB of memory, and 5 MB of disk"
    assert kept == "about 2.5 GB of memory, and 45 MB of disk"
    large = "scene: {preset: paper, camera: {resolution: 10000}}\nposes: 1\n"
    assert list(describe(plan(large), 2))[-1].startswith("about 2.7 GB of memory")


def test_memory_grows_with_the_frame_where_light_spreads_under_the_retina(plan):
    """One worker of a living fundus without and with spread, beside what was measured in docs/performance.md."""
    text = "scene: {{preset: theatre-ideal, camera: {{resolution: [{}]}}, retina: {{kind: fundus{}}}}}\nposes: 1\n"
    spread = ", spread: {scattering: 1}"
    cases = (("1920, 1080", ""), ("3840, 2160", ""), ("1920, 1080", spread), ("3840, 2160", spread))
    found = [list(describe(plan(text.format(size, how)), 1))[-1].split(" GB")[0] for size, how in cases]
    assert found == ["about 1.6", "about 1.6", "about 1.7", "about 1.9"]


def test_edge_samples_are_rendered_apart_and_are_counted_as_work_where_the_beam_is_hard(plan):
    """Groups and the stated time with 0 and 65,536 samples on the edge, of a hard and of a soft beam."""
    text = "scene: paper\nposes: 4\nedge_samples: {}\nsweep: {{scene.beam: [{{kind: {}}}]}}\n"
    stated = {}
    for kind in ("hard", "cycles"):
        plain, fine = (plan(text.format(n, kind)) for n in (0, 65536))
        assert [g.edge_samples for g in (*plain.groups, *fine.groups)] == [0, 65536]
        assert plain.groups[0].scene_key != fine.groups[0].scene_key
        assert tile_seed(plain, next(plain.units()), 0) != tile_seed(fine, next(fine.units()), 0)
        stated[kind] = [next(line for line in describe(p, 1) if line.startswith("about")) for p in (plain, fine)]
    assert stated["cycles"][0] == stated["cycles"][1]
    assert stated["hard"][0] != stated["hard"][1]


def test_a_key_that_is_new_to_campaign_and_scene_names_nothing_anew(plan, monkeypatch):
    """Keys of all cases, frames and groups with a campaign of one key more in itself and in its eye: as without."""
    text = "scene: {preset: paper-code, beam: {kind: hard}}\nposes: 2\nsweep: {scene.power.value: [0.5 W, 1 W]}\n"

    class GlossyEye(Eye):
        gloss: float = 0.0

    class GlossyScene(Scene):
        eye: GlossyEye = GlossyEye()

    class LaterCampaign(Campaign):
        scene: GlossyScene = GlossyScene()
        frame_rate: int = 30

    def names(made):
        groups = [(g.key, g.scene_key) for g in made.groups]
        return made.identity, [(c.key, c.frame) for c in made.cases], groups

    now = names(plan(text))
    monkeypatch.setattr("conespot.campaigns.schema.Campaign", LaterCampaign)
    assert names(plan(text)) == now
    for changed in (text + "frame_rate: 60\n", text.replace("{preset", "{eye: {gloss: 0.5}, preset")):
        later = names(plan(changed))
        assert later[0] != now[0]
        assert not {key for case in later[1] for key in case} & {key for case in now[1] for key in case}
        assert later[2][0][0] != now[2][0][0]


def test_every_name_is_another_one(plan):
    made = plan("scene: {}\nposes: 1\n")
    names = [made.identity, made.cases[0].key, made.cases[0].frame, made.groups[0].key, made.groups[0].scene_key]
    assert len(set(names)) == 5


def test_a_seed_of_the_campaign_that_is_swept_over_moves_nothing(plan):
    text = "scene: paper\nposes: 1\nseed: {}\nsweep: {{seed: [1, 2]}}\n"
    first, other = plan(text.format(1)), plan(text.format(7))
    assert first.identity == other.identity
    assert [tile_seed(p, u, 0) for p in (first, other) for u in p.units()] == 2 * [
        tile_seed(first, u, 0) for u in first.units()
    ]


def test_a_plan_states_lens_motion_and_optics_in_a_tables_words_and_counts_what_they_cost(plan):
    """By the clock of one worker, two poses of 96 px: a theatre's fits alone take 2 s more than its ideal world's."""
    text = "scene: {{preset: {}, camera: {{resolution: 96}}}}\nposes: 2\nlocalizers: [cone]\n"
    text += "trajectory: {{kind: helix, radius: 1.5 mm, start_height: 3 mm, pitch: 0.1 mm}}\n"
    ideal, real = ("\n".join(describe(plan(text.format(name)), 1)) for name in ("theatre-ideal", "theatre"))
    said = " ".join(real.split())
    for words in ("glare 2 %", "hand tremor 0.182 mm rms", "navarro eye, phakic, flat contact lens, pupil 8 mm"):
        assert words in said
        assert words not in ideal
    took = [float(re.search(r"about (\d+) s on 1 workers", found)[1]) for found in (ideal, real)]
    assert took[1] >= took[0] + 2.0
