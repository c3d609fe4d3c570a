"""What the numbers of a report assume: once what all share, and in a table only what differs."""

from __future__ import annotations

from dataclasses import dataclass

from conespot.results.assumptions import NOT_USED, Assumptions, assumptions, common, pairs
from conespot.results.run import Run
from conespot.results.table import Block
from conespot.results.variants import ordered, split

_MOST_LINES = 300
_MOST_NAMED = 6


@dataclass(frozen=True)
class Assumed:
    """`shared` `(what, words)` holds for all numbers; `block` has a line for each set of the others."""

    shared: tuple[tuple[str, str], ...]
    block: Block | None

    def beyond(self, one: Assumptions | None) -> str:
        """What a set assumes beyond, or against, what all share, in a sentence; empty if nothing."""
        if one is None:
            return ""
        told = one.columns()
        shared = self.columns
        return one.sentence(beside=[name for name, words in told.items() if words in (NOT_USED, shared.get(name))])

    @property
    def columns(self) -> dict[str, str]:
        """What all share, by column."""
        return {what.replace(" ", "_"): words for what, words in self.shared}


def assumed(run: Run) -> Assumed | None:
    """The assumptions of a run's variants and surfaces; None without rows."""
    if run.rows is None:
        return None
    sets: dict[Assumptions, list[str]] = {}
    for variant, part in split(run.rows.frame[[*run.rows.group, "case"]], run.rows.group):
        surfaces = ordered(part["surface"])
        for surface in surfaces:
            label = f"{variant.label}, {surface}" if len(surfaces) > 1 else variant.label
            one = assumptions(run.cases, pairs(part[part["surface"] == surface]))
            sets.setdefault(one, []).append(label)
    shared = common(sets)
    told = tuple((name.replace("_", " "), words) for name, words in shared.items())
    differing = [name for name in Assumptions().columns() if name not in shared]
    if not differing:
        return Assumed(told, None)
    lines = tuple((_named(labels), *(one.columns()[name] for name in differing)) for one, labels in sets.items())
    header = ("numbers of", *(name.replace("_", " ") for name in differing))
    return Assumed(told, Block("", header, lines[:_MOST_LINES], ()))


def _named(labels: list[str]) -> str:
    more = len(labels) - _MOST_NAMED
    return "; ".join([*labels[:_MOST_NAMED], *([f"{more} more"] if more > 0 else [])])
