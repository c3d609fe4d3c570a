"""Variants: what a run compares beyond the paper's own axes (trajectory, spotlights, power, surface).

One table block and one figure belongs to one variant, so numbers of different localizers, lights, sensors,
resolutions or swept values are never pooled.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from conespot.results.columns import SETTING, column
from conespot.results.run import Run

#: the paper's own axes, which lie inside a table or figure
AXES = ("surface", "trajectory", "spotlights", "power_w")
#: surfaces, trajectories and rigs in the order in which the paper shows them; others follow by name
_ORDER = {name: i for i, name in enumerate(("smooth", "bumps", "box", "helix", "single", "triple"))}


@dataclass(frozen=True)
class Variant:
    """The values of the group columns beyond `AXES`; `label` names the localizer and whatever varies in the run.

    `slug` is the label as a part of a file name, distinct within the run.
    """

    setting: dict[str, Any]
    label: str
    slug: str


def split(frame: pd.DataFrame, group: Sequence[str]) -> list[tuple[Variant, pd.DataFrame]]:
    """The variants among rows or boxes with these `group` columns, each with its part, in a stable order."""
    names = ["localizer", *(name for name in group if name not in AXES and name != "localizer")]
    telling = _telling(frame, names)
    found: list[tuple[Variant, pd.DataFrame]] = []
    taken: set[str] = set()
    for values, part in frame.groupby(names, sort=True):
        setting = dict(zip(names, values, strict=True))
        label = ", ".join(named(name, setting[name]) for name in telling)
        slug = re.sub(r"[^A-Za-z0-9.+]+", "-", label).strip("-.")[:100]
        if slug.lower() in taken or not slug:  # labels that differ in punctuation, case or their far end only
            slug = f"{slug}-{len(found) + 1}".lstrip("-")
        taken.add(slug.lower())
        found.append((Variant(setting, label, slug), part))
    return found


def _telling(frame: pd.DataFrame, names: Sequence[str]) -> list[str]:
    """The columns that name a variant: those that vary, but not what a campaign's own named choices say already."""
    varying = [name for name in names if name == "localizer" or frame[name].nunique() > 1]
    chosen = [name for name in varying if name not in SETTING]
    if not chosen:
        return varying
    combinations = frame[varying].drop_duplicates().groupby(chosen)
    return [n for n in varying if n == "localizer" or n in chosen or combinations[n].nunique().max() > 1]


def paired(run: Run, boxes: pd.DataFrame) -> list[tuple[Variant, pd.DataFrame, pd.DataFrame]]:
    """The variants of a run, each with its rows and its boxes."""
    if run.rows is None:
        return []
    parts = zip(split(run.rows.frame, run.rows.group), split(boxes, run.rows.group), strict=True)
    return [(variant, mine, stored) for (variant, mine), (_, stored) in parts]


def ordered(values: pd.Series) -> list[Any]:
    """The distinct values: the paper's names first and in its order, then the rest sorted."""
    return sorted(values.unique(), key=lambda v: (_ORDER.get(v, len(_ORDER)), v))


def by_axes(frame: pd.DataFrame) -> Iterator[tuple[dict[str, Any], pd.DataFrame]]:
    """The frame's parts of equal surface, trajectory, spotlights and power, in the paper's order."""
    parts: dict[Any, pd.DataFrame] = dict(iter(frame.groupby(list(AXES), sort=True)))
    for key in sorted(parts, key=lambda key: [(_ORDER.get(v, len(_ORDER)), v) for v in key]):
        yield dict(zip(AXES, key, strict=True)), parts[key]


def named(name: str, value: Any) -> str:
    """The value of a column in words: with its unit, or with the name of a swept key."""
    if name == "power_w" and 0.0 < value < 1e-3:
        return f"{1e3 * value:g} mW"
    text = f"{value:g}" if isinstance(value, float) else str(value)
    if name not in SETTING:
        return f"{name.removeprefix('scene.')} {text}"
    return f"{text} {column(name).unit}".rstrip()
