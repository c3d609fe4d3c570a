"""What the paper says of its tables beyond their numbers, on the campaign `reproduce_ci`.

What is checked: orders and monotonies. The numbers themselves are what the campaigns expect, see `campaign check`, and
.ci/run compares them. Why: every link of the chain, from YAML to table, must hold for these to come out. Expected:
three spotlights are not worse than one, the error falls with power and ever less.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A run of `reproduce_ci`: the one that CONESPOT_REPRODUCED names, as .ci/run does, or one of its own."""
    if made := os.environ.get("CONESPOT_REPRODUCED"):
        return Path(made)
    folder = tmp_path_factory.mktemp("runs") / "ci"
    command = [sys.executable, "-m", "conespot", "run", "reproduce_ci", "--out", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=1200, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return folder


def mean_errors(folder, **where):
    rows = pd.read_csv(folder / "errors.csv")
    for column, value in where.items():
        rows = rows[rows[column] == value]
    assert len(rows) > 0
    return rows.position_error_mm.mean()


def test_in_space_the_curves_of_table_1_are_more_than_three_times_as_far_apart(small):
    table = pd.read_csv(small / "tables" / "table_1.csv")
    assert (table.distance_3d_um > 3 * table.ours_um).all()


def test_every_frame_has_its_row_and_every_failure_its_reason(small):
    rows = pd.read_csv(small / "errors.csv")
    assert len(rows) == 25 * (2 * 2 * 7 + 2) * 2
    failed = rows[rows.status == "failed"]
    assert failed.reason.notna().all()
    assert rows[rows.status == "ok"].position_error_mm.notna().all()


@pytest.mark.parametrize("trajectory", ["box", "helix"])
def test_three_spotlights_are_not_worse_than_one(small, trajectory):
    same = {"localizer": "paper-code", "trajectory": trajectory, "surface": "smooth", "power_w": 1.0}
    assert mean_errors(small, spotlights="triple", **same) <= mean_errors(small, spotlights="single", **same)


def test_nor_are_they_between_the_pixels_over_both_trajectories(small):
    same = {"localizer": "paper-code-float", "surface": "smooth", "power_w": 1.0}
    assert mean_errors(small, spotlights="triple", **same) <= mean_errors(small, spotlights="single", **same)


@pytest.mark.parametrize("trajectory", ["box", "helix"])
def test_the_error_falls_with_power_and_ever_less(small, trajectory):
    error = {
        power: mean_errors(
            small, localizer="paper-code-float", trajectory=trajectory, spotlights="single", power_w=power
        )
        for power in (0.05, 0.25, 1.0)
    }
    assert error[0.05] > error[0.25] > error[1.0]
    assert error[0.05] - error[0.25] > error[0.25] - error[1.0]
