"""results.tables and results.table: ours against published, computed here a second time from the rows."""

import math

import numpy as np
import pandas as pd
import pytest

from conespot.results.boxes import box_table
from conespot.results.error_tables import reference_power
from conespot.results.run import Run, load_run
from conespot.results.table import Block, Table
from conespot.results.tables import make_tables

ASSUMED = ["radius", "edge", "power_convention", "transfer", "surface_shape", "threshold", "ambiguity"]


@pytest.fixture
def tables_of(tmp_path, make_run):
    def make(frame, **more):
        run = load_run(make_run(tmp_path / "run", frame, **more))
        return {table.name: table for table in make_tables(run, box_table(run.rows) if run.rows else None)}

    return make


def located(frame, **where):
    for name, value in where.items():
        frame = frame[frame[name] == value]
    return frame[frame["status"] == "ok"], int((frame["status"] == "failed").sum())


def test_table_iv_is_mean_and_maximum_at_one_watt(tables_of, make_rows):
    frame = make_rows(poses=20, localizers=("paper", "paper-code"), failing=0.2)
    table = tables_of(frame)["table_4"].frame
    own = table[table["source"] == "Table IV"]
    assert len(own) == 2 * 16
    for row in own.to_dict("records"):
        good, failed = located(frame, power_w=1.0, **{k: row[k] for k in ("trajectory", "spotlights", "localizer")})
        errors = good[row["metric"]].to_numpy()
        assert row["ours"] == pytest.approx(errors.mean() if row["quantity"] == "AE" else errors.max())
        assert row["ratio"] == pytest.approx(row["ours"] / row["published"])
        assert (row["n"], row["failed"], row["power_w"]) == (len(errors), failed, 1.0)


def test_the_abstract_is_compared_with_the_mean_over_all_frames(tables_of, make_rows):
    frame = make_rows(poses=20, failing=0.3)
    table = tables_of(frame)["table_4"].frame
    both = table[(table["source"] == "abstract") & (table["spotlights"] == "triple")]
    good, failed = located(frame, power_w=1.0, spotlights="triple")
    for row in both.to_dict("records"):
        assert row["ours"] == pytest.approx(good[row["metric"]].mean())
        assert (row["n"], row["failed"], row["trajectory"]) == (len(good), failed, "box and helix")
    assert set(table["source"]) == {"Table IV", "abstract", "conclusion"}


def test_every_number_has_its_assumption_set(tables_of, make_rows):
    made = tables_of(make_rows(poses=4, surfaces=("smooth", "bumps")), theory=True)
    assert list(made) == ["table_1", "table_4", "table_5", "power"]
    for table in made.values():
        assert list(table.frame.columns[-7:]) == ASSUMED
        assert table.frame[ASSUMED].map(bool).all().all()
        assert all(block.assumes.radius.startswith("1") for block in table.blocks)
        assert "radius: 1" in table.text()


def test_table_v_compares_bumps_with_the_paper_and_with_smooth(tables_of, make_rows):
    frame = make_rows(poses=20, surfaces=("smooth", "bumps"), powers=(1.0,))
    table = tables_of(frame)["table_5"].frame
    assert (len(table), set(table["trajectory"]), set(table["surface"])) == (8, {"helix"}, {"bumps"})
    row = table[(table["quantity"] == "ME") & (table["spotlights"] == "single")].iloc[0]
    bumps, _ = located(frame, trajectory="helix", spotlights="single", surface="bumps")
    smooth, _ = located(frame, trajectory="helix", spotlights="single", surface="smooth")
    assert row["ours"] == pytest.approx(bumps["position_error_mm"].max())
    assert row["over_smooth"] == pytest.approx(bumps["position_error_mm"].max() / smooth["position_error_mm"].max())
    assert row["published_over_smooth"] == pytest.approx(0.210 / 0.137)


def test_bumps_are_stated_beside_their_numbers_and_nowhere_else(tables_of, make_rows):
    made = tables_of(make_rows(poses=4, surfaces=("smooth", "bumps"), powers=(1.0,)))
    bumps = "15 bumps (0.5 mm across, 0.1 mm high)"
    assert set(made["table_4"].frame["surface_shape"]) == {"smooth"}
    assert set(made["table_5"].frame["surface_shape"]) == {bumps}
    power = made["power"].frame
    assert (power["surface_shape"].eq(bumps) == power["surface"].eq("bumps")).all()
    for name, words in {"table_4": "smooth", "table_5": bumps, "power": f"smooth or {bumps}"}.items():
        assert made[name].blocks[0].assumes.surface_shape == words
        assert f"surface shape: {words};" in made[name].text()


def test_a_run_that_describes_no_cases_says_so_beside_every_number(tables_of, make_rows):
    made = tables_of(make_rows(poses=4, surfaces=("smooth", "bumps")), described=[])
    assert set(made) == {"table_4", "table_5", "power"}
    for table in made.values():
        assert (table.frame[ASSUMED] == "not stated").all().all()
        assert "edge: not stated; power convention: not stated" in table.text()
    assert "at 1 W (convention not stated)" in made["table_4"].blocks[0].heading
    assert made["power"].frame["flux_w"].isna().all()


def test_table_v_stands_without_a_smooth_run(tables_of, make_rows):
    made = tables_of(make_rows(poses=5, surfaces=("bumps",), powers=(1.0,)))
    assert list(made) == ["table_5", "power"]
    assert made["table_5"].frame["over_smooth"].isna().all()


