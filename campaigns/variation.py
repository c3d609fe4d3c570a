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
        shown = values if len(values) <= _MOST_VALUES else [*values[: _MOST_VALUES - 2], "...", values[-1]]
        more = "" if len(values) == len(shown) else f" ({len(values)} in all)"
        yield from _line(name, ", ".join(textwrap.shorten(value, 70, placeholder=" ...") for value in shown) + more)
    same = [(f"{name} " if "." in name else "") + values[0] for name, values in table.items() if len(values) == 1]
    yield from _line("in all" if several else "one case", ", ".join(same))


def _said(case: Case) -> dict[str, str]:
    labels = {name: f"{value}" for name, value in case.labels.items() if name not in ("power_w", "resolution_px")}
    both = case.scene.power.both(case.scene.beam)
    labels["power"] = f"{both.isotropic_w:.4g} W isotropic = {1e3 * both.flux_w:.4g} mW flux"
    labels["size"] = case.scene.camera.size_words
    labels |= {name: f"{value}" for name, value in case.swept.items()}
    return labels | {"localizers": " and ".join(case.localizers)}


def _line(name: str, text: str) -> Iterator[str]:
    first, rest = f"  {name:{_MARGIN - 3}} ", " " * _MARGIN
    yield from textwrap.wrap(text, _WIDTH, initial_indent=first, subsequent_indent=rest, break_long_words=False)
