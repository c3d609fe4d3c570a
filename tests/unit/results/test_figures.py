"""Figures 8 to 11: what is drawn is what is stored, the same bytes every time, failures included."""

import os
import warnings
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from matplotlib.figure import Figure

from conespot.results import figures, write_results
from conespot.results.boxes import box_table
from conespot.results.figure_kind import FigureKind
from conespot.results.figures import draw_figures, plan_figures
from conespot.results.pose_figure import pose_figure
from conespot.results.power_figure import power_figure
from conespot.results.rows import Rows
from conespot.results.run import load_run
from conespot.results.style import style


@pytest.fixture
def plan(tmp_path, make_run):
    def make(frame, **more):
        run = load_run(make_run(tmp_path / "run", frame, **more))
        return plan_figures(run, box_table(run.rows))[0]

    return make


def boxes_of(frame, **where):
    boxes = box_table(Rows(frame))
    for name, value in where.items():
        boxes = boxes[boxes[name] == value]
    return boxes


def test_one_file_for_every_localizer_surface_and_trajectory(plan, make_rows):
    along, localizers = ("box", "helix", "spiral"), ("paper", "paper-code")
    frame = make_rows(poses=3, trajectories=along, surfaces=("smooth", "bumps"), localizers=localizers)
    names = {drawing.name for drawing in plan(frame)}
    expected = {"figure_8", "figure_9", "figure_10", "figure_11", "along_spiral_smooth", "power_spiral_smooth"}
    expected |= {f"{kind}_{t}_bumps" for kind in ("along", "power") for t in along}
    assert names == {f"{name}_{localizer}" for name in expected for localizer in localizers}


def test_a_single_power_makes_no_box_plot_over_power(plan, make_rows):
    assert [d.name for d in plan(make_rows(poses=3, powers=(1.0,), trajectories=("helix",)))] == ["figure_9_paper-code"]


def test_captions_state_whiskers_failures_power_and_assumptions(plan, make_rows):
    for drawing in plan(make_rows(poses=6, failing=0.5, powers=(0.25, 1.0))):
        assert "frames failed" in drawing.caption
        assert "W isotropic (3.08 mW flux)" in drawing.caption
        assert "Localizer: paper-code; radius: 12.5 mm; edge: Cycles blend 1" in drawing.caption
        assert "paper-code" in drawing.title
        if drawing.title.startswith("Fig. 1"):
            assert "1.5 interquartile ranges (Tukey)" in drawing.caption


class Largest(FigureKind):
    """A kind as docs/extending.md shows one: a name, a caption and a drawing."""

    name = "largest"
    what = "Largest errors,"

    def caption(self, cut):
        return cut.assumed

    def draw(self, cut, title, caption):
        figure = Figure()
        figure.subplots().barh(cut.boxes["metric"], cut.boxes["max"])
        return figure


def test_another_kind_is_drawn_and_cleared_by_its_name_alone(tmp_path, make_run, make_rows, monkeypatch):
    folder = make_run(tmp_path / "run", make_rows(poses=2, powers=(1.0,), trajectories=("box",), rigs=("single",)))
    (folder / "figures").mkdir()
    (folder / "figures" / "mine_box.png").touch()
    with monkeypatch.context() as patch:
        patch.setitem(figures.FIGURES, "largest", Largest())
        assert {path.name for path in write_results(folder) if path.name.startswith("largest")} == {
            f"largest_box_smooth_paper-code.{kind}" for kind in ("png", "svg", "pdf")
        }
        (folder / "figures" / "largest_helix_smooth_paper-code.svg").touch()
        write_results(folder)
    names = {path.name for path in (folder / "figures").iterdir()}
    assert "largest_helix_smooth_paper-code.svg" not in names
    assert {"largest_box_smooth_paper-code.svg", "mine_box.png"} < names


def test_names_that_differ_in_punctuation_get_files_of_their_own(plan, make_rows):
    frame = make_rows(poses=2, powers=(1.0,), trajectories=("a b", "a-b"), localizers=("my fit", "my-fit"))
    names = [drawing.name for drawing in plan(frame)]
    assert len(names) == len(set(names)) == 4


def test_a_huge_sweep_draws_sixty_and_says_how_many_more(tmp_path, make_run, make_rows):
    frame = make_rows(poses=1, powers=(1.0,), trajectories=("box",), rigs=("single",), swept={"a.b": tuple(range(70))})
    run = load_run(make_run(tmp_path / "run", frame))
    drawings, left_out = plan_figures(run, box_table(run.rows))
    assert (len(drawings), left_out) == (60, 10)


def test_the_boxes_drawn_are_the_stored_ones(make_rows):
    boxes = boxes_of(make_rows(poses=30, gross=0.1, failing=0.1), trajectory="box")
    with style():
        figure = power_figure(boxes, "title", "caption", "Table IV")
    panels = [axes for axes in figure.axes if axes.get_title(loc="left")]
    assert [axes.get_title(loc="left")[:3] for axes in panels] == ["(a)", "(b)", "(c)", "(d)"]
    for axes, metric, rig in zip(
        panels, ["position_error_mm"] * 2 + ["rotation_error_deg"] * 2, ["single", "triple"] * 2, strict=True
    ):
        stored = boxes[(boxes["metric"] == metric) & (boxes["spotlights"] == rig)].sort_values("power_w")
        drawn = [patch.get_path().vertices[:, 1] for patch in axes.patches]
        np.testing.assert_allclose([(v.min(), v.max()) for v in drawn], stored[["q1", "q3"]])
        heights = [sorted(set(line.get_ydata())) for line in axes.lines]
        for box in stored.to_dict("records"):
            for name in ("mean", "median", "whisker_low", "whisker_high"):
                assert any(box[name] in ys for ys in heights), name
            assert any(np.array_equal(ys, sorted(set(box["outliers"]))) for ys in heights)
        numbers = {text.get_text() for text in axes.texts}
        assert numbers >= {str(n) for n in stored["failed"] if n}


