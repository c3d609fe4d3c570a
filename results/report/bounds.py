"""What no unbiased localizer beats beside what was reached, and what an error in each quantity costs."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

import numpy as np
import pandas as pd

from conespot.results.pose_figure import at_reference_power
from conespot.results.report.chart import Json, numbers, panels, plain, tone
from conespot.results.report.words import rig_words
from conespot.results.run import Run
from conespot.results.table import Table
from conespot.results.variants import by_axes, split

_MOST_LINES = 40
_ERROR, _BOUND = "position_error_mm", "est_bound_mm"
_SHADES = ("single", "triple", "y", "paper")
#: letters of a label's line, and how many lines it has at most
_WIDE, _MOST_HIGH = 40, 3
_PLACE = ("trajectory", "spotlights", "surface")

Points = list[tuple[str, float]]


def beside_bounds(run: Run, theory: Sequence[Table]) -> tuple[list[Json], Json] | None:
    """Root mean square tip errors beside their Cramer-Rao bound [um], a line a setting.

    Of a run that states a bound for each frame both come from the frames that were localized; where `campaign theory`
    left bounds.csv in its folder these follow. None without either.
    """
    reached, possible = _of_run(run)
    stated = [table.frame for table in theory if table.name == "bounds"]
    designed = _of_theory(stated[0]) if stated else []
    if not possible and not designed:
        return None
    labels = list(dict.fromkeys(label for label, _ in (*reached, *possible, *designed)))
    high = max(len(_wrapped(label)) for label in labels)
    layout = panels([[""]], "root mean square tip error [um]", [""], height=60 + len(labels) * (10 + 20 * high))
    layout["xaxis"] |= {"type": "log"}
    layout["yaxis"] |= {"range": [len(labels) - 0.4, -0.6], "automargin": True, "ticksuffix": "  ", "type": "category"}
    layout["yaxis"] |= {"tickfont": {"size": 11}}
    kinds = (
        (reached, "error that was reached", "overall", "circle"),
        (possible, "bound of the same frames", "paper", "line-ns-open"),
        (designed, "bound of a frame, by campaign theory", "triple", "diamond-open"),
    )
    return [_points(*kind) for kind in kinds if kind[0]], layout


def error_budget(theory: Sequence[Table]) -> tuple[list[Json], Json] | None:
    """What one tolerance of each quantity moves the tip by [um], from budget.csv; None if there is none."""
    stated = [table.frame for table in theory if table.name == "budget"]
    if not stated or not {"quantity", "tolerance", "unit", "height_mm", "rcm", "position_um"} <= set(stated[0]):
        return None
    data = stated[0].assign(at=_numbers(stated[0], "position_um"))
    data = data[data["at"] > 0.0].head(8 * _MOST_LINES)
    labels = {
        str(row["quantity"]): plain(
            f"{str(row['quantity']).replace('_', ' ')}, {_whole(row['tolerance'])} {row['unit']}"
        )
        for row in data.to_dict("records")
    }
    layout = panels([[""]], "the tip moves by [um]", [""], height=64 * len(labels) + 60)
    layout["xaxis"] |= {"type": "log"}
    layout["yaxis"] |= {"autorange": "reversed", "automargin": True, "ticksuffix": "  ", "type": "category"}
    traces: list[Json] = []
    for k, ((rcm, height), part) in enumerate(data.groupby(["rcm", "height_mm"], sort=True)):
        traces.append({
            "type": "bar", "orientation": "h", "y": [labels[str(name)] for name in part["quantity"]],
            "x": numbers(part["at"]), "name": plain(f"RCM {rcm}, tip {_whole(height)} mm high"),
            "marker": {"color": tone(_SHADES[k % len(_SHADES)])}, "hovertemplate": "%{y}<br>%{x} um",
        })  # fmt: skip
    return (traces, layout) if traces else None


def _of_run(run: Run) -> tuple[Points, Points]:
    """Errors and bounds of each variant and rig [um]; of one that states no bound, its errors alone."""
    reached: Points = []
    possible: Points = []
    if run.rows is None:
        return reached, possible
    frame = run.rows.frame
    has = _BOUND in frame
    varied = [name for name in _PLACE if frame[name].nunique() > 1]
    needed = [*run.rows.group, "case", "status", _ERROR, *([_BOUND] if has else [])]
    for variant, part in split(frame[needed], run.rows.group):
        for axes, here in by_axes(at_reference_power(part)):
            good = here[here["status"] == "ok"]
            if good.empty or len(reached) == _MOST_LINES:
                continue
            place = (rig_words(str(axes[name])) if name == "spotlights" else str(axes[name]) for name in varied)
            label = ", ".join((variant.label, *place))
            reached.append((label, 1e3 * _rms(good[_ERROR])))
            bound = good[_BOUND].dropna() if has else good[_ERROR].iloc[:0]
            if len(bound):
                possible.append((label, 1e3 * _rms(bound)))
    return reached, possible


def _of_theory(data: pd.DataFrame) -> Points:
    """The bounds of a frame [um]; tips of all heights stand on one line."""
    if not {"resolution_px", "edge", "rcm", "position_um"} <= set(data):
        return []
    found = []
    for row, um in zip(data.to_dict("records"), _numbers(data, "position_um"), strict=True):
        where = f"bound: {_whole(row['resolution_px'])} px, {row['edge']} edge, RCM {row['rcm']}"
        if um > 0.0:
            found.append((where, um))
    return found[:_MOST_LINES]


def _points(points: Points, name: str, shade: str, symbol: str) -> Json:
    return {
        "type": "scatter", "mode": "markers", "y": ["<br>".join(_wrapped(label)) for label, _ in points],
        "x": numbers(um for _, um in points), "name": name,
        "hovertemplate": f"%{{y}}<br>{name}: %{{x}} um<extra></extra>",
        "marker": {"symbol": symbol, "size": 10, "color": tone(shade), "line": {"width": 2.2, "color": tone(shade)}},
    }  # fmt: skip


def _wrapped(label: str) -> list[str]:
    """A label's lines, as words."""
    return [plain(line) for line in textwrap.wrap(label, _WIDE, max_lines=_MOST_HIGH, placeholder=" …")]


def _whole(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _numbers(data: pd.DataFrame, name: str) -> pd.Series:
    return pd.to_numeric(data[name], errors="coerce").replace([math.inf, -math.inf], math.nan)


def _rms(values: pd.Series) -> float:
    return float(np.sqrt(np.mean(np.square(values.to_numpy(float)))))
