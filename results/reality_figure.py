"""The reality gap as a figure: median errors by effect, a panel for each light and a mark for each localizer."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from conespot.results.assumptions import assumptions, pairs
from conespot.results.figure_kind import Cut, FigureKind
from conespot.results.reality_gap import EFFECT, Cost, costs, is_gap, names
from conespot.results.style import COLOURS, KINDS, frame, plain_numbers

_MOST_LIGHTS, _MOST_EFFECTS, _MOST_LOCALIZERS = 4, 40, 6
_MARKS = "osD^vP"
_COLOURS = [COLOURS[name] for name in ("single", "triple", "other", "paper", "about Y", "overall")]


class RealityGap(FigureKind):
    """What each effect costs, of a run that compares effects."""

    name = "reality_gap"
    what = "The reality gap"
    of_run = True

    def suits(self, cut: Cut) -> bool:
        """Whether the run compares effects."""
        return is_gap(cut.run)

    def title(self, cut: Cut) -> str:
        """What stands above it."""
        return f"{self.what}: median position error by effect and light"

    def stem(self, cut: Cut) -> str:
        """One a run."""
        return self.name

    def made(self, file: str) -> bool:
        """Whether a file is this figure."""
        return file in {f"{self.name}.{kind}" for kind in KINDS}

    def caption(self, cut: Cut) -> str:
        """What a mark is."""
        frames = max((cost.frames for cost in costs(cut.rows).values()), default=0)
        return (
            f"Marks: median over the frames that were localized, of {frames} each; beside a mark how many were refused."
            " A mark on the right edge: all were.\n" + _assumed(cut)
        )

    def draw(self, cut: Cut, title: str, caption: str) -> Figure:
        """Panels by light; effects from top to bottom."""
        found = costs(cut.rows)
        lights, effects, localizers = (
            names(cut.rows, label)[:most]
            for label, most in (
                ("illumination", _MOST_LIGHTS),
                (EFFECT, _MOST_EFFECTS),
                ("localizer", _MOST_LOCALIZERS),
            )
        )
        figure = Figure(figsize=(2.2 + 3.2 * len(lights), 1.9 + 0.42 * len(effects)), layout="constrained")
        frame(figure, title, caption)
        panels = figure.subplots(1, len(lights), sharex=True, sharey=True, squeeze=False)[0]
        medians = [1e3 * cost.median for cost in found.values() if cost.median > 0.0]
        least, most = (min(medians), max(medians)) if medians else (1.0, 10.0)
        panels[0].set_xscale("log")
        panels[0].set_xlim(least / 1.6, most * 4.0)
        panels[0].set_yticks(range(len(effects)), [effect[:40] for effect in effects])
        panels[0].set_ylim(len(effects) - 0.5, -0.5)
        for light, axes in zip(lights, panels, strict=True):
            axes.set_title(light, loc="left")
            axes.set_xlabel("median position error [um]")
            plain_numbers(axes.xaxis)
            for k, localizer in enumerate(localizers):
                own = [found.get((localizer, effect, light)) for effect in effects]
                _marks(axes, own, 0.22 * (k - (len(localizers) - 1) / 2.0), k, localizer, 2.4 * most)
        panels[-1].legend(loc="upper right", bbox_to_anchor=(1.0, -0.12), ncols=len(localizers))
        return figure


def _assumed(cut: Cut) -> str:
    """What all of it assumes; sensors and localizers of the effects are named by the table."""
    sentence = assumptions(cut.run.cases, pairs(cut.rows)).sentence()
    return f"Assumes {sentence}."


def _marks(axes: Axes, own: list[Cost | None], shift: float, k: int, label: str, edge: float) -> None:
    there = [(y, cost) for y, cost in enumerate(own) if cost is not None]
    x = np.array([1e3 * cost.median if math.isfinite(cost.median) else edge for _, cost in there])
    y = np.array([row + shift for row, _ in there])
    axes.plot(x, y, _MARKS[k], color=_COLOURS[k], markersize=5.0, label=label)
    for at, row, (_, cost) in zip(x, y, there, strict=True):
        if cost.refused:
            axes.annotate(
                f"{cost.refused}", (at, row), (5.0, 0.0), textcoords="offset points", va="center", fontsize=7.0,
                color=_COLOURS[k],
            )  # fmt: skip
