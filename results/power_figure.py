"""Figures 10 and 11: Tukey boxes of the errors over light power, drawn from stored statistics alone."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from conespot.results.assumptions import pairs, power_in_words
from conespot.results.columns import column
from conespot.results.figure_kind import Cut, FigureKind
from conespot.results.paper_values import REFERENCE_POWER_W, paper_means
from conespot.results.style import COLOURS, frame, panel_title, paper_label, plain_numbers
from conespot.results.variants import ordered

PANELS = (("Position", "position_error_mm"), ("Rotation", "rotation_error_deg"))
_MOST_RIGS = 4
_MOST_POWERS = 60  #: more boxes than that nobody tells apart
_PAPER: dict[str, Any] = {"markersize": 6.0, "markerfacecolor": "none", "color": COLOURS["paper"]}
_TUKEY = (
    "Boxes: quartiles; line: median; dot: mean; whiskers: farthest values within 1.5 interquartile ranges (Tukey); "
    "crosses: values beyond them."
)
_LOG_ABOVE = 12.0  #: largest value over the largest quartile, above which a linear axis shows outliers only


class OverPower(FigureKind):
    """Boxes over light power, where there is more than one."""

    name = "power"
    what = "Errors over light power,"
    numbers: ClassVar = {"box": 10, "helix": 11}

    def suits(self, cut: Cut) -> bool:
        """Whether power varies."""
        return bool(cut.boxes["power_w"].nunique() > 1)

    def caption(self, cut: Cut) -> str:
        """What a box is, failures, the range of powers, and what is assumed."""
        failed, frames = int((cut.rows["status"] == "failed").sum()), len(cut.rows)
        red = " (in red: how many at each power)" if failed else ""
        powers = cut.rows["power_w"]
        least, most = (
            power_in_words(cut.run.cases, pairs(cut.rows[powers == power]), power)
            for power in (float(powers.min()), float(powers.max()))
        )
        counted = f"{failed} of {frames} frames failed{red}; boxes hold the others. From {least} to {most}."
        count, shown = int(powers.nunique()), len(shown_powers(cut.boxes))
        thinned = f" {shown} of {count} powers are drawn, boxes.csv holds all." if shown < count else ""
        return f"{_TUKEY} {counted}{thinned}\n{cut.assumed}"

    def draw(self, cut: Cut, title: str, caption: str) -> Figure:
        """The figure, from the stored boxes alone."""
        return power_figure(cut.boxes, title, caption, cut.paper_table)


def power_figure(boxes: pd.DataFrame, title: str, caption: str, source: str | None) -> Figure:
    """Panels of position and rotation errors (rows) by spotlight rig (columns), a box for every power.

    `boxes` are those of one variant, surface and trajectory; `source` names the table whose AE at 1 W is drawn.
    """
    rigs = rigs_shown(boxes)
    powers = shown_powers(boxes)
    boxes = boxes[boxes["power_w"].isin(powers)]
    wide = max(4.2, 0.9 + 0.42 * len(powers))
    figure = Figure(figsize=(min(1.6 + wide * max(len(rigs), 1.3), 30.0), 6.8), layout="constrained")
    frame(figure, title, caption)
    grid = figure.subplots(len(PANELS), len(rigs), sharex=True, sharey="row", squeeze=False)
    pad = 15.0 if boxes["failed"].any() else 7.0  # the numbers of failed frames stand below the titles
    paper = source if REFERENCE_POWER_W in powers else None
    for row, (what, metric) in enumerate(PANELS):
        here = boxes[boxes["metric"] == metric]
        published = paper_means(paper, str(boxes["trajectory"].iloc[0]), rigs, metric, float(here["max"].max()))
        _scale(grid[row, 0], here, max(published.values(), default=0.0))
        for k, rig in enumerate(rigs):
            axes = grid[row, k]
            panel_title(axes, row * len(rigs) + k, what, rig, pad)
            _draw(axes, here[here["spotlights"] == rig], powers)
            if rig in published:
                axes.plot(powers.index(REFERENCE_POWER_W), published[rig], "D", **_PAPER, zorder=5)
        grid[row, 0].set_ylabel(f"{what.lower()} error [{column(metric).unit}]")
        if row == 0:
            _legend(grid[0, -1], paper and paper_label(paper, bool(published)))
    figure.align_ylabels(grid[:, 0])
    for axes in grid[-1]:
        axes.set_xticks(range(len(powers)), [f"{power:g}" for power in powers], rotation=0 if len(powers) <= 9 else 90)
        axes.set_xlim(-0.6, len(powers) - 0.4)
        axes.set_xlabel("light power [W]")
    return figure


def rigs_shown(boxes: pd.DataFrame) -> list[str]:
    """The rigs that are drawn, a column each."""
    return [str(rig) for rig in ordered(boxes["spotlights"])[:_MOST_RIGS]]


def shown_powers(boxes: pd.DataFrame) -> list[float]:
    """The powers that are drawn: all, or so many of them from the least to the most."""
    powers = sorted(boxes["power_w"].unique())
    places = np.linspace(0, len(powers) - 1, min(len(powers), _MOST_POWERS)).round().astype(int)
    return [powers[i] for i in places]


def _draw(axes: Axes, boxes: pd.DataFrame, powers: list[float]) -> None:
    places = {power: i for i, power in enumerate(powers)}
    drawn = boxes[boxes["n"] > 0]
    rig = str(boxes["spotlights"].iloc[0])
    colour = COLOURS.get(rig, COLOURS["other"])
    axes.bxp(
        [_bxp(box) for box in drawn.to_dict("records")],
        positions=[places[power] for power in drawn["power_w"]],
        widths=0.56,
        showmeans=True,
        patch_artist=True,
        manage_ticks=False,
        boxprops={"facecolor": colour + "33", "edgecolor": colour, "linewidth": 1.2},
        medianprops={"color": colour, "linewidth": 1.8},
        whiskerprops={"color": colour, "linewidth": 1.0},
        capprops={"color": colour, "linewidth": 1.0},
        meanprops={"marker": "o", "markerfacecolor": "#111111", "markeredgecolor": "white", "markersize": 5.0},
        flierprops={"marker": "x", "markeredgecolor": colour, "markersize": 3.6, "markeredgewidth": 0.8, "alpha": 0.75},
    )
    failed = [(places[power], str(n)) for power, n in zip(boxes["power_w"], boxes["failed"], strict=True) if n]
    for place, text in [(-0.62, "failed"), *failed] if failed else []:
        axes.annotate(
            text,
            (place, 1.0),
            (0.0, 2.0),
            xycoords=axes.get_xaxis_transform(),
            textcoords="offset points",
            ha="right" if place < 0.0 else "center",
            fontsize=7.5,
            color=COLOURS["failed"],
        )


def _bxp(box: dict[Any, Any]) -> dict[str, Any]:
    """A stored box in matplotlib's words."""
    words = {"mean": "mean", "med": "median", "q1": "q1", "q3": "q3", "whislo": "whisker_low", "whishi": "whisker_high"}
    return {**{word: box[name] for word, name in words.items()}, "fliers": np.asarray(box["outliers"], float)}


