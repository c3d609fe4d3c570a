"""The reality gap: what each effect of the real world costs each localizer, in each light.

A campaign has it that sweeps named choices called `effect`, of which the first is the ideal world.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pandas as pd

from conespot.results.assumptions import assumptions, pairs, together
from conespot.results.run import Run
from conespot.results.table import Block, Table, number

EFFECT = "effect"
_MOST_NAMED = 60
_NOTE = (
    "Median position errors [um] of the frames that were localized, and how many were refused. cone and photometric "
    "are told optics, lens, core, tissue and how a hand trembles; the published methods know none of it."
)


@dataclass(frozen=True)
class Cost:
    """What a localizer made of the frames of one effect in one light. Lengths in mm, NaN if it refused them all."""

    frames: int
    refused: int
    median: float
    worst: float


def is_gap(run: Run) -> bool:
    """Whether the run compares effects."""
    return run.rows is not None and EFFECT in run.rows.swept and run.rows.frame[EFFECT].nunique() > 1


def names(rows: pd.DataFrame, label: str) -> list[str]:
    """The distinct values of a label in the order of the rows."""
    return [str(value) for value in dict.fromkeys(rows[label])]


def parts(rows: pd.DataFrame) -> Iterator[tuple[tuple[str, str, str], pd.DataFrame]]:
    """The rows of each localizer, effect and light; poses and trajectories are pooled."""
    for key, part in rows.groupby(["localizer", EFFECT, "illumination"], sort=False):
        localizer, effect, light = map(str, key)
        yield (localizer, effect, light), part


def costs(rows: pd.DataFrame) -> dict[tuple[str, str, str], Cost]:
    """The cost of each localizer, effect and light that there are rows of."""
    found = {}
    for key, part in parts(rows):
        good = part.loc[part["status"] == "ok", "position_error_mm"]
        worst = float(good.max()) if len(good) else math.nan
        found[key] = Cost(len(part), len(part) - len(good), float(good.median()), worst)
    return found


def reality_table(run: Run) -> Table | None:
    """The table of a run that compares effects; None for any other."""
    if run.rows is None or not is_gap(run):
        return None
    rows = run.rows.frame
    found, effects, lights = costs(rows), names(rows, EFFECT)[:_MOST_NAMED], names(rows, "illumination")
    assumed = {key: assumptions(run.cases, pairs(part)) for key, part in parts(rows)}
    records: list[dict[str, Any]] = []
    blocks = []
    for localizer in names(rows, "localizer"):
        lines = []
        for effect in effects:
            cells = [effect]
            for light in lights:
                cost = found.get((localizer, effect, light))
                cells += _cells(cost)
                if cost is not None:
                    ideal = found.get((localizer, effects[0], light), cost).median
                    about = {"localizer": localizer, EFFECT: effect, "illumination": light, "frames": cost.frames}
                    numbers = {"refused": cost.refused, "median_mm": cost.median, "max_mm": cost.worst}
                    over = {"over_first": cost.median / ideal if ideal else math.nan}
                    sets = assumed[localizer, effect, light].columns()
                    records.append({**about, **numbers, **over, **sets})
            lines.append(tuple(cells))
        header = tuple(part for light in lights for part in (f"{light} [um]", "refused"))
        assumes = together(one for (name, _, _), one in assumed.items() if name == localizer)
        blocks.append(Block(localizer, (EFFECT, *header), tuple(lines), (), assumes))
    return Table("reality_gap", "The reality gap", pd.DataFrame(records), tuple(blocks), (_NOTE,))


def _cells(cost: Cost | None) -> tuple[str, str]:
    return ("", "") if cost is None else (number(1e3 * cost.median), f"{cost.refused} of {cost.frames}")
