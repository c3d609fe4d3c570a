"""results.white: the radiance that shows as white, from a sweep over powers."""

import math

import numpy as np
import pandas as pd
import pytest

from conespot.results.boxes import box_table
from conespot.results.run import load_run
from conespot.results.tables import make_tables
from conespot.results.white import white_level

POWERS = np.array([1.0, 2.0, 3.0, 4.0, 6.0])


def errors(scatter=0.0, poses=100):
    """Mean errors that fall by 5 um an e-fold of power and are 31 um at 4 W."""
    noise = np.random.default_rng(5).normal(size=(poses, 1))
    return 0.031 - 0.005 * np.log(POWERS / 4.0) + scatter * (noise - noise.mean()) / noise.std()


def test_the_power_that_makes_the_published_mean_is_one_over_the_white_level():
    assert white_level(errors(), POWERS, 1.0, 0.031).value == pytest.approx(0.25, rel=2e-3)
    assert white_level(errors(), POWERS, 2.0, 0.031).value == pytest.approx(0.5, rel=2e-3)


def test_rounding_leaves_open_what_half_a_digit_moves_the_answer_by():
    low, high = white_level(errors(), POWERS, 1.0, 0.031).rounding
    assert (low, high) == (
        pytest.approx(0.25 * math.exp(-0.1), rel=2e-3),
        pytest.approx(0.25 * math.exp(0.1), rel=2e-3),
    )


def test_poses_that_scatter_widen_the_interval_as_their_mean_does():
    exact, scattered = (white_level(errors(s), POWERS, 1.0, 0.031).poses for s in (0.0, 0.01))
    assert exact[0] == pytest.approx(exact[1])
    # a mean of 100 errors that scatter by 10 um is known to 1 um: a fifth of an e-fold
    assert math.log(scattered[1] / scattered[0]) == pytest.approx(0.4, rel=0.1)


def test_a_mean_that_no_power_makes_gives_no_white_level():
    assert white_level(errors(), POWERS, 1.0, 0.020) is None
    assert white_level(errors(), POWERS, 1.0, 0.050) is None


def test_poses_that_were_lost_at_some_power_do_not_count_there():
    lost = errors(0.002)
    lost[3, 0] = lost[7, 4] = math.nan
    assert white_level(lost, POWERS, 1.0, 0.031).value == pytest.approx(0.25, rel=0.02)


def test_a_run_beyond_the_papers_power_has_the_table_and_no_other_run_has(tmp_path, make_run, make_rows, make_campaign):
    def tables(name, powers):
        # errors of 20 to 40 um times 1 + 0.12 P^-0.7, made to pass 31 um
        frame = make_rows(poses=40, powers=powers, trajectories=("helix",), rigs=("single",))
        measured = [c for c in frame.columns if c.endswith("_mm") and c.startswith(("error", "position"))]
        frame[measured] *= 0.031 / frame.loc[frame["power_w"] == powers[1], "position_error_mm"].mean()
        run = load_run(make_run(tmp_path / name, pd.DataFrame(frame), document=make_campaign()))
        return {table.name: table for table in make_tables(run, box_table(run.rows))}

    table = tables("beyond", (0.25, 1.0, 4.0, 16.0))["white"]
    (row,) = table.frame.to_dict("records")
    assert row["published"] == 0.031
    assert row["poses_low"] < row["white_w_m2_sr"] < row["poses_high"]
    assert "white" not in tables("within", (0.25, 0.5, 1.0))