def test_statistics_alone_decide_what_is_drawn(make_rows):
    boxes = boxes_of(make_rows(poses=30), trajectory="box").assign(median=0.0123)
    with style():
        figure = power_figure(boxes, "title", "caption", None)
    assert sum(list(line.get_ydata()) == [0.0123, 0.0123] for axes in figure.axes for line in axes.lines) == 4 * 7


def test_the_lines_along_a_trajectory_are_the_rows_with_gaps_where_it_failed(make_rows):
    frame = make_rows(poses=20, trajectories=("helix",), rigs=("single",), powers=(1.0,), failing=0.3)
    with style():
        figure = pose_figure(frame, "title", "caption", "Table IV")
    lines = {tuple(np.nan_to_num(line.get_ydata(), nan=-9.0)) for line in figure.axes[0].lines}
    for name in ("error_x_mm", "error_y_mm", "error_z_mm", "position_error_mm"):
        assert tuple(frame[name].fillna(-9.0)) in lines
    failed = np.flatnonzero(frame["status"] == "failed")
    assert any(np.array_equal(line.get_xdata(), failed) for line in figure.axes[0].lines)
    assert any(list(line.get_ydata()) == [0.031, 0.031] for line in figure.axes[0].lines)
    assert f"{len(failed)} of 20 failed" in figure.axes[0].get_title(loc="right")


def test_a_gross_error_does_not_press_the_others_flat(make_rows):
    frame = make_rows(poses=30, rigs=("single",), trajectories=("box",), powers=(1.0,))
    frame.loc[3, "position_error_mm"] = frame.loc[3, "error_z_mm"] = 4.0
    with style():
        along = pose_figure(frame, "", "", None)
        over = power_figure(boxes_of(frame), "", "", None)
        calm = power_figure(boxes_of(make_rows(poses=30, trajectories=("box",))), "", "", None)
    assert along.axes[0].get_yscale() == "symlog"
    assert "logarithmic beyond" in along.axes[0].get_ylabel()
    assert over.axes[0].get_yscale() == "log"
    assert calm.axes[0].get_yscale() == "linear"


@pytest.mark.slow
def test_the_same_rows_give_the_same_bytes(tmp_path, plan, make_rows):
    drawings = plan(make_rows(poses=8, powers=(0.25, 1.0), trajectories=("box",), rigs=("single",)))
    written = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        written.append([path.read_bytes() for path in draw_figures(drawings, tmp_path / name)])
    assert written[0] == written[1]
    assert len(written[0]) == 6
    svg = next(data for data in written[0] if b"<svg" in data)
    assert b"<dc:date>" not in svg
    assert ET.fromstring(svg).tag.endswith("svg")


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="figures are drawn on one core where nothing forks")
def test_figures_are_the_same_on_one_core_and_on_several_of_which_one_fails(tmp_path, plan, make_rows, monkeypatch):
    drawings = plan(make_rows(poses=6, powers=(0.1, 1.0)))
    drawn, here = figures._draw, os.getpid()

    def killed(*share):
        if os.getpid() != here:
            os._exit(1)
        drawn(*share)

    written = []
    for name, cores, draw in (("one", 1, drawn), ("three", 3, drawn), ("failing", 3, killed)):
        (tmp_path / name).mkdir()
        monkeypatch.setattr(os, "sched_getaffinity", lambda _, cores=cores: set(range(cores)))
        monkeypatch.setattr(figures, "_draw", draw)
        written.append([path.read_bytes() for path in draw_figures(drawings[:3], tmp_path / name)])
    assert len(written[0]) == 9  # three drawings as png, svg and pdf
    assert written[0] == written[1] == written[2]


def test_hostile_names_are_drawn_as_text_and_nothing_else(tmp_path, plan, make_rows):
    frame = make_rows(poses=2, powers=(1.0,), trajectories=("$\\frac{<b>&",), rigs=("$x^2 </text>",))
    (drawing,) = plan(frame)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _, svg, _ = draw_figures([drawing], tmp_path)
    assert svg.parent == tmp_path
    assert ET.parse(svg).getroot().tag.endswith("svg")


@pytest.mark.parametrize("failing", [0.0, 1.0])
def test_a_single_pose_or_only_failures_can_be_drawn(tmp_path, plan, make_rows, failing):
    drawings = plan(make_rows(poses=1, powers=(0.25, 1.0), trajectories=("box",), rigs=("single",), failing=failing))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(draw_figures(drawings, tmp_path)) == 6


def test_the_users_matplotlib_is_left_as_it_was(make_rows):
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    with style():
        power_figure(boxes_of(make_rows(poses=3), trajectory="box"), "", "", None)
        assert mpl.rcParams["svg.hashsalt"] == "conespot"
    assert dict(mpl.rcParams) == before
