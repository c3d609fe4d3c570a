"""Figures 10 and 11 to be touched: boxes over light power, the published means, and every frame beyond a whisker."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd

from conespot.results.columns import column
from conespot.results.figure_kind import Cut
from conespot.results.paper_values import REFERENCE_POWER_W, paper_means
from conespot.results.power_figure import PANELS, on_log_scale, rigs_shown, shown_powers
from conespot.results.report.chart import Json, axes, numbers, panels, plain, subplots, tone
from conespot.results.report.frames import frame_of
from conespot.results.report.words import rig_words

#: frames beyond the whiskers of one box that can be touched, the farthest first
_MOST_BEYOND = 40
_STATISTICS = ("n", "failed", "mean", "median", "q1", "q3", "whisker_low", "whisker_high", "max")


def over_power(cut: Cut) -> tuple[list[Json], Json, list[list[str]]]:
    """Traces, layout and grid of a cut's boxes: position and rotation (rows) by rig (columns)."""
    rigs, powers = rigs_shown(cut.boxes), shown_powers(cut.boxes)
    places = {power: i for i, power in enumerate(powers)}
    boxes = cut.boxes[cut.boxes["power_w"].isin(powers)]
    source = cut.paper_table if REFERENCE_POWER_W in powers else None
    titles = [[f"{what}, {plain(rig_words(rig))}" for rig in rigs] for what, _ in PANELS]
    units = [f"{what.lower()} error [{column(metric).unit}]" for what, metric in PANELS]
    layout = panels(titles, "light power [W]", units)
    traces: list[Json] = []
    for row, (_, metric) in enumerate(PANELS):
        here = boxes[boxes["metric"] == metric]
        unit = column(metric).unit
        published = paper_means(source, cut.trajectory, rigs, metric, float(here["max"].max()))
        log = on_log_scale(here, max(published.values(), default=0.0))
        for k, rig in enumerate(rigs):
            number = row * len(rigs) + k
            mine = _of_rig(here, rig)
            mine = mine[mine["n"] > 0]
            rows = cut.rows[(cut.rows["spotlights"] == rig) & (cut.rows["status"] == "ok")]
            first = number == 0
            traces += [
                {**trace, **axes(number)}
                for trace in (
                    *_boxes(mine, rig, places, unit, first),
                    _beyond(mine, rows, metric, rig, places, first),
                    *_published(published.get(rig), source, places, unit, first),
                )
            ]
            layout["annotations"] += _failed(_of_rig(here, rig), places, number)
            y = layout[f"yaxis{number + 1 if number else ''}"]
            y |= _range(here, max(published.values(), default=0.0), log)
    for name in [key for key in layout if key.startswith("xaxis")]:
        ticks = {"tickvals": list(range(len(powers))), "ticktext": [f"{power:g}" for power in powers]}
        layout[name] |= {**ticks, "range": [-0.6, len(powers) - 0.4], "showgrid": False}
    return traces, layout, subplots(len(PANELS), len(rigs))


def _of_rig(boxes: pd.DataFrame, rig: str) -> pd.DataFrame:
    """The boxes of a rig."""
    return boxes[boxes["spotlights"] == rig]


def _failed(boxes: pd.DataFrame, places: dict[float, int], number: int) -> list[Json]:
    """How many frames failed, above each box."""
    tail = str(number + 1) if number else ""
    place = {"xref": f"x{tail}", "yref": f"y{tail} domain", "y": 1, "yanchor": "bottom", "showarrow": False}
    red = {"size": 10.5, "color": tone("failed")}
    lost = boxes[boxes["failed"] > 0]
    return [
        {**place, "x": places[power], "text": str(n), "font": red}
        for power, n in zip(lost["power_w"], lost["failed"], strict=True)
    ]


