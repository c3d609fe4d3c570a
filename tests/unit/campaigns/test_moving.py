"""Poses that move: one tremor for a trajectory and seed, whatever looks at it, and times of a CSV file."""

import numpy as np
import pytest

from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import read_campaign
from conespot.scene import InputError

HEADER = "t_s,x_mm,y_mm,z_mm\n"
MOVING = """
scene:
  preset: paper-code
  sensor: {kind: emva, exposure_time: 8 ms}
  motion: {kind: tremor}
"""


def plan_of(folder, text, rows="0,0,0,4\n0.1,1,0,4\n0.35,0,1,5\n"):
    (folder / "path.csv").write_text(HEADER + rows)
    (folder / "moving.yaml").write_text(text)
    return make_plan(read_campaign(str(folder / "moving.yaml")))


CSV = "trajectory: {kind: csv, file: path.csv}\nposes: 3\n"


def test_a_pose_takes_its_time_from_the_file_and_else_from_the_frame_rate(tmp_path):
    group = plan_of(tmp_path, MOVING + CSV).groups[0]
    np.testing.assert_array_equal(group.times, [0.0, 0.1, 0.35])
    expected = group.scene.sway(0.35, group.course)
    np.testing.assert_array_equal(group.pose(2).sway, expected)
    assert np.ptp(expected, axis=0).max() > 0.005
    group = plan_of(tmp_path, MOVING + "trajectory: helix\nposes: 4\n").groups[0]
    np.testing.assert_allclose(group.times, np.arange(4) / 60.0)


def test_all_powers_cameras_and_localizers_see_one_tremor_and_another_seed_another(tmp_path):
    text = (
        MOVING + CSV + "sweep: {scene.power.value: [10 mW, 20 mW], scene.camera.tilt: [0 deg, 5 deg], seed: [1, 2]}\n"
    )
    plan = plan_of(tmp_path, text)
    ways = {group.pose(1).sway.tobytes() for group in plan.groups}
    assert len(plan.groups) == 4
    assert len(ways) == 2


def test_a_still_scene_has_still_poses_and_no_times(tmp_path):
    group = plan_of(tmp_path, "scene: paper-code\n" + CSV).groups[0]
    assert group.times is None
    assert group.pose(1).sway is None


@pytest.mark.parametrize(
    ("rows", "sentence"),
    [
        ("0,0,0,4\n0,1,0,4\n", "path.csv:3: t_s must increase, and 0 comes after 0"),
        ("0,0,0,4\nnan,1,0,4\n", "path.csv:3: t_s must be a finite number"),
    ],
)
def test_times_that_are_none_are_refused_with_their_line(tmp_path, rows, sentence):
    with pytest.raises(InputError, match=sentence):
        plan_of(tmp_path, MOVING + CSV, rows)


def test_a_tip_that_moves_into_the_wall_during_the_exposure_is_refused_with_its_pose(tmp_path):
    moving = MOVING.replace("{kind: tremor}", "{kind: velocity, velocity: [0 mm/s, 0 mm/s, -100 mm/s]}")
    with pytest.raises(InputError, match=r"moving.yaml:.*pose 1 of the csv: the tip moves into the eye's wall"):
        plan_of(tmp_path, moving + CSV, "0,0,0,4\n1,0,0,0.3\n2,0,0,4\n")
