"""The authors' 100 released estimates against ours on the same spiral: how large the errors are, and along what."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from pydantic import TypeAdapter, ValidationError

from conespot.results.assumptions import assumptions, pairs
from conespot.results.paper_values import paper_released
from conespot.results.run import Run
from conespot.results.table import Block, Table, number
from conespot.results.variants import by_axes, split
from conespot.scene import Eye, Pose
from conespot.scene.quantity import FROM_FILE
from conespot.scene.spotlights import Instrument

_NOTES = (
    "Position errors in mm, one spotlight. 'offset', 'slope' and 'residual' are those of the line offset + slope x "
    "distance through the errors of the distance from the tip to the retina along the axis.",
    "A slope of -0.00361 is that of a cone of 8.968 deg that is taken for one of 9 deg.",
)


def released_table(run: Run) -> Table | None:
    """The comparison for each variant and power on the authors' spiral over a smooth retina; None without such rows."""
    if run.rows is None:
        return None
    records: list[dict[str, Any]] = []
    lines: list[tuple[str, ...]] = []
    frame = run.rows.frame
    if not (frame["trajectory"] == "spiral").any():
        return None
    for variant, part in split(frame, run.rows.group):
        alike = (part["trajectory"] == "spiral") & (part["spotlights"] == "single") & (part["surface"] == "smooth")
        for axes, here in by_axes(part[alike]):
            good = here[here["status"] == "ok"]
            scene = _geometry(run, here)
            if scene is None or len(good) < 3 or not _theirs(here):
                continue
            ours = statistics(good, *scene)
            counts = {"n": len(good), "failed": len(here) - len(good)}
            columns = assumptions(run.cases, pairs(here)).columns()
            for name, known in paper_released().items():
                compared = {"statistic": name, "ours": ours[name], "published": known, "ratio": ours[name] / known}
                records.append({**variant.setting, **axes, **compared, **counts, **columns})
                cells = (number(ours[name]), number(known), number(ours[name] / known))
                lines.append((variant.label, f"{axes['power_w']:g}", str(len(good)), name, *cells))
    header = ("localizer", "power [W]", "n", "statistic", "ours", "released", "ratio")
    title = "The authors' released estimates: a spiral, one spotlight"
    return (
        Table("released", title, pd.DataFrame(records), (Block("", header, tuple(lines), _NOTES),)) if lines else None
    )


def statistics(good: pd.DataFrame, eye: Eye, instrument: Instrument) -> dict[str, float]:
    """What the authors' estimates were summarized by, of localized rows [mm]; the slope is per mm of distance."""
    error = good["position_error_mm"].to_numpy(float)
    true = good[["true_x_mm", "true_y_mm", "true_z_mm"]].to_numpy(float)
    offset = good[["error_x_mm", "error_y_mm", "error_z_mm"]].to_numpy(float)
    axis = np.array([Pose.through(tip, instrument.rcm).axis for tip in true])
    distance = eye.intersect(true, axis)
    short = -np.sum(offset * axis, axis=1)
    slope, at_zero = np.polyfit(distance, short, 1)
    residual = np.std(short - at_zero - slope * distance, ddof=2)
    return {
        "mean": float(error.mean()),
        "median": float(np.median(error)),
        "95 %": float(np.percentile(error, 95.0)),
        "largest": float(error.max()),
        "offset": float(at_zero),
        "slope": float(slope),
        "residual": float(residual),
    }


def _theirs(rows: pd.DataFrame) -> bool:
    """Whether the tips lie on the authors' spiral: 0.1 mm a radian outwards, from 2 mm on 5 mm up in five turns."""
    x, y, z = rows[["true_x_mm", "true_y_mm", "true_z_mm"]].to_numpy(float).T
    angle = 2.0 * np.pi * (z - 2.0)
    off = np.hypot(x - 0.1 * angle * np.cos(angle), y - 0.1 * angle * np.sin(angle))
    return bool(np.all(off < 1e-3))


def _geometry(run: Run, rows: pd.DataFrame) -> tuple[Eye, Instrument] | None:
    """Eye and instrument of the rows' first case; None where it is not described."""
    case, context = run.cases.get(rows["case"].iloc[0]), {FROM_FILE: True}
    if case is None:
        return None
    try:
        eye = TypeAdapter(Eye).validate_python(case.scene.get("eye", {}), context=context)
        return eye, TypeAdapter(Instrument).validate_python(case.scene.get("instrument", {}), context=context)
    except ValidationError:
        return None
