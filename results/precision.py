"""What the estimators reached, what they said of it, and what no estimator could beat: one line a setting.

A gross error is an accepted result that is off by more than six of its own sigmas and 0.05 mm.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pandas as pd

from conespot.results.assumptions import Assumptions, assumptions, pairs
from conespot.results.columns import TIP_SIGMA
from conespot.results.run import Run
from conespot.results.table import Block, Table, number
from conespot.results.variants import by_axes, split

_MOST_SETS = 40
#: 95 % of chi-squared with three degrees of freedom
_INSIDE = 7.814727903251179
_GROSS_SIGMAS, _GROSS_MM = 6.0, 0.05
_NOTES = (
    "Positions in um, angles in deg; over the frames that were localized. Refused: of the frames that show the whole "
    "patch; outside: of the others.",
    "sigma: median of the stated ones; inside: share of the tips within their 95 % ellipsoid; gross: off by more than "
    "6 sigma + 50 um.",
    "bound: Cramer-Rao over even albedo with what the localizer knows, rms; ratio: rms error over that of the bound.",
)


def precision_table(run: Run) -> Table | None:
    """The table of a run in which a localizer states its sigmas; None if there is none."""
    if run.rows is None or not {*TIP_SIGMA, "est_chi2_tip", "true_in_frame"} <= set(run.rows.frame):
        return None
    records: list[dict[str, Any]] = []
    lines: list[tuple[str, ...]] = []
    sets: dict[Assumptions, list[str]] = {}
    for variant, part in split(run.rows.frame, run.rows.group):
        for axes, here in by_axes(part):
            found = precision(here)
            assumed = assumptions(run.cases, pairs(here))
            records.append({**variant.setting, **axes, **found, **assumed.columns()})
            of = sets.setdefault(assumed, [])
            if variant.label not in of:
                of.append(variant.label)
            place = " ".join(str(axes[name]) for name in ("trajectory", "spotlights", "surface"))
            lines.append((variant.label, place, f"{axes['power_w']:g}", *_cells(found)))
    reached = ("mean", "rms", "max", "axis", "roll")
    header = ("localizer", "frames", "power [W]", "n", "refused", "outside", *reached, "sigma", "inside", "gross",
              "bound", "ratio")  # fmt: skip
    assumes = tuple(f"{' and '.join(labels)}: assumes {one.sentence()}." for one, labels in sets.items())
    block = Block("", header, tuple(lines), (*_NOTES, *assumes[:_MOST_SETS]))
    return Table("precision", "Precision: reached, stated, and possible", pd.DataFrame(records), (block,))


def precision(rows: pd.DataFrame) -> dict[str, float]:
    """Numbers of the rows of one setting [mm, deg]; NaN where nothing was localized or stated."""
    good = rows[rows["status"] == "ok"]
    error = good["position_error_mm"].to_numpy()
    sigma = np.sqrt(np.sum(np.square(good[list(TIP_SIGMA)].to_numpy()), axis=1))
    stated = np.isfinite(sigma)
    chi2 = good["est_chi2_tip"].to_numpy()[stated]
    roll = _column(good, "est_roll_error_deg")
    rms, bound = _rms(error), _rms(_column(good, "est_bound_mm"))
    failed = rows[rows["status"] == "failed"]
    whole = int(np.count_nonzero(failed["true_in_frame"] >= 1.0))
    return {
        "n": len(good),
        "refused": whole,
        "outside": len(failed) - whole,
        "mean_mm": _mean(error),
        "rms_mm": rms,
        "max_mm": float(error.max()) if len(error) else math.nan,
        "mean_axis_deg": _mean(good["axis_error_deg"].to_numpy()),
        "mean_roll_deg": _mean(np.abs(roll)),
        "sigma_mm": float(np.median(sigma[stated])) if stated.any() else math.nan,
        "inside_95": float(np.mean(chi2 <= _INSIDE)) if len(chi2) else math.nan,
        "gross": int(np.count_nonzero(error[stated] > _GROSS_SIGMAS * sigma[stated] + _GROSS_MM)),
        "bound_mm": bound,
        "over_bound": rms / bound if bound > 0.0 else math.nan,
    }


def _cells(found: dict[str, float]) -> tuple[str, ...]:
    um = {name: number(1e3 * found[f"{name}_mm"]) for name in ("mean", "rms", "max", "sigma", "bound")}
    inside = f"{100.0 * found['inside_95']:.0f} %" if math.isfinite(found["inside_95"]) else "–"
    angles = (number(found["mean_axis_deg"]), number(found["mean_roll_deg"]))
    counts = [f"{found[name]:.0f}" for name in ("n", "refused", "outside")]
    reached = (um["mean"], um["rms"], um["max"], *angles)
    return (*counts, *reached, um["sigma"], inside, f"{found['gross']:.0f}", um["bound"], number(found["over_bound"]))


def _column(rows: pd.DataFrame, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    values = rows[name].to_numpy(float) if name in rows else np.zeros(0)
    return values[np.isfinite(values)]


def _mean(values: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    return float(np.mean(values)) if len(values) else math.nan


def _rms(values: np.ndarray[Any, np.dtype[np.float64]]) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if len(values) else math.nan
