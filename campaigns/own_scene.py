"""A scene of one's own as the commands take it: a preset or a file, with settings on it, and how well it is known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from conespot.campaigns.knowledge import Knowledge
from conespot.campaigns.schema import override, setting
from conespot.scene import InputError, Scene
from conespot.scene.document import Document, find_document, is_file, read_document, read_value
from conespot.scene.scene import KNOWLEDGE, read_scene
from conespot.scene.text_file import at_home


def described_scene(name: str, settings: Sequence[str], what: str) -> tuple[Scene, Knowledge]:
    """The scene of a preset or file with `scene.KEY=VALUE` and `knowledge.KEY=VALUE` settings on it, and its knowledge.

    A scene's file may say under `knowledge:` how well its quantities are known (`rcm_sigma: 0.02 mm`); a campaign's
    simulated errors have no place there. `what` is done with it, in words. Raises InputError.
    """
    document = read_document(find_document(name, "scene", "presets", "scene preset"))
    scene: dict[str, Any] = {key: value for key, value in document.data.items() if key != KNOWLEDGE}
    lines = {path if path[:1] == (KNOWLEDGE,) else ("scene", *path): at for path, at in document.lines.items()}
    data = {"scene": scene, KNOWLEDGE: document.data.get(KNOWLEDGE, {})}
    document = Document(document.source, data, lines, document.folder)
    for text in settings:
        key, value = setting(text)
        if not key.startswith(("scene.", f"{KNOWLEDGE}.")):
            raise InputError(f"--set {key}: {what} is about a scene alone; set a key such as scene.eye.radius")
        document = override(document, key, value, f"--set {key}")
    knowledge = document.validate(Knowledge, at=(KNOWLEDGE,))
    for key in document.data[KNOWLEDGE]:
        if not key.endswith("_sigma"):
            raise InputError(
                f"{document.place((KNOWLEDGE, key))}: knowledge.{key}: belongs to a campaign; leave it out"
            )
    return read_scene(document, at=("scene",)), knowledge


def files_of_scene(name: str, settings: Sequence[str]) -> list[Path]:
    """The file of a scene, then those that it, its preset and the settings name, such as an OpenCV calibration's."""
    path = find_document(name, "scene", "presets", "scene preset")
    if not path.is_file():  # a pipe, which can be read but once
        return []
    document = read_document(path)
    found = [path, *_named(document.data, document.folder)]
    for text in settings:
        key, value = setting(text)
        found += _named({key.rpartition(".")[2]: read_value(value, f"--set {key}")}, Path())
    return found


def _named(value: object, folder: Path) -> Iterator[Path]:
    """The files that values name, from a folder on, and those that presets among them name."""
    if isinstance(value, (list, tuple)):
        for item in value:
            yield from _named(item, folder)
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _named(item, folder)
            preset = folder / at_home(Path(item)) if key == "preset" and isinstance(item, str) else None
            if preset is not None and is_file(preset) and preset.is_file():
                inside = read_document(preset)  # a preset starts from none
                yield from _named({k: v for k, v in inside.data.items() if k != "preset"}, inside.folder)
    elif isinstance(value, str) and is_file(path := folder / at_home(Path(value))):
        yield path
