"""Figures 8 and 9: the errors pose by pose along a trajectory, per axis and overall."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from conespot.results.assumptions import pairs, power_in_words
from conespot.results.columns import TIP_ERROR, column
from conespot.results.error_tables import reference_power
from conespot.results.figure_kind import Cut, FigureKind
from conespot.results.paper_values import paper_means
from conespot.results.style import COLOURS, frame, panel_title, paper_label, plain_numbers
from conespot.results.variants import ordered

#: per row of panels: what it shows, the signed parts, the overall error
PANELS = (
    ("Position", dict(zip("xyz", TIP_ERROR, strict=True)), "position_error_mm"),
    ("Rotation", {"about Y": "error_rot_y_deg", "about Z": "error_rot_z_deg"}, "rotation_error_deg"),
)
MOST_RIGS = 4
_DASHED = (0, (5, 3))
_LOG_ABOVE = 30.0  #: an error this many times the 75 % quantile would press all others flat


class AlongTrajectory(FigureKind):
    """Errors pose by pose at 1 W, or else at the highest power."""

    name = "along"
    what = "Errors along the"
    numbers: ClassVar = {"box": 8, "helix": 9}

    def caption(self, cut: Cut) -> str:
        """Power, failures, and what is assumed."""
        rows = at_reference_power(cut.rows)
        failed = int((rows["status"] == "failed").sum())
        counted = f"{failed} of {len(rows)} frames failed{' (red crosses)' if failed else ''}."
        power = power_in_words(cut.run.cases, pairs(rows), float(rows["power_w"].iloc[0]))
        return f"At {power}. Signed per axis; overall is their length. {counted}\n{cut.assumed}"

    def draw(self, cut: Cut, title: str, caption: str) -> Figure:
        """The figure at that power."""
        return pose_figure(at_reference_power(cut.rows), title, caption, cut.paper_table)


def at_reference_power(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows at 1 W, or else at the highest power."""
    return rows[rows["power_w"] == reference_power(set(rows["power_w"]))]


def pose_figure(rows: pd.DataFrame, title: str, caption: str, source: str | None) -> Figure:
    """Panels of position and rotation errors (rows) by spotlight rig (columns) over the pose number.

    `rows` are those of one variant, surface, trajectory and power; `source` names the table whose AE is drawn.
    """
    rigs = ordered(rows["spotlights"])[:MOST_RIGS]
    figure = Figure(figsize=(1.2 + 4.6 * max(len(rigs), 1.35), 6.6), layout="constrained")
    frame(figure, title, caption)
    grid = figure.subplots(len(PANELS), len(rigs), sharex=True, sharey="row", squeeze=False)
    for row, (what, parts, overall) in enumerate(PANELS):
        most = float(rows.loc[rows["status"] == "ok", overall].max())
        published = paper_means(source, str(rows["trajectory"].iloc[0]), rigs, overall, most)
        for k, rig in enumerate(rigs):
            axes = grid[row, k]
            panel_title(axes, row * len(rigs) + k, what, rig)
            _draw(axes, rows[rows["spotlights"] == rig], parts, overall)
            if rig in published:
                axes.axhline(published[rig], color=COLOURS["paper"], linewidth=1.2, linestyle=_DASHED, zorder=2)
        linear_to = _scale(grid[row, 0], rows, [*parts.values(), overall])
        beyond = f"\nlogarithmic beyond ±{linear_to:g}" if linear_to else ""
        grid[row, 0].set_ylabel(f"{what.lower()} error [{column(overall).unit}]{beyond}")
        _legend(grid[row, -1], [*parts, "overall"], source and paper_label(source, bool(published)))
    figure.align_ylabels(grid[:, 0])
    for axes in grid[-1]:
        axes.set_xlabel("pose along the trajectory")
    return figure


def _draw(axes: Axes, rows: pd.DataFrame, parts: dict[str, str], overall: str) -> None:
    rows = rows.sort_values("pose")
    located = rows["status"] == "ok"
    axes.axhline(0.0, color="#9AA1AC", linewidth=0.8, zorder=1)
    for name, error in [*parts.items(), ("overall", overall)]:
        values = rows[error].where(located)  # a failed pose breaks the line
        width = 1.8 if name == "overall" else 1.0
        # a pose between two failed ones has no line
        axes.plot(rows["pose"], values, ".-", color=COLOURS[name], linewidth=width, markersize=3.0, zorder=3)
    failed = rows["pose"][~located]
    if len(failed):
        strip = axes.get_xaxis_transform()  # at the panel's lower edge, whatever the errors
        axes.plot(
            failed, np.full(len(failed), 0.02), "x", color=COLOURS["failed"], transform=strip, markersize=5, zorder=4
        )
        axes.set_title(f"× {len(failed)} of {len(rows)} failed", loc="right", color=COLOURS["failed"], fontsize=8.0)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True, nbins=8, steps=[1, 2, 5, 10]))
    axes.margins(x=0.015)


def _scale(axes: Axes, rows: pd.DataFrame, columns: list[str]) -> float | None:
    """Linear, or symmetric-logarithmic where single gross errors would press all others flat. Panels share it.

    Returns where the logarithmic part begins, None if there is none.
    """
    errors = rows.loc[rows["status"] == "ok", columns].abs().to_numpy().ravel()
    if errors.size == 0:
        axes.set_ylim(-1.0, 1.0)
        return None
    typical, most = np.quantile(errors, (0.75, 1.0))
    if not 0.0 < _LOG_ABOVE * typical < most:
        return None
    linear_to = float(10.0 ** math.floor(math.log10(typical)))
    axes.set_yscale("symlog", linthresh=linear_to)
    plain_numbers(axes.yaxis)
    return linear_to


def _legend(axes: Axes, names: list[str], paper: str | None) -> None:
    handles = [Line2D([], [], color=COLOURS[name], linewidth=1.8 if name == "overall" else 1.2) for name in names]
    if paper:
        handles.append(Line2D([], [], color=COLOURS["paper"], linewidth=1.2, linestyle=_DASHED))
        names = [*names, paper]
    axes.legend(handles, names, loc="upper left", bbox_to_anchor=(1.01, 1.0), handlelength=1.6)
