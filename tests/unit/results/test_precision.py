"""results.precision: what estimators reached and stated, computed here a second time from the rows."""

import numpy as np
import pytest
from scipy.stats import chi2

from conespot.results.boxes import box_table
from conespot.results.run import load_run
from conespot.results.tables import make_tables

SIGMA = 0.004


def stated(frame, inflate=1.0, bound=0.002):
    """The rows with errors drawn from the sigmas that stand beside them, times `inflate`."""
    rng = np.random.default_rng(5)
    error = inflate * SIGMA * rng.standard_normal((len(frame), 3))
    ok = (frame["status"] == "ok").to_numpy()
    error[~ok] = np.nan
    for k, axis in enumerate("xyz"):
        frame[f"error_{axis}_mm"] = error[:, k]
        frame[f"est_sigma_{axis}_mm"] = np.where(ok, SIGMA, np.nan)
    frame["position_error_mm"] = np.linalg.norm(error, axis=1)
    frame["est_chi2_tip"] = np.sum(np.square(error / SIGMA), axis=1)
    frame["est_bound_mm"] = bound
    frame["true_in_frame"] = np.where(np.arange(len(frame)) % 2, 1.0, 0.8)
    return frame


@pytest.fixture
def table_of(tmp_path, make_run):
    def make(frame):
        run = load_run(make_run(tmp_path / "run", frame))
        return {table.name: table for table in make_tables(run, box_table(run.rows))}.get("precision")

    return make


def one_setting(make_rows, **more):
    return make_rows(poses=2000, trajectories=("box",), rigs=("single",), powers=(1.0,), localizers=("cone",), **more)


def test_errors_drawn_from_their_sigmas_lie_inside_95_percent_of_the_time(table_of, make_rows):
    frame = stated(one_setting(make_rows, failing=0.1))
    found = table_of(frame).frame.iloc[0]
    ok = frame["status"] == "ok"
    assert found["inside_95"] == pytest.approx(0.95, abs=0.02)
    assert found["inside_95"] == pytest.approx(np.mean(frame["est_chi2_tip"][ok] <= chi2.ppf(0.95, 3)))
    whole = frame["true_in_frame"] == 1.0
    assert (found["n"], found["gross"]) == (ok.sum(), 0)
    assert (found["refused"], found["outside"]) == ((~ok & whole).sum(), (~ok & ~whole).sum())
    assert found["sigma_mm"] == pytest.approx(SIGMA * np.sqrt(3.0))
    assert found["over_bound"] == pytest.approx(np.sqrt(np.mean(frame["position_error_mm"][ok] ** 2)) / 0.002)


def test_sigmas_that_are_too_small_show(table_of, make_rows):
    assert table_of(stated(one_setting(make_rows), inflate=2.0)).frame.iloc[0]["inside_95"] < 0.6


def test_an_accepted_result_far_beyond_its_sigmas_is_counted_as_gross(table_of, make_rows):
    frame = stated(one_setting(make_rows))
    limit = 6.0 * SIGMA * np.sqrt(3.0) + 0.05
    frame.loc[3, "position_error_mm"] = 1.01 * limit
    frame.loc[4, "position_error_mm"] = 0.99 * limit
    assert table_of(frame).frame.iloc[0]["gross"] == 1


def test_a_run_in_which_nothing_is_stated_has_no_such_table(table_of, make_rows):
    assert table_of(make_rows(poses=3)) is None


def test_the_table_for_the_eye_has_a_line_a_setting(table_of, make_rows):
    frame = stated(make_rows(poses=4, powers=(1.0,), localizers=("cone", "photometric")))
    table = table_of(frame)
    assert [line[0] for line in table.blocks[0].lines] == 4 * ["cone"] + 4 * ["photometric"]
    assert "triple" in table.text()


def test_it_says_what_its_numbers_assume_once_for_all_that_assume_the_same(table_of, make_rows):
    frame = stated(make_rows(poses=4, powers=(1.0,), localizers=("cone", "photometric")))
    *_, last = table_of(frame).blocks[0].notes
    assert last.startswith("cone and photometric: assumes radius: 12.5 mm; edge: Cycles blend 1")