def on_log_scale(boxes: pd.DataFrame, published: float) -> bool:
    """Whether outliers lie so far beyond the boxes that a linear axis would show nothing else."""
    drawn = boxes[boxes["n"] > 0]
    most = max(drawn["max"].max(), published) if len(drawn) else published
    return bool(len(drawn) and most > _LOG_ABOVE * drawn["q3"].max() and (drawn["min"] > 0.0).all())


def _scale(axes: Axes, boxes: pd.DataFrame, published: float) -> None:
    """Logarithmic where the outliers lie far beyond the boxes, else linear from zero. Panels share it."""
    drawn = boxes[boxes["n"] > 0]
    most = max(drawn["max"].max(), published) if len(drawn) else published
    if on_log_scale(boxes, published):
        axes.set_yscale("log")
        plain_numbers(axes.yaxis)
    else:
        axes.set_ylim(0.0, 1.05 * most or 1.0)


def _legend(axes: Axes, paper: str | None) -> None:
    grey = "#4B5563"
    entries: list[tuple[Any, str]] = [
        (Patch(facecolor="#4B556333", edgecolor=grey), "quartiles"),
        (Line2D([], [], color=grey, linewidth=1.8), "median"),
        (Line2D([], [], color="none", marker="o", markerfacecolor="#111111", markeredgecolor="white"), "mean"),
        (Line2D([], [], color=grey, linewidth=1.0, marker="|"), "within 1.5 IQR"),
        (Line2D([], [], color="none", marker="x", markeredgecolor=grey, markersize=4), "outlier"),
    ]
    if paper:
        entries.append((Line2D([], [], linestyle="none", marker="D", **_PAPER), paper))
    handles, names = zip(*entries, strict=True)
    axes.legend(handles, names, loc="upper left", bbox_to_anchor=(1.01, 1.0), handlelength=1.6)
