"""campaigns.cases: a run says what its cases are, wherever and how often it is read."""

import json

import pytest

from conespot.campaigns.cases import write_cases
from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import read_campaign, resolved
from conespot.campaigns.store import open_store
from conespot.results.cases import read_cases
from conespot.scene.document import dump, shipped

BEAMS = """\
scene: paper-code
poses: 2
localizers: [paper-code, cone]
sweep:
  scene.beam: [{kind: hard, half_angle: 8 deg}, {kind: linear, half_angle: 9 deg, beam_width: 5 deg}]
  scene.power: [{value: 1 W, convention: isotropic}, {value: 2 mW, convention: flux}]
"""


@pytest.fixture
def document(tmp_path):
    def write(text):
        (tmp_path / "c.yaml").write_text(text)
        return read_campaign(str(tmp_path / "c.yaml"))

    return write


def written(document, folder):
    write_cases(folder, make_plan(document))
    return (folder / "cases.jsonl").read_bytes()


@pytest.fixture
def said(tmp_path):
    return lambda document: [json.loads(line) for line in written(document, tmp_path).splitlines()]


def test_every_case_of_a_sweep_over_whole_beams_and_powers_states_its_own(document, said):
    cases = said(document(BEAMS))
    assert [case["assumes"]["edge"] for case in cases] == 2 * ["hard, half angle 8 deg"] + 2 * [
        "linear from 5 deg, half angle 9 deg"
    ]
    conventions = [case["assumes"]["power_convention"] for case in cases]
    assert conventions == 2 * ["isotropic (I0 = P / 4 pi)", "flux (P leaves the tip)"]
    assert [case["watts"]["flux_w"] for case in cases[1::2]] == pytest.approx([2e-3] * 2)
    assert [case["watts"]["isotropic_w"] for case in cases[::2]] == pytest.approx([1.0] * 2)


def test_a_case_states_labels_localizers_and_what_they_are_told(document, said):
    plan = make_plan(document(BEAMS))
    case = said(document(BEAMS))[1]
    assert (case["key"], case["frame"]) == (plan.cases[1].key, plan.cases[1].frame)
    assert case["labels"] == {**plan.cases[1].labels, **plan.cases[1].swept}
    assert list(case["localizers"]) == ["paper-code", "cone"]
    assert case["localizers"]["cone"]["threshold"] == "none (edges below the pixel)"
    assert case["told"]["rcm_sigma"] == "0.05 mm"
    assert (case["trajectory"]["kind"], case["poses"], case["bounds"]) == ("box", 2, False)


@pytest.mark.parametrize(
    ("key", "item", "words"),
    [
        ("surface", "bumps", "15 bumps (0.5 mm across, 0.1 mm high)"),
        ("surface", "{semi_axes: [1, 1, 1.1]}", "ellipsoid 1 x 1 x 1.1"),
        (
            "sensor",
            "cmv12000-nir-longpass800",
            "cmv12000-nir (EMVA 1288), linear, 12 bit, f/4, metered once to 80 % of saturation, long pass 800 nm",
        ),
        ("sensor", "{kind: linear, white: 2 W/m2/sr, bits: 10}", "linear, 10 bit, white 2 W/m2/sr"),
    ],
)
def test_surface_and_sensor_are_described_and_not_only_named(document, key, item, words, said):
    assumes = said(document(f"scene: paper\nposes: 2\nsweep: {{scene.{key}: [{item}]}}\n"))[0]["assumes"]
    assert words in assumes.values()


def test_points_of_a_file_stand_as_its_name_and_a_digest(document, tmp_path, said):
    (tmp_path / "tips.csv").write_text("x_mm,y_mm,z_mm\n0,0,3\n1,0,4\n")
    trajectory = said(document("scene: paper\nposes: 2\ntrajectory: {kind: csv, file: tips.csv}\n"))[0]["trajectory"]
    assert trajectory["file"] == "tips.csv"
    assert len(trajectory["digest"]) == 16
    assert "points" not in trajectory


@pytest.mark.parametrize("name", sorted(shipped("campaigns", "")))
def test_a_resolved_campaign_is_described_as_the_one_it_came_from_and_results_reads_that(tmp_path, name):
    document = read_campaign(name)
    (tmp_path / "campaign.yaml").write_text(dump(resolved(document, {})))
    again = read_campaign(str(tmp_path / "campaign.yaml"))
    first = written(document, tmp_path)
    assert written(again, tmp_path) == first
    plan = make_plan(document)
    read = read_cases(tmp_path)
    assert list(read) == [case.key for case in plan.cases]
    assert [case.labels for case in read.values()] == [{**case.labels, **case.swept} for case in plan.cases]


def test_a_run_writes_it_when_it_begins_and_the_same_when_it_goes_on(document, tmp_path):
    campaign = document(BEAMS)
    plan = make_plan(campaign)
    for _ in range(2):
        with open_store(tmp_path / "run", plan, campaign):
            pass
        assert (tmp_path / "run" / "cases.jsonl").read_bytes() == written(campaign, tmp_path)
