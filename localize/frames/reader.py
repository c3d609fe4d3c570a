"""The one way in for frames from outside: files, folders and videos, one after the other."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from conespot.localize.frames.fit import fitted
from conespot.localize.frames.recording import SUFFIX, read_recording
from conespot.localize.frames.still import kind_of, read_stills
from conespot.localize.frames.video import SUFFIXES, read_video
from conespot.localize.image import AnyImage
from conespot.scene.document import InputError
from conespot.scene.scene import Scene
from conespot.scene.text_file import at_home

#: files of a folder that are frames; others lie beside them
STILLS = (".png", ".tif", ".tiff", ".jpg", ".jpeg", ".exr")


@dataclass(frozen=True, eq=False)
class GivenFrame:
    """A frame from outside: its name (its file's, and of several in a file its number), and what `locate` takes.

    `image` is `[H, W]` or `[H, W, 3]` (RGB) in values of the scene's sensor, `time_s` its time stamp [s], None where
    the source has none.
    """

    name: str
    time_s: float | None
    image: AnyImage


def read_frames(sources: Sequence[str | Path], scene: Scene) -> Iterator[GivenFrame]:
    """The frames of images, folders of images (in the order of the numbers in their names) and videos, one by one.

    Of a TIFF each page is a frame.
    Raises InputError where it gets to a source or a frame that is missing, broken or does not fit the scene; in words
    that name the key of the scene that would mend it.
    """
    for source in sources:
        path = at_home(Path(source))
        if path.is_dir():
            for inside in files_of(path):
                yield from _stills(inside, scene)
        elif path.suffix.lower() in SUFFIXES and kind_of(path) is None:
            for number, (time, stored) in enumerate(read_video(path, scene)):
                name = f"{path}, frame {number}"
                yield GivenFrame(name, time, fitted(name, stored, scene))
        elif path.suffix.lower() == SUFFIX and kind_of(path) is None:
            for number, (time, stored) in enumerate(read_recording(path, scene)):
                name = f"{path}, frame {number}"
                yield GivenFrame(name, time, fitted(name, stored, scene))
        else:
            yield from _stills(path, scene)


def _stills(path: Path, scene: Scene) -> Iterator[GivenFrame]:
    kind = kind_of(path)
    if kind is None:
        if path.stat().st_size == 0:
            raise InputError(f"{path}: is empty; copy or record it again")
        known = f"PNG, TIFF, JPEG and EXR; videos end in {', '.join(SUFFIXES)}"
        raise InputError(f"{path}: begins like none of the images that are read: {known}")
    for name, stored in read_stills(path, kind, scene):
        yield GivenFrame(name, None, fitted(name, stored, scene))


def files_of(folder: Path) -> list[Path]:
    """The frames of a folder, in the order of the numbers in their names. Raises InputError where there is none."""
    try:
        found = [path for path in folder.iterdir() if path.suffix.lower() in STILLS and not path.name.startswith(".")]
    except OSError as error:
        raise InputError(f"{folder}: cannot be read: {error.strerror}") from None
    if not found:
        raise InputError(f"{folder}: holds no frame; files that end in {', '.join(STILLS)} are")
    return sorted(found, key=lambda path: _natural(path.name))


def _natural(name: str) -> list[tuple[int, str]]:
    """Orders frame_9 before frame_10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name)]
