"""The reality gap: what each effect costs each localizer in each light, for runs that compare effects alone."""

import numpy as np
import pytest

from conespot.results import write_results
from conespot.results.boxes import box_table
from conespot.results.figures import plan_figures
from conespot.results.reality_gap import Cost, costs, reality_table
from conespot.results.run import load_run


@pytest.fixture
def gap(make_rows):
    """Two effects, two lights, two localizers; all that `cone` refuses is in the theatre's green light."""
    one = make_rows(
        poses=5,
        trajectories=("helix",),
        rigs=("single",),
        powers=(1.0,),
        localizers=("cone", "photometric"),
        swept={"effect": ("ideal", "theatre"), "light": ("white", "green")},
    )
    one["illumination"] = one["light"]
    one.loc[one["effect"] == "theatre", "position_error_mm"] *= 10.0
    lost = (one["effect"] == "theatre") & (one["light"] == "green") & (one["localizer"] == "cone")
    one.loc[lost, ["status", "reason"]] = "failed", "no edge"
    one.loc[lost, [name for name in one if name.startswith(("est_", "error_")) or name.endswith("_error_mm")]] = np.nan
    one.loc[lost, ["rotation_error_deg", "axis_error_deg"]] = np.nan
    return one


def test_medians_and_refusals_are_those_of_the_rows(gap):
    found = costs(gap)
    mine = gap[(gap["localizer"] == "cone") & (gap["effect"] == "ideal") & (gap["light"] == "white")]
    errors = mine["position_error_mm"]
    assert found["cone", "ideal", "white"] == Cost(5, 0, errors.median(), errors.max())
    lost = found["cone", "theatre", "green"]
    assert (lost.frames, lost.refused) == (5, 5)
    assert np.isnan(lost.median)


def test_the_table_has_a_line_an_effect_and_what_it_costs_over_the_first(tmp_path, make_run, gap):
    table = reality_table(load_run(make_run(tmp_path / "run", gap)))
    assert [block.heading for block in table.blocks] == ["cone", "photometric"]
    assert table.blocks[0].header == ("effect", "white [um]", "refused", "green [um]", "refused")
    assert table.blocks[0].lines[1][-2:] == ("–", "5 of 5")
    over = table.frame.set_index(["localizer", "effect", "illumination"])["over_first"]
    assert over["photometric", "theatre", "white"] == pytest.approx(
        costs(gap)["photometric", "theatre", "white"].median / costs(gap)["photometric", "ideal", "white"].median
    )
    assert over["photometric", "ideal", "green"] == 1.0


def test_one_figure_stands_for_those_of_every_variant(tmp_path, make_run, gap):
    folder = make_run(tmp_path / "run", gap)
    written = {path.name for path in write_results(folder)}
    assert {name for name in written if name.startswith("reality_gap.") and not name.endswith("csv")} == {
        f"reality_gap.{kind}" for kind in ("png", "svg", "pdf")
    }
    assert "reality_gap.csv" in written


def test_a_run_without_effects_has_neither_table_nor_figure(tmp_path, make_run, make_rows):
    run = load_run(make_run(tmp_path / "run", make_rows(poses=2, swept={"world": ("a", "b")})))
    assert reality_table(run) is None
    assert not any(drawing.name == "reality_gap" for drawing in plan_figures(run, box_table(run.rows))[0])


def test_a_light_that_nothing_was_localized_in_can_be_drawn(tmp_path, make_run, gap):
    for name in gap:
        if name.startswith(("est_", "error_")) or name.endswith(("_error_mm", "_error_deg")):
            gap[name] = np.nan
    gap["status"], gap["reason"] = "failed", "no light"
    assert any(path.name == "reality_gap.png" for path in write_results(make_run(tmp_path / "run", gap)))
