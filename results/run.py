"""A run folder, read: the resolved campaign, its cases, its rows, and the theory table if there is one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from conespot.results.cases import Case, read_cases
from conespot.results.columns import SETTING
from conespot.results.rows import Rows, find_rows, number_column, read_rows, read_table
from conespot.scene import InputError
from conespot.scene.document import Document, read_document

THEORY_COLUMNS = ("half_angle_deg", "in_plane_um", "distance_3d_um")
#: the greatest distance over the whole volume, which a run may give too
VOLUME_COLUMN = "volume_distance_3d_um"


@dataclass(frozen=True)
class Run:
    """What a run folder holds, validated.

    `rows.frame` is a table with a row a frame and localizer (conespot.results.columns says what its columns mean),
    `cases` what the run says of each case of `rows.frame["case"]`, `theory` Table I. `rows` or `theory` may be None,
    not both; `cases` is empty where the run describes none, as in version 0.1.0.
    """

    folder: Path
    document: Document
    rows: Rows | None
    theory: pd.DataFrame | None
    cases: Mapping[str, Case] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The campaign's name, or the folder's."""
        named = self.document.data.get("name")
        return named if isinstance(named, str) and 0 < len(named) <= 200 else self.folder.resolve().name

    @property
    def scene(self) -> dict[str, Any]:
        """The scene of the resolved campaign as plain data, before anything is swept; `cases` have each their own."""
        scene = self.document.data.get("scene")
        return scene if isinstance(scene, dict) else {}


def load_run(folder: str | Path) -> Run:
    """Read and validate a run folder, one's own or somebody else's. Raises InputError."""
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such run folder; `campaign run NAME --out {folder}` makes one")
    resolved = folder / "campaign.yaml"
    if not resolved.is_file():
        raise InputError(f"{folder}: no campaign.yaml, so nothing says what the rows assume; copy the whole run folder")
    document = read_document(resolved)
    cases = read_cases(folder)
    path = find_rows(folder)
    rows = read_rows(path, [*_swept(document), *_swept_labels(cases)]) if path else None
    theory = folder / "theory.csv"
    table = _read_theory(theory) if theory.is_file() else None
    if table is None and (rows is None or len(rows) == 0):
        raise InputError(f"{folder}: holds no finished rows (errors.parquet or errors.csv); run the campaign first")
    return Run(folder, document, rows if rows is not None and len(rows) else None, table, cases)


def _swept(document: Document) -> list[str]:
    """The keys under `sweep`, which holds one product (a mapping) or a list of them."""
    sweep = document.data.get("sweep")
    products = sweep if isinstance(sweep, list) else [sweep]
    return [key for product in products if isinstance(product, dict) for key in product]


def _swept_labels(cases: Mapping[str, Case]) -> list[str]:
    """The labels that no standing column holds."""
    return list(dict.fromkeys(name for case in cases.values() for name in case.labels if name not in SETTING))


def _read_theory(path: Path) -> pd.DataFrame:
    """Cone-sphere curve against ellipse by half angle: `THEORY_COLUMNS` and `VOLUME_COLUMN`. Raises InputError."""
    table = read_table(path, 10_000)
    missing = [name for name in THEORY_COLUMNS if name not in table.column_names]
    if missing:
        raise InputError(f"{path}: no column {', '.join(missing)}; Table I needs {', '.join(THEORY_COLUMNS)}")
    names = [name for name in (*THEORY_COLUMNS, VOLUME_COLUMN) if name in table.column_names]
    frame = pd.DataFrame({name: number_column(table, name, path) for name in names})
    if frame.empty or not np.isfinite(frame.to_numpy()).all() or (frame < 0.0).to_numpy().any():
        raise InputError(f"{path}: every value must be a non-negative number, and there must be a row")
    return frame
