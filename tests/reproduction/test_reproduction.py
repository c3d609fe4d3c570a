"""The paper's tables from whole campaigns, by the command a user types.

What is checked: the shipped campaigns' tables against bands. Why: every link of the chain, from YAML to table, must
hold for these numbers to come out. Expected: Table I to its last digit; at 5000 px the published means of Table IV
at the light that explains them; at 1000 px what the coarser pixels make of them.
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
def full_resolution(tmp_path_factory):
    """25 of the paper's 100 poses at its 5000 px, single spotlight."""
    folder = tmp_path_factory.mktemp("runs") / "brightness"
    return run_campaign(folder, "brightness", "--poses", "25", "--set", "sweep.scene.power.value=[1 W, 4 W]")


def mean_errors(folder, **where):
    rows = pd.read_csv(folder / "errors.csv")
    for column, value in where.items():
        rows = rows[rows[column] == value]
    assert len(rows) > 0
    return rows.position_error_mm.mean()


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
    # patches of three spotlights 1 deg apart merge at 1000 px; a single one is hardly ever lost
    assert (rows[rows.spotlights == "single"].status == "ok").mean() > 0.95
    assert (rows[rows.spotlights == "triple"].status == "ok").mean() > 0.6


@pytest.mark.parametrize(
    ("trajectory", "spotlights", "expected"),
    [("box", "single", 0.124), ("helix", "single", 0.135), ("box", "triple", 0.090), ("helix", "triple", 0.102)],
)
def test_at_1000_px_the_authors_code_errs_by_its_whole_pixels(small, trajectory, spotlights, expected):
    """Measured once; the whole pixels of the authors' code, five times as wide, make most of it."""
    at_1_w = mean_errors(
        small, localizer="paper-code", trajectory=trajectory, spotlights=spotlights, surface="smooth", power_w=1.0
    )
    assert at_1_w == pytest.approx(expected, rel=0.25)


@pytest.mark.parametrize("trajectory", ["box", "helix"])
@pytest.mark.parametrize("localizer", ["paper", "paper-code"])
def test_three_spotlights_are_not_worse_than_one(small, trajectory, localizer):
    same = {"localizer": localizer, "trajectory": trajectory, "surface": "smooth", "power_w": 1.0}
    assert mean_errors(small, spotlights="triple", **same) <= mean_errors(small, spotlights="single", **same)


@pytest.mark.parametrize("trajectory", ["box", "helix"])
def test_the_error_falls_with_power_and_ever_less(small, trajectory):
    error = {
        power: mean_errors(small, localizer="paper", trajectory=trajectory, spotlights="single", power_w=power)
        for power in (0.05, 0.25, 1.0)
    }
    assert error[0.05] > error[0.25] > error[1.0]
    assert error[0.05] - error[0.25] > error[0.25] - error[1.0]


@pytest.mark.parametrize(("trajectory", "published"), [("box", 0.026), ("helix", 0.031)])
def test_at_5000_px_and_four_times_the_light_the_published_means_come_out(full_resolution, trajectory, published):
    """Table IV, single spotlight: within 25 %."""
    bright = mean_errors(full_resolution, localizer="paper-code", trajectory=trajectory, power_w=4.0)
    assert bright == pytest.approx(published, rel=0.25)


@pytest.mark.parametrize(("trajectory", "published"), [("box", 0.026), ("helix", 0.031)])
def test_at_5000_px_and_one_watt_the_threshold_costs_a_quarter_to_a_third_more(full_resolution, trajectory, published):
    """Not the published value: what the stated assumptions make of it (see README, and the campaign `brightness`)."""
    plain = mean_errors(full_resolution, localizer="paper-code", trajectory=trajectory, power_w=1.0)
    bright = mean_errors(full_resolution, localizer="paper-code", trajectory=trajectory, power_w=4.0)
    assert 1.1 * bright < plain < 1.5 * published
