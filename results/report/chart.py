"""Charts as the plotting library's data: panels in rows and columns, colours by name, words from files as words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

from conespot.results.style import COLOURS

#: a trace or a layout, as plotly.js takes it
Json = dict[str, Any]
_PANEL_PX, _HEAD_PX = 300, 70
#: the house's colours that the page's style sheet has a light and a dark tone of, by their names in `COLOURS`
_TONES = {name: "--" + name.lower().replace(" ", "-") for name in COLOURS}


@dataclass(frozen=True)
class Chart:
    """A chart of the page: `name` is its element's, `words` what is told to who cannot see it.

    `grid` `[rows][columns]` are the panels; where the page is narrow the script stacks them.
    """

    name: str
    title: str
    caption: str
    words: str
    traces: Sequence[Json]
    layout: Json
    files: Sequence[str] = ()
    grid: Sequence[Sequence[str]] = field(default=(("xy",),))

    @property
    def data(self) -> Json:
        """What the page's script draws."""
        return {"data": list(self.traces), "layout": self.layout, "grid": [list(row) for row in self.grid]}

    @property
    def height(self) -> int:
        """Its height on a wide page [px]."""
        return int(self.layout["height"])


def tone(name: str, alpha: float = 1.0) -> str:
    """A colour by its name; the script puts in what the page's light or dark style has under it."""
    return f"@{_TONES.get(name, '--' + name)}/{alpha:g}"


def plain(text: object) -> str:
    """A word from a file in a chart: plotly.js would read tags in it."""
    return str(text).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def numbers(values: Iterable[float]) -> list[float | None]:
    """Numbers to five digits, as a chart shows them; none for NaN."""
    return [float(f"{value:.5g}") if math.isfinite(value) else None for value in map(float, values)]


def panels(titles: Sequence[Sequence[str]], x: str, y: Sequence[str], *, height: int = _PANEL_PX) -> Json:
    """The layout of panels `titles` `[rows][columns]`: x shared by all, y by each row, named `y` `[rows]`."""
    columns = len(titles[0])
    layout: Json = {
        "height": _HEAD_PX + height * len(titles),
        "annotations": [],
        "legend": {"orientation": "h", "x": 0, "y": 1, "yref": "container", "yanchor": "top"},
        "margin": {"l": 64, "r": 12, "t": 74, "b": 64},
        "hovermode": "closest",
    }
    for row, names in enumerate(titles):
        for column, title in enumerate(names):
            n = row * columns + column + 1
            tail = "" if n == 1 else str(n)
            layout[f"xaxis{tail}"] = {"title": {"text": x if row == len(titles) - 1 else ""}, "zeroline": False}
            layout[f"yaxis{tail}"] = {"title": {"text": y[row] if column == 0 else ""}, "zeroline": False}
            if n > 1:
                layout[f"xaxis{tail}"]["matches"] = "x"
            first = row * columns + 1
            if column:
                layout[f"yaxis{tail}"]["matches"] = f"y{first if first > 1 else ''}"
            layout["annotations"].append(_heading(title, tail))
    return layout


def subplots(rows: int, columns: int) -> list[list[str]]:
    """The panels' names, as `Chart.grid` holds them."""
    names = [f"x{n if n > 1 else ''}y{n if n > 1 else ''}" for n in range(1, rows * columns + 1)]
    return [names[row * columns : (row + 1) * columns] for row in range(rows)]


def axes(number: int) -> Json:
    """The axes of the panel of that number, from 0."""
    tail = "" if number == 0 else str(number + 1)
    return {"xaxis": f"x{tail}", "yaxis": f"y{tail}"}


def _heading(title: str, tail: str) -> Json:
    place = {
        "xref": f"x{tail} domain",
        "yref": f"y{tail} domain",
        "x": 0,
        "y": 1,
        "xanchor": "left",
        "yanchor": "bottom",
    }
    return {**place, "text": title, "showarrow": False, "yshift": 14, "font": {"size": 13}}
