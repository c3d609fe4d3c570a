"""The table of answers that `campaign localize` and `campaign track` print for people."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import Any

from conespot.campaigns.answer_row import RESEARCH, Answer, flat
from conespot.campaigns.given_names import GivenNames
from conespot.localize.distance import Alarm

_HEAD = ("frame", "tip x, y, z [mm]", "sigma [um]", "axis x, y, z", "nearest wall [mm]", "along axis [mm]")


class Table:
    """For people: a line a frame, as wide as a terminal."""

    def __init__(self, alarm: Alarm | None, names: GivenNames, *, states: bool = False) -> None:
        """With `states` those of a tracker have a column."""
        self._alarm, self._names, self._states = alarm, names, states

    def head(self) -> Iterator[str]:
        """The lines above."""
        if self._alarm is not None:
            yield (
                f"safe: farther than {self._alarm.least_mm:g} mm from the wall, false with a chance of"
                f" {self._alarm.false_safe:g} by the stated sigma; a refused frame is not safe. {RESEARCH}"
            )
        yield self._line(*_HEAD, self._last("state" if self._states else "", "" if self._alarm is None else "safe"))

    def line(self, answer: Answer) -> str:
        """A frame's line."""
        name = self._names.of(answer.frame)
        row = flat(answer)
        state = row.get("state", "")
        safe = {"": "", "yes": "safe", "no": "NOT SAFE"}[row["safe"]]
        if row["status"] != "localized":
            coasting = f" ({state})" if answer.tracked else ""
            return f"{_cut(name)} {row['status']}{coasting}: {row['reason']}{f' ({safe})' if safe else ''}"
        tip = " ".join(f"{row[key]:8.4f}" for key in ("x_mm", "y_mm", "z_mm"))
        axis = " ".join(f"{row[key]:7.4f}" for key in ("axis_x", "axis_y", "axis_z"))
        sigma = "" if row["sigma_x_mm"] == "" else f"{1e3 * math.hypot(*(row[f'sigma_{c}_mm'] for c in 'xyz')):.1f}"
        return self._line(
            name, tip, sigma, axis, _within(row, "nearest"), _within(row, "along"), self._last(state, safe)
        )

    @staticmethod
    def _last(state: str, safe: str) -> str:
        return f"{state:8} {safe}" if state else safe

    @staticmethod
    def _line(name: str, tip: str, sigma: str, axis: str, nearest: str, along: str, safe: str) -> str:
        return f"{_cut(name)} {tip:>26} {sigma:>10} {axis:>23} {nearest:>17} {along:>16} {safe}".rstrip()


def _cut(name: str) -> str:
    """A name's end; all of a path, which its beginning tells from another."""
    return f"{name if os.sep in name else name[-28:]:28}"


def _within(row: dict[str, Any], way: str) -> str:
    value, sigma = row[f"{way}_mm"], row[f"sigma_{way}_mm"]
    if value == "":
        return ""
    return f"{value:.4f}" + ("" if sigma == "" else f" +- {sigma:.4f}")
