"""results.boxes against matplotlib's own box statistics, closed forms, and the invariants of a Tukey box."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.cbook import boxplot_stats
from pandas.api.types import is_numeric_dtype

from conespot.results.boxes import STATISTICS, box_statistics, box_table, encode_boxes, read_boxes
from conespot.results.columns import METRICS, SETTING
from conespot.results.rows import Rows

values = st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=60)


@given(values)
def test_agrees_with_matplotlib(x):
    ours, (theirs,) = box_statistics(x), boxplot_stats(x, whis=1.5)
    names = {"mean": "mean", "median": "med", "q1": "q1", "q3": "q3", "whisker_low": "whislo", "whisker_high": "whishi"}
    for mine, his in names.items():
        assert ours[mine] == pytest.approx(theirs[his], rel=1e-12, abs=1e-9), mine
    assert ours["outliers"] == pytest.approx(sorted(theirs["fliers"]))


@given(values)
def test_parts_are_in_order(x):
    b = box_statistics(x)
    assert b["min"] <= b["whisker_low"] <= b["q1"] <= b["median"] <= b["q3"] <= b["whisker_high"] <= b["max"]
    assert b["min"] <= b["mean"] <= b["max"]


@given(values)
def test_every_value_is_inside_the_whiskers_or_an_outlier(x):
    b = box_statistics(x)
    inside = [v for v in x if b["whisker_low"] <= v <= b["whisker_high"]]
    assert sorted(inside + b["outliers"]) == sorted(x)
    assert b["n"] == len(x)


@given(values)
def test_whiskers_reach_at_most_one_and_a_half_boxes(x):
    b = box_statistics(x)
    reach = 1.5 * (b["q3"] - b["q1"])
    assert b["q1"] - b["whisker_low"] <= reach * (1 + 1e-12)
    assert b["whisker_high"] - b["q3"] <= reach * (1 + 1e-12)


def test_a_known_box():
    b = box_statistics([*range(1, 12), 100.0])
    assert (b["q1"], b["median"], b["q3"]) == (3.75, 6.5, 9.25)
    assert (b["whisker_low"], b["whisker_high"], b["outliers"]) == (1.0, 11.0, [100.0])
    assert b["mean"] == pytest.approx(166 / 12)


def test_without_a_localized_frame_there_are_failures_and_no_numbers():
    b = box_statistics([], failed=9)
    assert (b["n"], b["failed"], b["outliers"]) == (0, 9, [])
    assert all(math.isnan(b[name]) for name in STATISTICS[2:-1])


def test_every_frame_is_counted_once_in_every_box(make_rows):
    frame = make_rows(poses=12, failing=0.3)
    boxes = box_table(Rows(frame))
    assert list(boxes.columns) == [*SETTING, "metric", *STATISTICS]
    assert (boxes["n"] + boxes["failed"] == 12).all()
    assert len(boxes) == len(METRICS) * 2 * 2 * 7
    assert boxes["failed"].sum() == len(METRICS) * (frame["status"] == "failed").sum()


def test_the_order_of_the_rows_does_not_matter(make_rows):
    frame = make_rows(poses=9, failing=0.2, powers=(0.25, 1.0))
    shuffled = frame.sample(frac=1.0, random_state=1).reset_index(drop=True)
    assert encode_boxes(box_table(Rows(frame))) == encode_boxes(box_table(Rows(shuffled)))


def test_the_file_reads_back_as_it_was_written(tmp_path, make_rows):
    rows = Rows(
        make_rows(poses=15, gross=0.2, failing=0.1, swept={"beam.half_angle": ("7 deg", "true")}), ("beam.half_angle",)
    )
    boxes = box_table(rows)
    (tmp_path / "boxes.csv").write_bytes(encode_boxes(boxes))
    again = read_boxes(tmp_path / "boxes.csv", rows)
    assert list(again.columns) == list(boxes.columns)
    for name in boxes.columns:
        if name == "outliers":
            assert all(a == pytest.approx(b, rel=1e-8) for a, b in zip(again[name], boxes[name], strict=True))
        elif not is_numeric_dtype(boxes[name]):
            assert list(again[name]) == list(boxes[name])
        else:
            np.testing.assert_allclose(again[name].to_numpy(float), boxes[name].to_numpy(float), rtol=1e-8)


def test_powers_that_differ_by_little_stay_apart(tmp_path, make_rows):
    rows = Rows(make_rows(poses=3, trajectories=("box",), powers=(0.1, 0.1 + 2e-16, 0.1 + 1e-12, 1.0)))
    boxes = box_table(rows)
    (tmp_path / "boxes.csv").write_bytes(encode_boxes(boxes))
    assert read_boxes(tmp_path / "boxes.csv", rows)["power_w"].tolist() == boxes["power_w"].tolist()


def test_a_box_of_failures_reads_back_as_one(tmp_path, make_rows):
    rows = Rows(make_rows(poses=3, powers=(1.0,), failing=1.0))
    (tmp_path / "boxes.csv").write_bytes(encode_boxes(box_table(rows)))
    again = read_boxes(tmp_path / "boxes.csv", rows)
    assert (again["n"] == 0).all()
    assert (again["failed"] == 3).all()
    assert again["mean"].isna().all()