def test_table_i_stands_beside_the_distance_in_3d(tables_of):
    made = tables_of(None, theory=True)
    assert list(made) == ["table_1"]
    frame = made["table_1"].frame.set_index("half_angle_deg")
    assert frame.loc[9.0, ["ours_um", "published_um", "distance_3d_um"]].tolist() == [0.49, 0.49, 3.2]
    assert frame.loc[11.0, "difference_um"] == pytest.approx(-0.01)
    assert frame["volume_distance_3d_um"].isna().all()


def test_table_i_shows_the_distance_over_the_volume_where_the_run_has_it(tmp_path, make_run):
    folder = make_run(tmp_path / "run")
    (folder / "theory.csv").write_text(
        "half_angle_deg,in_plane_um,distance_3d_um,volume_distance_3d_um\n9,0.4899,3.12,4.89\n10,0.7,4,6\n"
    )
    (table,) = make_tables(load_run(folder), None)
    assert table.frame["volume_distance_3d_um"].tolist() == [4.89, 6.0]
    assert table.blocks[0].lines[0] == ("9", "0.49", "0.49", "0.00", "1.00", "3.12", "4.89")
    assert table.blocks[0].lines[1] == ("10", "0.70", "–", "–", "–", "4.00", "6.00")


def test_a_table_needs_its_rows(tables_of, make_rows):
    assert list(tables_of(make_rows(poses=4, trajectories=("spiral",)))) == ["power"]
    assert list(tables_of(make_rows(poses=4, rigs=("5 spotlights",)))) == ["power"]


def test_without_one_watt_the_highest_power_stands_in_and_is_stated(tables_of, make_rows):
    table = tables_of(make_rows(poses=4, powers=(0.1, 0.5)))["table_4"]
    assert set(table.frame["power_w"]) == {0.5}
    assert "at 0.5 W isotropic (1.54 mW flux)" in table.blocks[0].heading
    assert reference_power({0.25, 1.0, 2.0}) == 1.0
    assert math.isnan(reference_power(set()))


def test_settings_are_never_pooled(tables_of, make_rows, make_cases):
    frame = make_rows(poses=4, powers=(1.0,), swept={"beam.half_angle": ("7 deg", "9 deg")})
    described = make_cases(frame)
    for case in described:
        case["assumes"]["edge"] = f"hard, half angle {case['labels']['beam.half_angle']}"
    table = tables_of(frame, described=described)["table_4"]
    assert [b.heading.split(", at")[0] for b in table.blocks] == [
        "paper-code, beam.half_angle 7 deg",
        "paper-code, beam.half_angle 9 deg",
    ]
    assert sorted(set(table.frame["edge"].str[-5:])) == ["7 deg", "9 deg"]
    assert set(table.frame["n"]) == {4, 8}


def test_the_power_table_counts_every_frame_and_gives_both_conventions(tables_of, make_rows):
    frame = make_rows(poses=10, failing=0.3)
    table = tables_of(frame)["power"].frame
    assert len(table) == 2 * 2 * 7 * 2
    assert (table["n"] + table["failed"] == 10).all()
    np.testing.assert_allclose(table["flux_w"] / table["power_w"], 3.0779e-3, rtol=1e-4)
    quarter = table[table["power_w"] == 0.25]
    assert (quarter["mean_over_quarter_watt"] == 1.0).all()


def test_where_every_frame_failed_the_count_stands_without_a_number(tables_of, make_rows):
    made = tables_of(make_rows(poses=3, powers=(1.0,), failing=1.0))
    assert made["table_4"].frame["ours"].isna().all()
    assert (made["table_4"].frame["failed"] >= 3).all()
    assert "–" in made["table_4"].text()


def test_errors_of_exactly_nothing_have_no_ratio(tables_of, make_rows):
    frame = make_rows(poses=3, powers=(0.25, 1.0), surfaces=("smooth", "bumps"))
    frame["position_error_mm"] = 0.0
    made = tables_of(frame)
    table = made["table_5"].frame
    assert table.loc[table["metric"] == "position_error_mm", "over_smooth"].isna().all()
    assert (made["table_4"].frame["ours"] == 0.0).any()


def small_table(lines, heading="paper"):
    return Table("t", "T", pd.DataFrame(), (Block(heading, ("name", "value"), lines, ("note",)),))


def test_text_lines_up_and_numbers_are_flush_right():
    text = small_table((("a", "0.1"), ("longer", "12.25"))).text()
    assert "  a         0.1\n  longer  12.25\nnote" in text


def test_markdown_is_a_table_and_holds_no_markup_of_the_run():
    text = small_table((("a|b <i> [x](y)", "1"),), "*bold*").markdown()
    assert "| name | value |\n| --- | --: |\n| a&#124;b &#60;i&#62; \\[x\\](y) | 1 |" in text
    assert "### \\*bold\\*" in text


def test_a_huge_sweep_is_shown_in_part_and_says_so():
    table = small_table(tuple((str(i), "1") for i in range(1000)))
    assert len(table.shown[0].lines) == 400
    assert "600 lines" in table.text()
    assert "600 lines" in table.markdown()


def test_a_run_needs_no_theory_for_its_errors(tmp_path, make_run, make_rows):
    run = load_run(make_run(tmp_path / "run", make_rows(poses=2)))
    assert isinstance(run, Run)
    assert run.theory is None
