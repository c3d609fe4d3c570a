"""A run against what is expected of it: the numbers are those of the tables, and nothing unclear passes."""

import json
import xml.etree.ElementTree as ET

import pandas as pd
import pytest

from conespot.results import load_run, write_results
from conespot.results.check import check, verdict_table
from conespot.results.expectation import Expectation
from conespot.results.junit import junit

CELL = {"trajectory": "box", "spotlights": "single", "power_w": 1}


@pytest.fixture(scope="module")
def rows(make_rows):
    return make_rows(powers=(0.25, 1.0), failing=0.2)


@pytest.fixture(scope="module")
def run(tmp_path_factory, make_run, rows):
    return load_run(make_run(tmp_path_factory.mktemp("check") / "run", rows, theory=True))


def expectation(metric="AE mm", where=CELL, **bound):
    return Expectation(metric=metric, where=where, **(bound or {"at_least": 0}))


def verdict(run, *arguments, **named):
    (found,) = check(run, [expectation(*arguments, **named)])
    return found


def lines(rows, **where):
    for column, value in where.items():
        rows = rows[rows[column] == value]
    return rows


def test_what_others_scored_counts_for_no_expectation_that_does_not_name_it(tmp_path, make_run, make_cases, rows):
    theirs = rows.assign(localizer="theirs", status="failed", position_error_mm=float("nan"))
    both = load_run(make_run(tmp_path / "run", pd.concat([rows, theirs]), described=make_cases(rows)))
    alone = (lines(rows, **CELL)["status"] == "failed").mean()
    for localizer in ({}, {"localizer": "any"}):
        assert verdict(both, "failed share", {**CELL, **localizer}).found == pytest.approx(alone)
    assert verdict(both, "failed share", {**CELL, "localizer": "theirs"}).found == 1.0


@pytest.mark.parametrize(
    ("metric", "column", "statistic"),
    [
        ("AE mm", "position_error_mm", "mean"),
        ("ME mm", "position_error_mm", "max"),
        ("AE deg", "rotation_error_deg", "mean"),
        ("ME deg", "rotation_error_deg", "max"),
    ],
)
def test_what_is_found_is_the_statistic_of_the_rows_that_are_meant(run, rows, metric, column, statistic):
    assert verdict(run, metric).found == pytest.approx(lines(rows, **CELL)[column].agg(statistic), rel=1e-12)


def test_failures_are_a_share_of_all_frames(run, rows):
    mine = lines(rows, **CELL)
    share = verdict(run, "failed share").found
    assert 0.0 < share < 1.0
    assert share == pytest.approx((mine["status"] == "failed").mean())


def test_table_1_is_found_by_half_angle(run):
    assert verdict(run, "Table I um", {"half_angle_deg": 11}).found == 0.90


def test_a_list_of_labels_takes_their_lines_together_and_any_those_of_all(run, rows):
    pooled = lines(rows, spotlights="single", power_w=1.0)["position_error_mm"].mean()
    for both in (["box", "helix"], "any"):
        assert verdict(run, where={**CELL, "trajectory": both}).found == pytest.approx(pooled, rel=1e-12)


@pytest.mark.parametrize(
    ("bound", "holds"),
    [
        ({"value": 10, "within": "10 %"}, lambda x: 9 <= x <= 11),
        ({"value": 10, "within": 0.5}, lambda x: 9.5 <= x <= 10.5),
        ({"at_most": 9.7}, lambda x: x <= 9.7),
        ({"at_least": 9.7}, lambda x: x >= 9.7),
        ({"value": 10, "at_most": "95 %"}, lambda x: x <= 9.5),
        ({"value": 10, "at_least": "150%"}, lambda x: x >= 15),
    ],
)
def test_a_bound_holds_up_to_its_end_and_not_beyond(bound, holds):
    for found in (8.9, 9.1, 9.4, 9.6, 9.8, 10.4, 10.6, 10.9, 11.1, 14.9, 15.1):
        assert expectation(**bound).met_by(found) == holds(found), found
    assert not expectation(**bound).met_by(float("nan"))


def test_a_cell_without_a_localized_frame_misses(tmp_path, make_run, make_rows):
    lost = load_run(make_run(tmp_path / "run", make_rows(poses=3, failing=1.1)))
    found = verdict(lost, at_most=1000.0)
    assert not found.holds
    assert not found.unclear


@pytest.mark.parametrize(
    ("where", "says"),
    [
        ({"trajectory": "box", "spotlights": "single"}, "does not say which power_w; there are 0.25, 1"),
        ({}, "does not say which trajectory; there are box, helix"),
        ({**CELL, "trajectory": "hlix"}, "no line with hlix as trajectory; there are box, helix"),
        ({**CELL, "trajectory": ["box", "spiral"]}, "no line with box, spiral as trajectory; there are box, helix"),
        ({**CELL, "power_w": 2}, "no line with 2 as power_w; there are 0.25, 1"),
        ({**CELL, "rig": "single"}, "there is no 'rig'; there are trajectory, spotlights, power_w"),
    ],
)
def test_what_is_not_there_or_not_one_cell_is_never_judged_and_the_labels_are_named(run, where, says):
    found = verdict(run, where=where)
    assert says in found.unclear
    assert not found.holds


