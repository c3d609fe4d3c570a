"""The distance from the wall where tips are near it: do the stated intervals hold, and is a "safe" ever false.

Research, no safety device.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from statistics import NormalDist
from typing import Any

import numpy as np
import pandas as pd

from conespot.results.columns import DISTANCE
from conespot.results.run import Run
from conespot.results.table import Block, Table, number
from conespot.results.variants import by_axes, split

#: the alarm that is tried [mm], and the chance of a false "safe" that it states
ALARM_MM, FALSE_SAFE = 0.1, 1e-3
#: edges of the distances that are told apart [mm]
_EDGES = (0.0, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)
#: sigmas on either side of a 95 % interval, and above the bound of the alarm
_TWO_SIDED, _ONE_SIDED = NormalDist().inv_cdf(0.975), NormalDist().inv_cdf(1.0 - FALSE_SAFE)
_NEEDED = {
    "true_nearest_mm",
    "est_source_mm",
    *(f"est_{kind}{way}_mm" for kind in ("", "sigma_", "error_") for way in DISTANCE),
}
_NOTES = (
    "held: share of the 95 % intervals that hold the true distance, from the nearest point and along the axis. Safe: "
    f"the one-sided bound of the nearest, less what the source's width may pass for, lies above {ALARM_MM:g} mm, false "
    f"with a chance of {FALSE_SAFE:g} by its sigma; a refused frame is not safe.",
    "False safe: called so with the true tip nearer than that; with the upper end of its 95 % interval, of such frames "
    "(Clopper and Pearson). Research, no safety device.",
)


def near_wall_table(run: Run) -> Table | None:
    """The table of a run whose tips come within a millimetre of the wall and whose distances have sigmas; else None."""
    if run.rows is None or not set(run.rows.frame) >= _NEEDED:
        return None
    rows = run.rows.frame
    if not (rows["true_nearest_mm"] < _EDGES[-1]).any() or not rows["est_sigma_nearest_mm"].notna().any():
        return None
    records: list[dict[str, Any]] = []
    lines: list[tuple[str, ...]] = []
    for variant, part in split(rows, run.rows.group):
        for axes, here in by_axes(part):
            for low, high, some in _by_distance(here):
                found = {"from_mm": low, "to_mm": high, **near_wall(some)}
                records.append({**variant.setting, **axes, **found})
                lines.append((variant.label, f"{low:g} to {high:g}", *_cells(found)))
    header = ("localizer", "distance [mm]", "n", "refused", "held", "held along", "error [um]", "sigma [um]", "safe",
              "false safe", "at most")  # fmt: skip
    return Table(
        "near_wall", "Distance from the wall", pd.DataFrame(records), (Block("", header, tuple(lines), _NOTES),)
    )


def _by_distance(rows: pd.DataFrame) -> Iterator[tuple[float, float, pd.DataFrame]]:
    """Rows between two true distances, and all of them."""
    true = rows["true_nearest_mm"]
    for low, high in itertools.pairwise(_EDGES):
        some = rows[(true >= low) & (true < high)]
        if len(some):
            yield low, high, some
    yield _EDGES[0], _EDGES[-1], rows[true < _EDGES[-1]]


def near_wall(rows: pd.DataFrame) -> dict[str, float]:
    """Numbers of some rows; NaN where nothing was localized."""
    good = rows[rows["status"] == "ok"]
    held = {way: np.abs(good[f"est_error_{way}_mm"]) <= _TWO_SIDED * good[f"est_sigma_{way}_mm"] for way in DISTANCE}
    beyond = good["est_nearest_mm"] - good["est_source_mm"] - _ONE_SIDED * good["est_sigma_nearest_mm"]
    safe = beyond > ALARM_MM
    below = int(np.count_nonzero(rows["true_nearest_mm"] <= ALARM_MM))
    false = int(np.count_nonzero(safe & (good["true_nearest_mm"] <= ALARM_MM)))
    return {
        "n": len(rows),
        "refused": len(rows) - len(good),
        "held_nearest": _share(held["nearest"]),
        "held_along": _share(held["along"]),
        "median_error_mm": float(np.abs(good["est_error_nearest_mm"]).median()),
        "median_sigma_mm": float(good["est_sigma_nearest_mm"].median()),
        "safe": int(np.count_nonzero(safe)),
        "below_alarm": below,
        "false_safe": false,
        "false_safe_at_most": _upper(false, below),
    }


def _share(which: pd.Series[bool]) -> float:
    return float(which.mean()) if len(which) else math.nan


def _upper(hits: int, of: int) -> float:
    """The upper end of the 95 % interval of a share (C. J. Clopper and E. S. Pearson, Biometrika 26:404, 1934)."""
    if of == 0:
        return math.nan
    from scipy.stats import beta

    return 1.0 if hits == of else float(beta.ppf(0.975, hits + 1, of - hits))


def _cells(found: dict[str, float]) -> tuple[str, ...]:
    shares = [_percent(found[name]) for name in ("held_nearest", "held_along")]
    um = [number(1e3 * found[f"median_{name}_mm"]) for name in ("error", "sigma")]
    counts = [f"{found[name]:.0f}" for name in ("n", "refused")]
    false = f"{found['false_safe']:.0f} of {found['below_alarm']:.0f}"
    return (*counts, *shares, *um, f"{found['safe']:.0f}", false, _percent(found["false_safe_at_most"]))


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %" if math.isfinite(share) else "–"
