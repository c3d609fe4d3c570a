"""`campaign theory`: how well a scene could be localized, without rendering a frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from conespot.campaigns.own_scene import described_scene
from conespot.scene import InputError


def write_theory_of(name: str, settings: Sequence[str], out: str | None) -> tuple[Path, str]:
    """Assess a scene and write what is found: the folder, and the text of its tables. Raises InputError."""
    from conespot.localize.theory.assessment import assess
    from conespot.results.theory_tables import write_theory_tables

    scene, _ = described_scene(name, settings, "the theory")
    folder = Path(out or Path("runs") / f"theory-{Path(name).stem}")
    if folder.is_file():
        raise InputError(f"{folder}: is a file, not a folder; choose another --out")
    found = assess(scene)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror}; choose another --out") from None
    tables = {"table_1": found.table_1, "bounds": found.bounds, "budget": found.budget, "design": found.design}
    return folder, write_theory_tables(folder, tables, name, found.assumes)
