"""`campaign theory`: how well a scene could be localized, without rendering a frame."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from conespot.campaigns.schema import override, setting
from conespot.scene import InputError, Scene
from conespot.scene.document import Document, find_document, read_document
from conespot.scene.scene import read_scene


def described_scene(name: str, settings: Sequence[str]) -> Scene:
    """The scene of a preset or file with `scene.KEY=VALUE` settings on it. Raises InputError."""
    document = read_document(find_document(name, "scene", "presets", "scene preset"))
    lines = {("scene", *path): line for path, line in document.lines.items()}
    document = Document(document.source, {"scene": document.data}, lines, document.folder)
    for text in settings:
        key, value = setting(text)
        if not key.startswith("scene."):
            raise InputError(f"--set {key}: the theory is about a scene alone; set a key such as scene.eye.radius")
        document = override(document, key, value, f"--set {key}")
    return read_scene(document, at=("scene",))


def write_theory_of(name: str, settings: Sequence[str], out: str | None) -> tuple[Path, str]:
    """Assess a scene and write what is found: the folder, and the text of its tables. Raises InputError."""
    from conespot.localize.theory.assessment import assess
    from conespot.results.theory_tables import write_theory_tables

    scene = described_scene(name, settings)
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