def _boxes(boxes: pd.DataFrame, rig: str, places: dict[float, int], unit: str, first: bool) -> list[Json]:
    """The boxes, their means, and over each an unseen bar that tells its statistics."""
    x = [places[power] for power in boxes["power_w"]]
    colour = rig if rig in ("single", "triple") else "other"
    box: Json = {
        "type": "box", "x": x, "q1": numbers(boxes["q1"]), "median": numbers(boxes["median"]),
        "q3": numbers(boxes["q3"]), "lowerfence": numbers(boxes["whisker_low"]),
        "upperfence": numbers(boxes["whisker_high"]), "hoverinfo": "skip", "width": 0.56,
        "line": {"color": tone(colour), "width": 1.4}, "fillcolor": tone(colour, 0.2), "showlegend": False,
    }  # fmt: skip
    told = [[_digits(box[name]) for name in _STATISTICS] for box in boxes.to_dict("records")]
    names = ("localized", "failed", "mean", "median", "quartile 1", "quartile 3", "whisker", "whisker", "largest")
    lines = [f"{name} %{{customdata[{i}]}}{f' {unit}' if i > 1 else ''}" for i, name in enumerate(names)]
    lines[6:8] = [f"whiskers %{{customdata[6]}} to %{{customdata[7]}} {unit}"]
    watts = [f"{power:g} W" for power in boxes["power_w"]]
    bar: Json = {
        "type": "bar", "x": x, "base": numbers(boxes["whisker_low"]), "width": 0.62,
        "y": numbers(boxes["whisker_high"] - boxes["whisker_low"]), "marker": {"color": "rgba(0,0,0,0)"},
        "customdata": told, "text": watts, "textposition": "none", "showlegend": False,
        "hovertemplate": f"<b>%{{text}}</b><br>{'<br>'.join(lines)}<extra></extra>",
    }  # fmt: skip
    mean: Json = {
        "type": "scatter", "mode": "markers", "x": x, "y": numbers(boxes["mean"]), "name": "mean", "hoverinfo": "skip",
        "marker": {"size": 7, "color": tone("overall"), "line": {"width": 1.2, "color": tone("page")}},
        "showlegend": first,
    }  # fmt: skip
    return [box, bar, mean]


def _beyond(
    boxes: pd.DataFrame, rows: pd.DataFrame, metric: str, rig: str, places: dict[float, int], first: bool
) -> Json:
    """The frames beyond the whiskers: a click on one shows it."""
    errors, powers = rows[metric].to_numpy(float), rows["power_w"].to_numpy(float)
    outside: list[int] = []
    for power, low, high in boxes[["power_w", "whisker_low", "whisker_high"]].itertuples(index=False):
        spare = 1e-8 * abs(high)  # the stored boxes have nine digits
        here = np.flatnonzero((powers == power) & ((errors < low - spare) | (errors > high + spare)))
        outside += here[np.argsort(-errors[here], kind="stable")][:_MOST_BEYOND].tolist()
    told = [
        [frame_of(row), int(row["pose"])]
        for row in rows[["case", "localizer", "pose"]].iloc[outside].to_dict("records")
    ]
    x, y = [places[power] for power in powers[outside]], errors[outside]
    unit = column(metric).unit
    return {
        "type": "scatter", "mode": "markers", "x": x, "y": numbers(y), "customdata": told, "showlegend": first,
        "name": "beyond the whiskers", "hovertemplate": f"pose %{{customdata[1]}}: %{{y}} {unit}<extra></extra>",
        "marker": {"symbol": "x-thin", "size": 7, "line": {
            "width": 1.4, "color": tone(rig if rig in ("single", "triple") else "other")}},
    }  # fmt: skip


def _published(value: float | None, source: str | None, places: dict[float, int], unit: str, first: bool) -> list[Json]:
    if value is None:
        return []
    diamond = {"symbol": "diamond-open", "size": 11, "color": tone("paper"), "line": {"width": 2}}
    words = f"published mean ({source}) %{{y}} {unit}<extra></extra>"
    return [
        {
            "type": "scatter", "mode": "markers", "x": [places[REFERENCE_POWER_W]], "y": [value], "marker": diamond,
            "name": f"published mean, {source}", "hovertemplate": words, "showlegend": first,
        }
    ]  # fmt: skip


def _range(boxes: pd.DataFrame, published: float, log: bool) -> Json:
    drawn = boxes[boxes["n"] > 0]
    most = 1.06 * max(drawn["max"].max(), published) if len(drawn) else 1.0
    if not log:
        return {"range": [0.0, most]}
    return {"type": "log", "range": [math.log10(0.8 * drawn["min"].min()), math.log10(1.3 * most)]}


def _digits(value: float) -> str:
    return f"{value:.4g}"


def table_of(boxes: pd.DataFrame) -> tuple[Sequence[str], list[tuple[str, ...]]]:
    """The same numbers for who reads rather than sees: header and lines."""
    header = ("error", "spotlights", "power [W]", "localized", "failed", "mean", "median", "largest")
    lines = []
    for what, metric in PANELS:
        for box in boxes[boxes["metric"] == metric].to_dict("records"):
            told = (_digits(box[name]) for name in ("mean", "median", "max"))
            error = f"{what.lower()} [{column(metric).unit}]"
            lines.append(
                (error, str(box["spotlights"]), f"{box['power_w']:g}", str(box["n"]), str(box["failed"]), *told)
            )
    return header, lines
