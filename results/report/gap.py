"""The reality gap to be touched: what each effect costs, a panel for each light and a mark for each localizer."""

from __future__ import annotations

import math

from conespot.results.figure_kind import Cut
from conespot.results.reality_gap import EFFECT, Cost, costs, names
from conespot.results.report.chart import Json, axes, numbers, panels, plain, subplots, tone
from conespot.results.report.words import um

_SHADES = ("single", "triple", "y", "paper", "about-y", "overall")
_MARKS = ("circle", "square", "diamond", "triangle-down", "triangle-up", "cross")
_MOST_LIGHTS, _MOST_EFFECTS = 4, 40


def gap(cut: Cut) -> tuple[list[Json], Json, list[list[str]]]:
    """Traces, layout and grid of a run that compares effects."""
    found = costs(cut.rows)
    lights, effects = names(cut.rows, "illumination")[:_MOST_LIGHTS], names(cut.rows, EFFECT)[:_MOST_EFFECTS]
    localizers = names(cut.rows, "localizer")[: len(_SHADES)]
    titles = [[plain(light) for light in lights]]
    layout = panels(titles, "median position error [um]", [""], height=120 + 34 * len(effects))
    medians = [1e3 * cost.median for cost in found.values() if cost.median > 0.0]
    edge = 2.4 * max(medians, default=10.0)  # where all were refused
    traces: list[Json] = []
    for k, light in enumerate(lights):
        for j, localizer in enumerate(localizers):
            there = [(i, found[localizer, e, light]) for i, e in enumerate(effects) if (localizer, e, light) in found]
            x = numbers(1e3 * cost.median if math.isfinite(cost.median) else edge for _, cost in there)
            shift = 0.22 * (j - (len(localizers) - 1) / 2.0)
            told = [[plain(effects[i]), _said(cost)] for i, cost in there]
            trace = {
                "type": "scatter", "mode": "markers+text", "x": x, "y": [i + shift for i, _ in there],
                "name": plain(localizer), "legendgroup": localizer, "showlegend": k == 0, "customdata": told,
                "text": [str(cost.refused or "") for _, cost in there], "textposition": "middle right",
                "textfont": {"size": 11, "color": tone(_SHADES[j])}, "cliponaxis": False,
                "marker": {"size": 9, "symbol": _MARKS[j], "color": tone(_SHADES[j])},
                "hovertemplate": f"<b>%{{customdata[0]}}</b><br>%{{customdata[1]}}<extra>{plain(localizer)}</extra>",
            }  # fmt: skip
            traces.append({**trace, **axes(k)})
    for k in range(len(lights)):
        tail = k + 1 if k else ""
        layout[f"xaxis{tail}"] |= {"type": "log"}
        ticks = {"tickvals": list(range(len(effects))), "ticktext": [plain(effect)[:40] for effect in effects]}
        layout[f"yaxis{tail}"] |= {**ticks, "range": [len(effects) - 0.5, -0.5], "automargin": True}
        layout[f"yaxis{tail}"] |= {"showticklabels": k == 0}
    return traces, layout, subplots(1, len(lights))


def _said(cost: Cost) -> str:
    refused = f"refused {cost.refused} of {cost.frames}"
    return f"{um(cost.median)}<br>largest {um(cost.worst)}<br>{refused}" if math.isfinite(cost.median) else refused
