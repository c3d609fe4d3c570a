"""Error budget and bounds of a scene, where `campaign theory --out RUN` wrote them into the run's folder."""

from __future__ import annotations

import math
from pathlib import Path

import pandas as pd

from conespot.results.rows import read_table
from conespot.results.table import Block, Table, number

_TABLES = {"budget": "Error budget", "bounds": "Cramer-Rao bounds"}
_MOST_LINES, _MOST_WORD = 400, 100


def theory_tables(folder: Path) -> list[Table]:
    """The tables budget.csv and bounds.csv of a folder, as far as they are there. Raises InputError."""
    found = []
    for name, title in _TABLES.items():
        path = folder / f"{name}.csv"
        if path.is_file():
            data = read_table(
                path, _MOST_LINES, text=("quantity", "unit", "rcm", "edge", "localizer", "spotlights")
            ).to_pandas()
            lines = tuple(tuple(_cell(value) for value in row) for row in data.itertuples(index=False))
            header = tuple(str(column)[:_MOST_WORD].replace("_", " ") for column in data)
            found.append(Table(name, title, pd.DataFrame(data), (Block("", header, lines, ()),)))
    return found


def _cell(value: object) -> str:
    if isinstance(value, float):
        return number(value) if math.isfinite(value) else "–"
    return str(value)[:_MOST_WORD]
