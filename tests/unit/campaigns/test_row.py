"""campaigns.row: the paper's errors, from known offsets."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from conespot.campaigns.row import Finding, Record, errors
from conespot.scene import Pose

RCM = (6.0, 0.0, 22.0)


def found(apex, axis=None, **more):
    axis = Pose.through(apex, RCM).axis if axis is None else axis
    return Finding(case="c", localizer="paper", apex=tuple(map(float, apex)), axis=tuple(map(float, axis)), **more)


def test_the_truth_has_no_error():
    pose = Pose.through([1.0, 2.0, 4.0], RCM)
    row = errors(pose, found(pose.apex, pose.axis), RCM)
    assert [row[k] for k in row if "error" in k] == pytest.approx([0.0] * 8, abs=1e-12)


def test_the_columns_are_those_of_the_design_in_its_order():
    row = errors(Pose.through([1.0, 2.0, 4.0], RCM), found([1.0, 2.0, 4.0]), RCM)
    xyz = [f"{kind}_{c}_mm" for kind in ("true", "est", "error") for c in "xyz"]
    rest = ["position_error_mm", "error_rot_y_deg", "error_rot_z_deg", "rotation_error_deg", "axis_error_deg"]
    assert list(row) == [*xyz, *rest]


def test_a_tip_out_of_this_world_is_no_finding():
    with pytest.raises(ValidationError):
        found([1e300, 0.0, 0.0], [0.0, 0.0, 1.0])


def test_position_errors_are_estimate_minus_truth():
    row = errors(Pose.through([1.0, 2.0, 4.0], RCM), found([1.03, 2.0, 3.96]), RCM)
    assert [row[f"error_{c}_mm"] for c in "xyz"] == pytest.approx([0.03, 0.0, -0.04])
    assert row["position_error_mm"] == pytest.approx(0.05)


def test_tilt_and_azimuth_are_those_of_the_line_from_the_tip_to_the_rcm():
    """A tip turned about the vertical through the RCM has an azimuth error alone; the angle between axes is smaller."""
    true = Pose.through([2.0, 0.0, 2.0], RCM)
    turn = math.radians(2.0)
    tip = np.array([6.0 - 4.0 * math.cos(turn), -4.0 * math.sin(turn), 2.0])
    row = errors(true, found(tip), RCM)
    assert row["error_rot_y_deg"] == pytest.approx(0.0, abs=1e-9)
    assert row["error_rot_z_deg"] == pytest.approx(2.0)
    assert row["rotation_error_deg"] == pytest.approx(2.0)
    assert row["axis_error_deg"] == pytest.approx(2.0 * math.sin(true.tilt), rel=1e-3)


def test_azimuths_on_both_sides_of_180_degrees_are_close():
    true = Pose.through([7.0, 0.001, 2.0], RCM)
    row = errors(true, found([7.0, -0.001, 2.0]), RCM)
    assert abs(row["error_rot_z_deg"]) == pytest.approx(math.degrees(0.002), rel=1e-3)


def test_the_axis_error_is_that_of_the_axis_found_and_not_of_the_line_to_the_rcm():
    true = Pose.through([0.0, 0.0, 4.0], RCM)
    tilted = Pose.through([0.1, 0.0, 4.0], RCM)
    row = errors(true, found(true.apex, tilted.axis), RCM)
    assert row["rotation_error_deg"] == pytest.approx(0.0, abs=1e-12)
    assert row["axis_error_deg"] == pytest.approx(math.degrees(math.acos(true.axis @ tilted.axis)), rel=1e-6)


def test_a_failure_has_the_truth_and_nothing_else():
    row = errors(Pose.through([1.0, 2.0, 4.0], RCM), Finding(case="c", localizer="paper", reason="nothing found"), RCM)
    assert row["true_x_mm"] == 1.0
    assert all(math.isnan(v) for k, v in row.items() if not k.startswith("true"))


@pytest.mark.parametrize(
    "wrong",
    [
        {},
        {"apex": (0, 0, 0)},
        {"apex": (0, 0, math.nan), "axis": (0, 0, -1)},
        {"apex": (0, 0, 0), "axis": (0, 0, -2)},
        {"apex": (0, 0, 0), "axis": (0, 0, -1), "reason": "both"},
        {"apex": (0, 0, 0), "axis": (0, 0, -1), "covariance": ((0.0,) * 4,) * 5},
        {"apex": (0, 0, 0), "axis": (0, 0, -1), "error": 3},
    ],
)
def test_what_is_no_finding_is_refused(wrong):
    with pytest.raises(ValidationError):
        Finding(case="c", localizer="paper", **wrong)


def test_a_record_is_findings_or_an_error():
    with pytest.raises(ValidationError):
        Record(unit="u")
    with pytest.raises(ValidationError):
        Record(unit="u", error="lost", findings=(found([0.0, 0.0, 3.0]),))
