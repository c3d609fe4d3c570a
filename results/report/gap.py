"""The reality gap to be touched: what each effect costs, a panel for each light and a mark for each localizer."""

from __future__ import annotations

import math

from conespot.results.figure_kind import Cut
from conespot.results.reality_gap import EFFECT, costs, names
from conespot.results.report.chart import Json, axes, numbers, panels, plain, subplots, tone

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
    traces: list[Json] = []
    for k, light in enumerate(lights):
        for j, localizer in enumerate(localizers):
            there = [(i, found[localizer, e, light]) for i, e in enumerate(effects) if (localizer, e, light) in found]
            there = [(i, cost) for i, cost in there if math.isfinite(cost.median)]
            shift = 0.22 * (j - (len(localizers) - 1) / 2.0)
            told = [[plain(effects[i]), f"{c.refused} of {c.frames}", f"{1e3 * c.worst:.3g}"] for i, c in there]
            words = "%{x} um<br>largest %{customdata[2]} um<br>refused %{customdata[1]}"
            trace = {
                "type": "scatter", "mode": "markers", "x": numbers(1e3 * cost.median for _, cost in there),
                "y": [i + shift for i, _ in there], "name": plain(localizer), "legendgroup": localizer,
                "showlegend": k == 0, "customdata": told,
                "marker": {"size": 9, "symbol": _MARKS[j], "color": tone(_SHADES[j])},
                "hovertemplate": f"<b>%{{customdata[0]}}</b><br>{words}<extra>{plain(localizer)}</extra>",
            }  # fmt: skip
            traces.append({**trace, **axes(k)})
    for k in range(len(lights)):
        tail = k + 1 if k else ""
        layout[f"xaxis{tail}"] |= {"type": "log"}
        ticks = {"tickvals": list(range(len(effects))), "ticktext": [plain(effect)[:40] for effect in effects]}
        layout[f"yaxis{tail}"] |= {**ticks, "range": [len(effects) - 0.5, -0.5], "automargin": True}
        layout[f"yaxis{tail}"] |= {"showticklabels": k == 0}
    return traces, layout, subplots(1, len(lights))
