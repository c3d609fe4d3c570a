"""A scene of one's own as the commands take it: a preset or a file, with settings on it, and how well it is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from conespot.campaigns.knowledge import Knowledge
from conespot.campaigns.schema import override, setting
from conespot.scene import InputError, Scene
from conespot.scene.document import Document, find_document, read_document
from conespot.scene.scene import KNOWLEDGE, read_scene


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
