"""Figures 8 and 9 to be touched: the errors pose by pose, per axis and overall, with the published means."""

from __future__ import annotations

import numpy as np
import pandas as pd

from conespot.results.columns import column
from conespot.results.figure_kind import Cut
from conespot.results.paper_values import paper_means
from conespot.results.pose_figure import MOST_RIGS, PANELS, at_reference_power
from conespot.results.report.chart import Json, axes, numbers, panels, plain, subplots, tone
from conespot.results.report.frames import frame_of
from conespot.results.report.words import rig_words
from conespot.results.variants import ordered

_MOST_POSES = 1000  #: along a line that nobody tells more apart on


def along(cut: Cut) -> tuple[list[Json], Json, list[list[str]]]:
    """Traces, layout and grid of a cut at its reference power: position and rotation (rows) by rig (columns)."""
    rows = at_reference_power(cut.rows)
    rigs = [str(rig) for rig in ordered(rows["spotlights"])[:MOST_RIGS]]
    titles = [[f"{what}, {plain(rig_words(rig))}" for rig in rigs] for what, _, _ in PANELS]
    units = [f"{what.lower()} error [{column(overall).unit}]" for what, _, overall in PANELS]
    layout = panels(titles, "pose along the trajectory", units)
    traces: list[Json] = []
    told: set[str] = set()  # what the legend has
    for row, (what, parts, overall) in enumerate(PANELS):
        most = float(rows.loc[rows["status"] == "ok", overall].max())
        published = paper_means(cut.paper_table, cut.trajectory, rigs, overall, most)
        for k, rig in enumerate(rigs):
            number = row * len(rigs) + k
            mine = rows[rows["spotlights"] == rig].sort_values("pose").iloc[:_MOST_POSES]
            lines = [_line(mine, name, error) for name, error in {**parts, f"overall {what.lower()}": overall}.items()]
            if rig in published:
                lines.append(_published(mine, published[rig], str(cut.paper_table), column(overall).unit))
            for line in [*lines, *_refused(mine)]:
                traces.append({**line, **axes(number), "showlegend": line["legendgroup"] not in told})
                told.add(line["legendgroup"])
    for name in [key for key in layout if key.startswith("yaxis")]:
        layout[name] |= {"zeroline": True}
    return traces, layout, subplots(len(PANELS), len(rigs))


def _line(rows: pd.DataFrame, name: str, error: str) -> Json:
    whole = name.startswith("overall")
    colour = "overall" if whole else name
    values = rows[error].where(rows["status"] == "ok")  # a failed pose breaks the line
    told = [[frame_of(row), int(row["pose"])] for row in rows.to_dict("records")] if whole else rows["pose"].tolist()
    pose = "%{customdata[1]}" if whole else "%{customdata}"
    return {
        "type": "scatter", "mode": "lines+markers", "x": rows["pose"].tolist(), "y": numbers(values), "name": name,
        "legendgroup": name, "customdata": told,
        "line": {"color": tone(colour), "width": 2.2 if whole else 1.2},
        "marker": {"size": 5 if whole else 3.5, "color": tone(colour)},
        "hovertemplate": f"pose {pose}<br>{name} %{{y}} {column(error).unit}<extra></extra>",
    }  # fmt: skip


def _published(rows: pd.DataFrame, value: float, source: str, unit: str) -> Json:
    ends = [int(rows["pose"].min()), int(rows["pose"].max())]
    return {
        "type": "scatter", "mode": "lines", "x": ends, "y": [value, value], "name": f"published mean, {source}",
        "legendgroup": "published",
        "line": {"color": tone("paper"), "width": 1.6, "dash": "dash"},
        "hovertemplate": f"published mean ({source}) %{{y}} {unit}<extra></extra>",
    }  # fmt: skip


def _refused(rows: pd.DataFrame) -> list[Json]:
    """Refused poses at zero, with their reasons."""
    lost = rows[rows["status"] != "ok"]
    if lost.empty:
        return []
    told = [[frame_of(row), int(row["pose"]), plain(row["reason"])[:200]] for row in lost.to_dict("records")]
    return [
        {
            "type": "scatter", "mode": "markers", "x": lost["pose"].tolist(), "y": np.zeros(len(lost)).tolist(),
            "name": "not localized", "legendgroup": "refused", "customdata": told,
            "marker": {"symbol": "x-thin", "size": 8, "line": {"width": 2, "color": tone("failed")}},
            "hovertemplate": "pose %{customdata[1]} not localized: %{customdata[2]}<extra></extra>",
        }
    ]  # fmt: skip
