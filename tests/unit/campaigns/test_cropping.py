"""Which frames of a run are drawn again: each reason of a refusal, then the worst of each box."""

import pandas as pd
import pytest

from conespot.campaigns.cropping import worst_frames
from conespot.results.columns import SETTING
from conespot.results.rows import Rows


@pytest.fixture
def rows():
    """Two cases of ten poses: errors grow with the pose, two frames are refused for one reason and one for another."""
    parts = []
    for case in range(2):
        part = pd.DataFrame({"pose": range(10), "status": "ok", "reason": "", "case": f"{case:016x}"})
        part["position_error_mm"] = 0.01 * (part["pose"] + 1.0 + case)
        parts.append(part.assign(**dict.fromkeys(SETTING, "same")).assign(power_w=1.0 + case, localizer="paper"))
    frame = pd.concat(parts, ignore_index=True)
    frame.loc[[2, 4, 13], "status"] = "failed"
    frame.loc[[2, 4, 13], "reason"] = ["two patches", "no patch", "no patch"]
    return Rows(frame)


def test_a_refused_frame_of_each_reason_and_the_worst_of_each_box_are_drawn(rows):
    wanted, left_out = worst_frames(rows, 1, 8)
    assert list(wanted) == [("0" * 16, 4), ("0" * 16, 2), (f"{1:016x}", 9), ("0" * 16, 9)]
    assert left_out == 0


def test_refusals_take_a_quarter_of_the_frames_at_most(rows):
    wanted, left_out = worst_frames(rows, 3, 4)
    assert next(iter(wanted)) == ("0" * 16, 4)
    assert [pose for _, pose in wanted][1:] == [9, 9, 8]
    assert left_out == 3
