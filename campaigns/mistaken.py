"""What was named in place of what a command takes: a scene for a campaign, a campaign for a run, a run for its archive.

Asked only when a command has refused what it was given, so that nothing waits for it.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Any, assert_never

from conespot.campaigns.journal import FILE as JOURNAL
from conespot.campaigns.schema import Campaign
from conespot.scene import InputError, Scene
from conespot.scene.document import is_file, read_document, shipped
from conespot.scene.scene import KNOWLEDGE

_ARCHIVE = b"PK\x03\x04"


class _Kind(Enum):
    CAMPAIGN = "a campaign"
    SCENE = "a scene"
    RUN = "a run folder"
    ARCHIVE = "an archive"


#: what the options of commands, by their names in the parser, are to name
_TAKEN = {
    "campaign": _Kind.CAMPAIGN,
    "scene": _Kind.SCENE,
    "folder": _Kind.RUN,
    "folders": _Kind.RUN,
    "archive": _Kind.ARCHIVE,
}


def mistaken(options: argparse.Namespace) -> str | None:
    """The sentence that says so of the first name that is of another kind than the command takes; else None."""
    command = f"campaign {options.run.__name__}"
    for name, taken in _named(options):
        found = _kind_of(name)
        if found not in (None, taken):
            return f"{name}: is {found.value}, and `{command}` takes {taken.value}; {_mend(name, found, taken)}"
    return None


def _named(options: argparse.Namespace) -> Iterator[tuple[str, _Kind]]:
    for option, taken in _TAKEN.items():
        value = getattr(options, option, None)
        for name in value if isinstance(value, list) else [value]:
            if name is not None:
                yield str(name), taken


def _kind_of(name: str) -> _Kind | None:
    path = Path(name)
    if path.is_dir():
        return _Kind.RUN if (path / JOURNAL).is_file() or (path / "campaign.yaml").is_file() else None
    if is_file(path):
        return _kind_of_file(path)
    stem = name.removesuffix(".yaml")
    if stem in shipped("campaigns", ""):
        return _Kind.CAMPAIGN
    return _Kind.SCENE if stem in shipped("scene", "presets") else None


def _kind_of_file(path: Path) -> _Kind | None:
    try:
        with path.open("rb") as file:
            if path.is_file() and file.read(len(_ARCHIVE)) == _ARCHIVE:
                return _Kind.ARCHIVE
    except OSError:
        return None
    keys = set(_content(path))
    if keys & ({*Campaign.model_fields, "sweep"} - {*Scene.model_fields, KNOWLEDGE}):
        return _Kind.CAMPAIGN
    return _Kind.SCENE if keys & {*Scene.model_fields, "preset"} else None


def _content(path: Path) -> dict[str, Any]:
    try:
        return read_document(path).data
    except InputError:
        return {}  # whoever refused it has said so


def _mend(name: str, found: _Kind, taken: _Kind) -> str:
    match taken:
        case _Kind.CAMPAIGN:
            return _campaign_for(name, found)
        case _Kind.SCENE:
            return _scene_for(name, found)
        case _Kind.RUN:
            return _run_for(name, found)
        case _Kind.ARCHIVE:
            return f"`campaign pack {name}` makes one" if found is _Kind.RUN else "`campaign pack RUN` makes one"
        case _:
            assert_never(taken)


def _campaign_for(name: str, found: _Kind) -> str:
    if found is _Kind.RUN:
        return f"that run's is {Path(name) / 'campaign.yaml'}"
    if found is _Kind.ARCHIVE:
        return "unpack it, that run's is campaign.yaml"
    return f"`--set scene={name}` puts it into one, and `campaign init` writes one of your own"


def _scene_for(name: str, found: _Kind) -> str:
    if found is _Kind.ARCHIVE:
        return "a preset, or a YAML file that describes one"
    path = Path(name) / "campaign.yaml" if found is _Kind.RUN else Path(name)
    path = path if is_file(path) else shipped("campaigns", "").get(name.removesuffix(".yaml"), path)
    scene = _content(path).get("scene", {})
    preset = scene if isinstance(scene, str) else scene.get("preset") if isinstance(scene, dict) else None
    begins = f"that one's begins with the preset {preset}, and " if isinstance(preset, str) and preset else ""
    return f"{begins}what stands under `scene:` there can be a file of its own"


def _run_for(name: str, found: _Kind) -> str:
    if found is _Kind.ARCHIVE:
        return f"unpack it with `python3 -m zipfile -e {name} FOLDER`"
    if found is _Kind.SCENE:
        return "such as runs/NAME, which `campaign run NAME` makes"
    folder = Path("runs") / Path(name).stem
    return f"did you mean {folder}?" if folder.is_dir() else f"`campaign run {name}` makes {folder}"
