"""The tables a run has rows for: ours, published, ratio, n, failed, and the assumption set beside them."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from conespot.results.check import expectation_table
from conespot.results.error_tables import ERROR_TABLES, POWER, cells
from conespot.results.near_wall import near_wall_table
from conespot.results.precision import precision_table
from conespot.results.reality_gap import reality_table
from conespot.results.released import released_table
from conespot.results.run import Run
from conespot.results.table import Table
from conespot.results.table_1 import table_1
from conespot.results.white import white_table

#: tables that need no boxes, before and after those of errors, by the name of their file
_FIRST: dict[str, Callable[[Run], Table | None]] = {"table_1": table_1, "reality_gap": reality_table}
_LAST: dict[str, Callable[[Run], Table | None]] = {
    "precision": precision_table,
    "near_wall": near_wall_table,
    "white": white_table,
    "released": released_table,
    "expectations": expectation_table,
}

#: every table there can be: tables/NAME.csv
TABLE_NAMES = (*_FIRST, *(kind.name for kind in ERROR_TABLES), *_LAST)


def make_tables(run: Run, boxes: pd.DataFrame | None) -> list[Table]:
    """Every table that the run has rows for, I, IV, V, errors by power and more, and what its campaign expects."""
    first, last = ({name: make(run) for name, make in some.items()} for some in (_FIRST, _LAST))
    of_errors: list[Table | None] = []
    if run.rows is not None and boxes is not None:
        parts = cells(run, boxes)
        # where estimators state sigmas the precision table tells more of a single power
        told = last["precision"] is not None and run.rows.frame["power_w"].nunique() == 1
        of_errors = [kind.table(run, parts) for kind in ERROR_TABLES if not (told and kind is POWER)]
    return [table for table in (*first.values(), *of_errors, *last.values()) if table is not None]
