"""Two runs, setting by setting: the settings that both have, their mean errors, and whether these differ.

Settings are matched by what varies within a run: what is one thing in each of them, such as the light of either, is
what the runs compare. On the same poses errors are paired, and z is that of the mean difference; else z is Welch's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import norm

from conespot.results.columns import TRUE_TIP
from conespot.results.rows import Rows
from conespot.results.run import Run
from conespot.results.variants import named, ordered
from conespot.scene import InputError

ERROR = "position_error_mm"
_LEVEL = 0.05
#: tips nearer than this [mm] are the same pose
_SAME_MM = 1e-6
_MOST_VALUES = 6
#: a column that is alike in all rows, so that there is always one to match by
_ALL = "all rows"


@dataclass(frozen=True)
class SideBySide:
    """A run beside the reference.

    `table` has a line for each setting of both: `keys`, then n, failed, mean and median of either with the suffixes _a
    (the reference) and _b [mm], `ratio`, `difference` [mm], `z` and whether the frames are `paired`. `alone` counts the
    settings that only one of them has.
    """

    keys: tuple[str, ...]
    table: pd.DataFrame
    alone: tuple[int, int]

    @property
    def bar(self) -> float:
        """The |z| that one of as many settings passes by chance in 5 % (Z. Sidak, JASA 62:626, 1967)."""
        return float(norm.isf((1.0 - (1.0 - _LEVEL) ** (1.0 / max(len(self.table), 1))) / 2.0))

    def sentence(self, a: str, b: str) -> str:
        """What differs, in a sentence with its numbers."""
        z = self.table["z"].to_numpy(float)
        tested = int(np.isfinite(z).sum())
        better, worse = int((z < -self.bar).sum()), int((z > self.bar).sum())
        ratio = self.table["ratio"].to_numpy(float)
        middle = float(np.median(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else math.nan
        of = f"{len(self.table)} settings of both" if len(self.table) > 1 else "the one setting of both"
        verdict = f"{b} is better than {a} in {better} and worse in {worse}"
        if not better and not worse:
            verdict = f"nothing tells {b} from {a}"
        ratios = f"; its mean tip error is {middle:.3g} times that of {a} (median over the settings)"
        return f"Of {of}, {tested} tested: {verdict} (|z| > {self.bar:.2f}){ratios if math.isfinite(middle) else ''}."


def side_by_side(a: Run, b: Run) -> SideBySide:
    """Lay a run beside the reference `a`. Raises InputError where no setting of one is a setting of the other."""
    first, second = _rows(a), _rows(b)
    keys = _keys(first, second)
    on = [*keys, _ALL]
    here, there = first.frame.assign(**{_ALL: 0}), second.frame.assign(**{_ALL: 0})
    left, right = _summed(here, on), _summed(there, on)
    table = left.merge(right, on=on, suffixes=("_a", "_b"))
    if table.empty:
        raise InputError(_nothing(a, b, first, second, keys))
    alone = len(left) - len(table), len(right) - len(table)
    table["ratio"] = table["mean_b"] / table["mean_a"]
    table["difference"] = table["mean_b"] - table["mean_a"]
    spread = np.sqrt(table["var_a"] / table["n_a"] + table["var_b"] / table["n_b"])
    table["z"] = (table["difference"] / spread).where(spread > 0.0)
    table["paired"] = False
    pairs = _paired(here, there, on)
    if pairs is not None:
        table = table.merge(pairs, on=on, how="left")
        same = table["same"].eq(True) & (table["pairs"] > 1) & (table["spread"] > 0.0)
        table["paired"] = same
        table["z"] = table["z"].where(~same, table["change"] / table["spread"])
    kept = [*keys, *(f"{name}_{side}" for name in ("n", "failed", "mean", "median") for side in "ab")]
    return SideBySide(keys, table[[*kept, "ratio", "difference", "z", "paired"]], alone)


def _rows(run: Run) -> Rows:
    if run.rows is None:
        raise InputError(f"{run.folder}: holds theory alone, which has no rows to lay beside others")
    return run.rows


def _keys(a: Rows, b: Rows) -> tuple[str, ...]:
    """What varies within one of the runs, of the columns of both."""
    both = [name for name in a.group if name in b.group]
    return tuple(name for name in both if a.frame[name].nunique() > 1 or b.frame[name].nunique() > 1)


def _summed(frame: pd.DataFrame, on: list[str]) -> pd.DataFrame:
    """n, failed, mean, variance and median of the tip's error for each setting."""
    ok = frame["status"] == "ok"
    groups = frame[on].assign(failed=~ok, error=frame[ERROR].where(ok)).groupby(on, sort=True)
    found = groups["error"].agg(n="count", mean="mean", var="var", median="median")
    return found.assign(failed=groups["failed"].sum().astype(int)).reset_index()


def _paired(a: pd.DataFrame, b: pd.DataFrame, on: list[str]) -> pd.DataFrame | None:
    """Mean difference and its standard error over the poses that both localized; None where a pose has several frames.

    `same` tells whether the tips are the same.
    """
    frames = [*on, "pose"]
    if a.duplicated(frames).any() or b.duplicated(frames).any():
        return None
    needed = [*frames, "status", ERROR, *TRUE_TIP]
    both = a[needed].merge(b[needed], on=frames, suffixes=("_a", "_b"))
    off = np.max([np.abs(both[f"{axis}_a"] - both[f"{axis}_b"]) for axis in TRUE_TIP], axis=0)
    good = (both["status_a"] == "ok") & (both["status_b"] == "ok")
    change = (both[f"{ERROR}_b"] - both[f"{ERROR}_a"]).where(good)
    groups = both[on].assign(change=change, same=off < _SAME_MM).groupby(on, sort=True)
    found = groups["change"].agg(pairs="count", change="mean", spread="sem")
    return found.assign(same=groups["same"].all()).reset_index()


def _nothing(a: Run, b: Run, first: Rows, second: Rows, keys: tuple[str, ...]) -> str:
    """Why no setting is one of both."""
    start = f"{a.folder} and {b.folder} have no setting in common"
    for name in keys:
        here, there = ordered(first.frame[name]), ordered(second.frame[name])
        if not set(here) & set(there):
            return f"{start}: {_values(name, here)} against {_values(name, there)}; lay runs side by side that share it"
    return f"{start}: each value is in both, but no combination of {', '.join(keys)} is"


def _values(name: str, values: list[object]) -> str:
    said = ", ".join(named(name, value) for value in values[:_MOST_VALUES])
    return f"{name} {said}{' ...' if len(values) > _MOST_VALUES else ''}"
