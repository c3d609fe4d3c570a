"""The white level: which radiance the authors' frames show as white, found from one cell of Table IV.

P watts shown with white at W are one watt shown with white at W / P (over the same grey of the background), so a sweep
over powers beyond the paper's 1 W is a sweep over white levels, and the mean error falls along it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from conespot.results.assumptions import Cases, assumptions, pairs
from conespot.results.paper_values import FITTED, REFERENCE_POWER_W, paper_value
from conespot.results.run import Run
from conespot.results.table import Block, Table
from conespot.results.variants import split
from conespot.scene.quantity import FROM_FILE, Radiance

Array = NDArray[np.float64]

#: the paper prints three decimals [mm]
_ROUNDING = 0.0005
_RESAMPLES = 2000
_NOTE = (
    "The white level at which 1 W makes the published mean, by a parabola in log power through the mean errors. "
    "'rounding' is what the published digits leave open; 'poses' holds 68 % of the answers of 2000 draws of as many "
    "poses, with replacement: the error of a pose is mostly where its outline falls among whole pixels, so another "
    "pixel grid is another draw."
)


@dataclass(frozen=True)
class WhiteLevel:
    """The radiance that shows as white [W/m2/sr], what rounding leaves of it, and 68 % of it over draws of poses."""

    value: float
    rounding: tuple[float, float]
    poses: tuple[float, float]


def white_level(errors: Array, powers: Array, white: float, target: float) -> WhiteLevel | None:
    """The white level that explains a mean error `target` [mm] at 1 W; None if no power reaches it.

    `errors` `[poses, P]` [mm] are those at `powers` `[P]` [W], NaN where not localized, with `white` [W/m2/sr].
    """
    value = _explains(np.nanmean(errors, axis=0), powers, white, target)
    if value in (0.0, math.inf):
        return None
    ends = [_explains(np.nanmean(errors, axis=0), powers, white, target + s * _ROUNDING) for s in (-1.0, 1.0)]
    rng = np.random.default_rng(20230601)
    draws = rng.integers(0, len(errors), (_RESAMPLES, len(errors)))
    found = [_explains(np.nanmean(errors[draw], axis=0), powers, white, target) for draw in draws]
    low, high = np.percentile(found, [16.0, 84.0], method="nearest")
    return WhiteLevel(value, (min(ends), max(ends)), (float(low), float(high)))


def _explains(means: Array, powers: Array, white: float, target: float) -> float:
    """`white` over the power at which the fitted mean error first falls to `target`.

    0 if all these powers are too little for that, infinite if all are too much.
    """
    middle = float(np.mean(np.log(powers)))
    curve = np.polynomial.Polynomial.fit(np.log(powers) - middle, means, 2)
    fine = np.linspace(np.log(powers.min()), np.log(powers.max()), 2001)
    over = curve(fine - middle) > target
    if over.all() or not over[0]:
        return 0.0 if over.all() else math.inf
    return white / math.exp(fine[int(np.argmin(over))])


def white_table(run: Run) -> Table | None:
    """The fit for each variant whose powers go beyond the paper's; None for a run without one."""
    if run.rows is None or run.rows.frame["power_w"].max() <= REFERENCE_POWER_W:
        return None
    source, trajectory, rig, quantity, metric = FITTED
    target = paper_value(*FITTED)
    assert target is not None
    records: list[dict[str, Any]] = []
    lines: list[tuple[str, ...]] = []
    for variant, part in split(run.rows.frame, run.rows.group):
        cell = part[(part["trajectory"] == trajectory) & (part["spotlights"] == rig) & (part["surface"] == "smooth")]
        errors = cell.pivot_table(index="pose", columns="power_w", values=metric)
        white = _white(run.cases, cell)
        if white is None or errors.shape[1] < 3:
            continue
        found = white_level(errors.to_numpy(float), errors.columns.to_numpy(float), white, target)
        if found is None:
            continue
        numbers = (found.value, *found.rounding, *found.poses)
        names = ("white_w_m2_sr", "rounding_low", "rounding_high", "poses_low", "poses_high")
        where = {"source": source, "trajectory": trajectory, "spotlights": rig, "quantity": quantity, "metric": metric}
        columns = assumptions(run.cases, pairs(cell)).columns()
        records.append(
            {**variant.setting, **where, "published": target, **dict(zip(names, numbers, strict=True)), **columns}
        )
        ranges = (
            f"{found.rounding[0]:.2f} to {found.rounding[1]:.2f}",
            f"{found.poses[0]:.2f} to {found.poses[1]:.2f}",
        )
        lines.append(
            (variant.label, f"{source}, {trajectory}, {rig}, {quantity}", f"{target:g}", f"{found.value:.3f}", *ranges)
        )
    header = ("localizer", "fitted to", "published [mm]", "white [W/m2/sr]", "rounding", "poses, 68 %")
    title = "White level: the radiance that the authors' frames show as white"
    return Table("white", title, pd.DataFrame(records), (Block("", header, tuple(lines), (_NOTE,)),)) if lines else None


def _white(cases: Cases, rows: pd.DataFrame) -> float | None:
    """The white level of the rows' cases [W/m2/sr]; None if they do not state it, or not the same."""
    found = {_stated(cases[key].scene) if key in cases else None for key in rows["case"].unique()}
    return found.pop() if len(found) == 1 else None


def _stated(scene: dict[str, Any]) -> float | None:
    sensor = scene.get("sensor")
    try:
        white = sensor.get("white") if isinstance(sensor, dict) else None
        return float(TypeAdapter(Radiance).validate_python(white, context={FROM_FILE: True}))
    except ValidationError:
        return None
