"""The paper's tables from whole campaigns, by the command a user types.

What is checked: the shipped campaigns' tables against bands. Why: every link of the chain, from YAML to table, must
hold for these numbers to come out. Expected: Table I to its last digit; the published means of Tables IV and V at
1750 px from outlines that are left between the pixels, and at 5000 px from outlines of whole pixels; at 1750 px what
whole pixels make of them; a white level that one cell of Table IV finds.
"""

from __future__ import annotations

import subprocess
import sys

import pandas as pd
import pytest

pytestmark = pytest.mark.slow


def run_campaign(folder, *arguments):
    done = subprocess.run(
        [sys.executable, "-m", "conespot", "run", *arguments, "--out", str(folder)],
        capture_output=True,
        text=True,
        timeout=1200,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return folder


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return run_campaign(tmp_path_factory.mktemp("runs") / "ci", "reproduce_ci.yaml")


@pytest.fixture(scope="module")
def white(tmp_path_factory):
    """The fit of the white level, at the paper's 5000 px and 100 poses, with half of its powers."""
    powers = "sweep.scene.power.value=[1 W, 2 W, 4 W, 8 W]"
    return run_campaign(tmp_path_factory.mktemp("runs") / "white", "white", "--set", powers)


@pytest.fixture(scope="module")
def box(tmp_path_factory):
    """Table IV's box at 5000 px, one spotlight."""
    only = ("--set", "trajectory=box", "--set", "scene.spotlights=single", "--localizers", "paper-code")
    return run_campaign(tmp_path_factory.mktemp("runs") / "box", "trajectories", *only)


def mean_errors(folder, **where):
    rows = pd.read_csv(folder / "errors.csv")
    for column, value in where.items():
        rows = rows[rows[column] == value]
    assert len(rows) > 0
    return rows.position_error_mm.mean()


def ratios(folder, name, **where):
    """Ours over the paper's, AE alone: four cells of Table V, or the eight of Table IV itself."""
    table = pd.read_csv(folder / "tables" / f"{name}.csv")
    table = table[(table.quantity == "AE") & table.source.str.startswith("Table")]
    for column, value in where.items():
        table = table[table[column] == value]
    return table.ratio


def test_table_1_is_the_papers_to_two_hundredths_of_a_micrometre(small):
    table = pd.read_csv(small / "tables" / "table_1.csv")
    ours = table.set_index("half_angle_deg").ours_um
    for angle, published in [(5, 0.08), (7, 0.23), (9, 0.49), (11, 0.91), (13, 1.51), (15, 2.34)]:
        assert ours[angle] == pytest.approx(published, abs=0.02)
    assert (table.distance_3d_um > 3 * table.ours_um).all()


def test_every_frame_has_its_row_and_every_failure_its_reason(small):
    rows = pd.read_csv(small / "errors.csv")
    assert len(rows) == 25 * (2 * 2 * 7 + 2) * 2
    failed = rows[rows.status == "failed"]
    assert failed.reason.notna().all()
    assert rows[rows.status == "ok"].position_error_mm.notna().all()
    # patches of three spotlights 1 deg apart merge at low resolution; a single one is hardly ever lost
    assert (rows[rows.spotlights == "single"].status == "ok").mean() > 0.95
    assert (rows[rows.spotlights == "triple"].status == "ok").mean() > 0.6


def test_at_1750_px_the_published_means_come_out_of_outlines_between_the_pixels(small):
    found = ratios(small, "table_4", localizer="paper-code-float")
    assert len(found) == 8
    assert ((found > 0.85) & (found < 1.15)).all(), found.tolist()


def test_at_1750_px_so_do_those_over_bumps(small):
    found = ratios(small, "table_5", localizer="paper-code-float")
    assert len(found) == 4
    assert ((found > 0.7) & (found < 1.3)).all(), found.tolist()


def test_at_1750_px_whole_pixels_drown_them(small):
    """As coded, pixels nearly three times as wide scatter the tip three times as far."""
    assert (ratios(small, "table_4", localizer="paper-code", metric="position_error_mm") > 1.5).all()


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


def test_one_cell_of_table_4_finds_the_white_level_of_the_preset(white):
    (fit,) = pd.read_csv(white / "tables" / "white.csv").to_dict("records")
    assert fit["white_w_m2_sr"] == pytest.approx(0.25, rel=0.1)
    assert fit["poses_low"] < 0.25 < fit["poses_high"]


def test_read_literally_the_threshold_costs_a_quarter_to_a_third_more(white):
    literal, fitted = (mean_errors(white, power_w=power) for power in (1.0, 4.0))
    assert fitted == pytest.approx(0.031, rel=0.1)
    assert 1.1 * fitted < literal < 1.5 * 0.031


def test_at_that_white_level_the_box_is_predicted(box):
    found = ratios(box, "table_4")
    assert len(found) == 2
    assert ((found > 0.9) & (found < 1.1)).all(), found.tolist()