def test_a_metric_whose_table_the_run_has_not_is_not_judged(run):
    assert "nothing that 'white W/m2/sr' is about" in verdict(run, "white W/m2/sr", {}).unclear


def test_a_run_that_is_not_finished_is_not_judged(tmp_path, make_run, make_rows, make_cases):
    frame = make_rows(poses=5, powers=(1.0,))
    half = load_run(make_run(tmp_path / "run", frame[frame["pose"] < 3], described=make_cases(frame)))
    assert "3 of 5 poses are finished" in verdict(half).unclear


def test_the_table_says_expected_found_ratio_and_verdict(run):
    target = verdict(run).found
    verdicts = check(run, [expectation(value=2 * target, within=f"{p} %", source="Table IV") for p in (60, 40)])
    text = verdict_table(verdicts).text()
    assert "1 of 2 hold" in text
    assert [line.split()[-2:] for line in text.splitlines() if "Table IV" in line] == [
        ["0.5", "holds"],
        ["0.5", "MISSES"],
    ]


def test_junit_counts_and_escapes_whatever_the_file_holds(run):
    names = {**CELL, "illumination": '<script>"&'}
    verdicts = check(run, [expectation(), expectation(at_most=0), Expectation(metric="AE mm", where=names, at_most=1)])
    suites = ET.fromstring(junit("a <&> name \x00", verdicts))
    (suite,) = suites
    for element in (suites, suite):
        assert [element.get(name) for name in ("tests", "failures", "errors")] == ["3", "1", "1"]
    fine, missed, unclear = suite
    assert (fine.tag, len(fine)) == ("testcase", 0)
    assert fine.get("classname") == "a <&> name ?"
    assert [child.tag for child in missed] == ["failure"]
    assert "expected at most 0, found" in missed[0].text
    assert [child.tag for child in unclear] == ["error"]
    assert '<script>"&' in unclear.get("name")


def test_the_report_holds_the_verdicts_of_what_the_run_can_tell(tmp_path, make_run, make_campaign, make_rows):
    rows = make_rows(poses=3, trajectories=("box",), rigs=("single",), powers=(1.0,))
    expected = [
        {"metric": "AE mm", "where": CELL, "at_most": 1e-9},
        {"metric": "AE mm", "where": {**CELL, "trajectory": "spiral"}, "at_most": 1},
    ]
    folder = make_run(tmp_path / "run", rows, document=make_campaign(expect=expected))
    write_results(folder)
    (line,) = pd.read_csv(folder / "tables" / "expectations.csv").to_dict("records")
    assert line["verdict"] == "misses"
    report = (folder / "report.html").read_text()
    assert "MISSES" in report
    assert "1 more are about what is not" in report


@pytest.mark.parametrize(
    "entry",
    [
        {"metric": "AE mm"},
        {"metric": "AE km", "at_most": 1},
        {"metric": "AE mm", "value": 1},
        {"metric": "AE mm", "within": "10 %"},
        {"metric": "AE mm", "at_most": "10 %"},
        {"metric": "AE mm", "value": 1, "within": "10"},
        {"metric": "AE mm", "value": 1, "within": 0.1, "at_most": 2},
        {"metric": "AE mm", "at_most": True},
        {"metric": "AE mm", "at_most": 1, "where": {"trajectory": []}},
        {"metric": "AE mm", "at_most": 1, "where": {"trajectory": None}},
        {"metric": "AE mm", "at_most": 1, "where": {"trajectory": [["box"]]}},
        {"metric": "AE mm", "at_most": 1, "where": {"trajectory": "box\n"}},
        {"metric": "AE mm", "at_most": 1, "where": {"power_w": float("inf")}},
        {"metric": "AE mm", "at_most": 1, "tolerance": 1},
    ],
)
def test_what_is_no_expectation_is_refused(entry):
    with pytest.raises(ValueError, match=r"needs|unknown|must|write|expected a number"):
        Expectation(**entry)


def test_a_label_stays_the_word_or_the_number_it_is_written_as():
    where = expectation(where={"beam": "1", "power_w": 1, "surface": ["1", 2]}).where
    assert [*map(repr, where.values())] == ["'1'", "1.0", "('1', 2.0)"]


def test_an_expectation_reads_back_from_plain_data():
    one = expectation(where={**CELL, "localizer": ["a", "b"]}, value=0.026, within="10 %", source="Table IV")
    assert Expectation.model_validate_json(json.dumps(one.model_dump(mode="json"))) == one
