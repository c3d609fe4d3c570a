"""Two lights on the same poses: paired differences of an error, what they prove, and failures on either side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import binomtest, wilcoxon

from conespot.results.columns import SETTING
from conespot.results.rows import Rows
from conespot.scene import InputError

METRIC = "position_error_mm"
#: below this many pairs no test can tell (Wilcoxon's smallest p for 5 pairs is 0.06)
FEWEST_PAIRS = 6
_LEVEL = 0.05
_RESAMPLES = 4000
#: numbers drawn in one go: bounds the memory
_AT_ONCE = 2_000_000
#: columns that say what a frame is apart from its light, to which the sensor belongs, and its power
_FRAME = tuple(name for name in SETTING if name not in ("illumination", "sensor", "power_w", "localizer"))


@dataclass(frozen=True)
class Difference:
    """Errors of two lights, `a` the reference, on poses where both localized. Lengths in mm; NaN without pairs."""

    pairs: int
    failed_a: int
    failed_b: int
    poses: int
    median_a: float
    median_b: float
    median: float  #: of the paired differences b - a
    low: float  #: bootstrap 95 % interval of it
    high: float
    p: float  #: Wilcoxon's signed-rank test, two-sided
    p_failures: float  #: exact sign test on the frames that only one of them localized

    @property
    def tells(self) -> bool:
        """Whether the pairs prove a difference: enough of them, p below 5 % and an interval without 0."""
        return self.pairs >= FEWEST_PAIRS and self.p < _LEVEL and not self.low <= 0.0 <= self.high


@dataclass(frozen=True)
class Comparison:
    """Two lights compared for one localizer. `table` holds a line per trajectory, spotlights, surface and power."""

    a: str
    b: str
    localizer: str
    table: pd.DataFrame
    overall: Difference  #: a pose counts once, with its median difference over the powers
    swept: tuple[str, ...] = ()  #: what else is swept alike in both lights, columns of `table`

    @property
    def sentence(self) -> str:
        """The answer in one sentence with its numbers, or that the data cannot tell, and why."""
        d = self.overall
        failures = f"failures {d.failed_b} with {self.b}, {d.failed_a} with {self.a}, of {d.poses} frames each"
        if d.pairs < FEWEST_PAIRS:
            pairs = f"only {d.pairs} poses were localized in both lights ({FEWEST_PAIRS} are the least)"
            return f"{self.localizer}: the data cannot tell {self.b} from {self.a}: {pairs}; {failures}."
        numbers = (
            f"median difference {_um(d.median)} um, 95 % interval {_um(d.low)} to {_um(d.high)} um, Wilcoxon p = "
            f"{d.p:.2g}, {d.pairs} poses"
        )
        medians = f"(medians {_um(d.median_b, plus=False)} against {_um(d.median_a, plus=False)} um)"
        if not d.tells:
            verdict = f"the data cannot tell {self.b} from {self.a} {medians}"
        else:
            verdict = f"{self.b} localizes {'better' if d.median < 0.0 else 'worse'} than {self.a} {medians}"
        more = ""
        if d.p_failures < _LEVEL:
            more = (
                f", and {self.b} fails {'less' if d.failed_b < d.failed_a else 'more'} often (p = {d.p_failures:.2g})"
            )
        return f"{self.localizer}: {verdict}: {numbers}; {failures}{more}."


def compare_lights(rows: Sequence[Rows], a: str, b: str, source: str) -> list[Comparison]:
    """Compare the lights `a` (reference) and `b`, pairing the rows of equal settings, powers and poses.

    Raises InputError, which names `source`, for a light that no row has, rows that do not pair and other poses.
    """
    frame = pd.concat([r.frame for r in rows], ignore_index=True)
    swept = sorted({name for r in rows for name in r.swept})
    lights = list(dict.fromkeys(frame["illumination"]))
    for name in (a, b):
        if name not in lights:
            raise InputError(f"{source}: no frames in the light '{name}'; there are {', '.join(map(str, lights))}")
    sides = [frame[frame["illumination"] == name] for name in (a, b)]
    # a key that is swept along with the light (its ambient light, its camera) belongs to the light
    shared = [c for c in swept if c in sides[0] and set(sides[0][c].astype(str)) == set(sides[1][c].astype(str))]
    keys = [*_FRAME, "localizer", *shared, "power_w", "pose"]
    for name, side in zip((a, b), sides, strict=True):
        if side.duplicated(keys).any():
            raise InputError(f"{source}: {name} has several frames of one pose and power; compare one camera at a time")
    both = sides[0].merge(sides[1], on=keys, suffixes=("_a", "_b"), validate="one_to_one")
    if both.empty:
        raise InputError(f"{source}: no pose and power was rendered in both {a} and {b}")
    moved = max(float(np.max(np.abs(both[f"true_{x}_mm_a"] - both[f"true_{x}_mm_b"]))) for x in "xyz")
    if not moved < 1e-6:
        raise InputError(
            f"{source}: the poses in {a} and {b} differ by {moved:.3g} mm; only the same poses can be paired"
        )
    groups = [*_FRAME, *shared, "power_w"]
    found = []
    for localizer, mine in both.groupby("localizer", sort=False):
        lines = []
        for values, here in mine.groupby(groups, sort=False):
            lines.append({**dict(zip(groups, values, strict=True)), **vars(difference(here))})
        overall = _overall(mine, [*_FRAME, *shared, "pose"])
        found.append(Comparison(a, b, str(localizer), pd.DataFrame(lines), overall, tuple(shared)))
    return found


def difference(pairs: pd.DataFrame) -> Difference:
    """The paired difference over frames that stand side by side (columns with the suffixes `_a` and `_b`)."""
    ok_a, ok_b = pairs["status_a"] == "ok", pairs["status_b"] == "ok"
    both = pairs[ok_a & ok_b]
    first, second = (both[f"{METRIC}_{side}"].to_numpy(float) for side in "ab")
    return _tested(first, second, pairs, int((ok_a & ~ok_b).sum()), int((ok_b & ~ok_a).sum()))


def _overall(pairs: pd.DataFrame, pose: list[str]) -> Difference:
    """One difference a pose, the median over its powers: frames of one pose are not independent."""
    ok = (pairs["status_a"] == "ok") & (pairs["status_b"] == "ok")
    medians = pairs[ok].groupby(pose, sort=False)[[f"{METRIC}_a", f"{METRIC}_b"]].agg("median")
    change = pairs[ok].assign(change=pairs[f"{METRIC}_b"] - pairs[f"{METRIC}_a"]).groupby(pose, sort=False)["change"]
    first = medians[f"{METRIC}_a"].to_numpy(float)
    alone = pairs.assign(
        a=((pairs["status_a"] == "ok") & (pairs["status_b"] != "ok")).astype(int),
        b=((pairs["status_b"] == "ok") & (pairs["status_a"] != "ok")).astype(int),
    ).groupby(pose, sort=False)[["a", "b"]]
    lead = (alone.sum()["a"] - alone.sum()["b"]).to_numpy()
    found = _tested(first, first + change.median().to_numpy(float), pairs, int((lead > 0).sum()), int((lead < 0).sum()))
    return Difference(**{**vars(found), "median_b": _median(medians[f"{METRIC}_b"].to_numpy(float))})


def _tested(
    first: NDArray[np.float64], second: NDArray[np.float64], pairs: pd.DataFrame, only_a: int, only_b: int
) -> Difference:
    change = second - first
    low, high = interval(change)
    return Difference(
        pairs=len(change),
        failed_a=int((pairs["status_a"] != "ok").sum()),
        failed_b=int((pairs["status_b"] != "ok").sum()),
        poses=len(pairs),
        median_a=_median(first),
        median_b=_median(second),
        median=_median(change),
        low=low,
        high=high,
        p=float(wilcoxon(change).pvalue) if np.any(change != 0.0) else 1.0,
        p_failures=float(binomtest(only_a, only_a + only_b).pvalue) if only_a + only_b else 1.0,
    )


def interval(change: NDArray[np.float64]) -> tuple[float, float]:
    """The 95 % percentile bootstrap interval of the median of `change` `[N]`; the same for the same data."""
    if not len(change):
        return math.nan, math.nan
    rng = np.random.default_rng(20230601)
    at_once = max(1, _AT_ONCE // len(change))
    medians = [
        np.median(change[rng.integers(0, len(change), (min(at_once, _RESAMPLES - first), len(change)))], axis=1)
        for first in range(0, _RESAMPLES, at_once)
    ]
    low, high = np.percentile(np.concatenate(medians), [2.5, 97.5])
    return float(low), float(high)


def _median(values: NDArray[np.float64]) -> float:
    return float(np.median(values)) if len(values) else math.nan


def _um(value_mm: float, *, plus: bool = True) -> str:
    return f"{1e3 * value_mm:{'+' if plus else ''}.3g}"
