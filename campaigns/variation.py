"""What varies in a plan, as a table: a line for every label of which its cases have several."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

from conespot.campaigns.plan import Case, Plan

_MOST_VALUES = 12
_WIDTH = 110
_MARGIN = 18


def variation(plan: Plan) -> Iterator[str]:
    """Lines of name and values, with what is the same in all cases in the last."""
    table: dict[str, list[str]] = {}
    for case in plan.cases:
        for name, value in _said(case).items():
            values = table.setdefault(name, [])
            if value not in values:
                values.append(value)
    several = {name: values for name, values in table.items() if len(values) > 1}
    for name, values in several.items():
        yield from wrapped(name, ", ".join(textwrap.shorten(value, 70, placeholder=" ...") for value in _shown(values)))
    same = [(f"{name} " if "." in name else "") + values[0] for name, values in table.items() if len(values) == 1]
    yield from wrapped("in all" if several else "one case", ", ".join(same))
    for number, power in enumerate(_shown(list(dict.fromkeys(_power(case) for case in plan.cases)))):
        yield from wrapped("" if number else "power", power)


def wrapped(name: str, text: str) -> Iterator[str]:
    """Lines of a name and what is said of it beside it."""
    first, rest = f"  {name:{_MARGIN - 3}} ", " " * _MARGIN
    yield from textwrap.wrap(text, _WIDTH, initial_indent=first, subsequent_indent=rest, break_long_words=False)


def _shown(values: list[str]) -> list[str]:
    """The values, or of many the first and the last, and how many there are."""
    if len(values) <= _MOST_VALUES:
        return values
    return [*values[: _MOST_VALUES - 2], f"... ({len(values)} in all)", values[-1]]


def _said(case: Case) -> dict[str, str]:
    labels = {name: f"{value}" for name, value in case.labels.items() if name not in ("power_w", "resolution_px")}
    labels["size"] = case.scene.camera.size_words
    labels |= {name: f"{value}" for name, value in case.swept.items()}
    return labels | {"localizers": " and ".join(case.localizers)}


def _power(case: Case) -> str:
    """The power of one spotlight in both conventions."""
    both = case.scene.power.both(case.scene.beam)
    return f"{both.isotropic_w:.4g} W isotropic = {1e3 * both.flux_w:.4g} mW flux"
