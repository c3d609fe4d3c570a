"""Table I: the greatest difference between cone-sphere curve and ellipse, ours beside the paper's."""

from __future__ import annotations

import math
from typing import Any

import pandas as pd

from conespot.results.assumptions import theory_assumptions
from conespot.results.paper_values import NOTES, paper_table_1
from conespot.results.run import VOLUME_COLUMN, Run
from conespot.results.table import Block, Table


def table_1(run: Run) -> Table | None:
    """The table of a run's theory, a line a half angle; None for a run without."""
    if run.theory is None:
        return None
    sets = theory_assumptions()
    records: list[dict[str, Any]] = []
    lines: list[tuple[str, ...]] = []
    for row in run.theory.sort_values("half_angle_deg").to_dict("records"):
        angle, ours = row["half_angle_deg"], row["in_plane_um"]
        known = next((v for a, v in paper_table_1().items() if math.isclose(a, angle)), math.nan)
        numbers = {
            "ours_um": ours,
            "published_um": known,
            "difference_um": ours - known,
            "ratio": ours / known,
            "distance_3d_um": row["distance_3d_um"],
            VOLUME_COLUMN: row.get(VOLUME_COLUMN, math.nan),
        }
        records.append({"half_angle_deg": angle, **numbers, **sets.columns()})
        lines.append((f"{angle:g}", *map(_hundredths, numbers.values())))
    header = ("half angle [deg]", "in plane [um]", "paper", "difference", "ratio", "in 3D [um]", "in 3D, volume [um]")
    block = Block("closed form, no images", header, tuple(lines), (), sets)
    title = "Table I: greatest difference between cone-sphere curve and ellipse"
    return Table("table_1", title, pd.DataFrame(records), (block,), (NOTES["Table I"],))


def _hundredths(value: float) -> str:
    return f"{value:.2f}".replace("-0.00", "0.00") if math.isfinite(value) else "–"
