"""Bounds and the error budget in the report: where they are there, each beside what was reached."""

import pandas as pd

from conespot.results import load_run
from conespot.results.report.charts import theory_charts
from conespot.results.report.theory import theory_tables


def test_errors_stand_beside_the_bound_of_the_same_frames(tmp_path, make_rows, make_run):
    frame = make_rows(poses=4, powers=(1.0,), trajectories=("box",)).assign(est_bound_mm=0.004)
    folder = make_run(tmp_path / "run", frame)
    (chart,) = theory_charts(load_run(folder), theory_tables(folder))
    reached, possible = chart.traces
    assert reached["y"] == possible["y"]
    assert set(possible["x"]) == {4.0}
    ok = frame[frame["status"] == "ok"]
    most = 1e3 * ok["position_error_mm"].max()
    assert all(0.0 < um <= most for um in reached["x"])


def test_bounds_and_budget_of_the_theory_are_drawn_and_its_words_are_words(tmp_path, make_rows, make_run):
    folder = make_run(tmp_path / "run", make_rows(poses=2, powers=(1.0,), trajectories=("box",)))
    assert theory_charts(load_run(folder), theory_tables(folder)) == []
    bound = {"resolution_px": 5000, "edge": "hard", "height_mm": 3, "rcm": "<b>", "position_um": 0.5}
    pd.DataFrame([bound]).to_csv(folder / "bounds.csv", index=False)
    one = {
        "height_mm": 3,
        "rcm": "free",
        "quantity": "half_angle",
        "tolerance": 0.01,
        "unit": "deg",
        "position_um": 3.5,
    }
    pd.DataFrame([one, {**one, "position_um": float("nan")}]).to_csv(folder / "budget.csv", index=False)
    bounds, budget = theory_charts(load_run(folder), theory_tables(folder))
    assert bounds.traces[-1]["y"] == ["bound: 5000 px, hard edge, RCM &lt;b&gt;"]
    assert bounds.traces[-1]["x"] == [0.5]
    assert [trace["x"] for trace in budget.traces] == [[3.5]]
