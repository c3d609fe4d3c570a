"""Where a command may write: not over what it reads, and no two outputs to one file; said before any work is done."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from conespot.campaigns.own_scene import files_of_scene
from conespot.localize.frames.reader import files_of
from conespot.scene import InputError
from conespot.scene.text_file import at_home


def check_destinations(
    files: Mapping[str, Path | None],
    frames: Mapping[str, Sequence[Path]],
    scene: tuple[str, Sequence[str]],
    overlay: Path | None = None,
) -> None:
    """Raises InputError for an output that is an input or another output, through links too; both are named.

    `files` are outputs by option, `frames` inputs by option (or the name of the argument), `scene` a scene's name and
    the settings on it, and `overlay` a folder that PNG files are drawn into.
    """
    given = {option: path for option, path in files.items() if path is not None}
    for number, (option, path) in enumerate(given.items()):
        for other, theirs in list(given.items())[:number]:
            if _same(path, theirs):
                raise InputError(f"{path}: is what {other} writes, too; choose another {option}")
        if overlay is not None and _same(path.parent, overlay) and path.suffix.lower() == ".png":
            raise InputError(f"{path}: may be a picture of --overlay, too; choose another {option}")
        if not os.path.exists(path):
            continue
        for what, read in _read(frames, *scene):
            if _same(path, read):
                raise InputError(f"{path}: is {what}; choose another {option}")
    if overlay is not None:
        _check_overlay(overlay, frames)


def _check_overlay(overlay: Path, frames: Mapping[str, Sequence[Path]]) -> None:
    """Pictures among the frames would be written over frames, or be taken for some the next time."""
    for option, sources in frames.items():
        for source in map(at_home, sources):
            folder = source if source.is_dir() else source.resolve().parent
            if _same(folder, overlay) or (not source.is_dir() and _same(source.parent, overlay)):
                raise InputError(f"{overlay}: holds what {option} reads; choose another --overlay")


def _read(frames: Mapping[str, Sequence[Path]], scene: str, settings: Sequence[str]) -> Iterator[tuple[str, Path]]:
    """Every file that is read, and what it is, in words."""
    for option, sources in frames.items():
        for source in map(at_home, sources):
            for path in files_of(source) if source.is_dir() else [source]:
                yield f"a frame that {option} reads", path
    named = files_of_scene(scene, settings)
    for number, path in enumerate(named):
        yield ("a file that --scene names" if number else "the scene that --scene reads"), path


def _same(one: Path, other: Path) -> bool:
    """Whether two paths lead to the same place, which need not exist."""
    if os.path.exists(one) and os.path.exists(other):
        return os.path.samefile(one, other)
    return os.path.realpath(one) == os.path.realpath(other)
