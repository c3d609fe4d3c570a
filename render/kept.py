"""Backgrounds kept on disk, by what they show: for every rig, worker and run with the same eye, camera and light.

The files lie in $XDG_CACHE_HOME/conespot, ~/.cache/conespot where that is not set; CONESPOT_CACHE=off makes no use of
them. What somebody in this process still holds is given again with or without them.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import math
import os
import platform
import secrets
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]

#: set to `off` for a run that neither reads nor writes what is kept
SWITCH = "CONESPOT_CACHE"
#: bytes kept at most; what was not used for longest goes first
LIMIT = 2 * 1024**3
#: a file begins with its content's digest
_DIGEST = 64
#: seconds after which an unfinished file is one that nobody writes any more
_ABANDONED = 3600.0
#: what was given before, as long as anybody holds it
_HELD: WeakValueDictionary[str, Image] = WeakValueDictionary()
_PACKAGES = ("mitsuba", "drjit", "numpy", "opencv-python-headless", "karellen-llvm-core")


def folder() -> Path | None:
    """Where backgrounds are kept; None where they are not: it is switched off, or nothing can be written there."""
    if os.environ.get(SWITCH, "").lower() in ("off", "0", "no"):
        return None
    home = os.environ.get("XDG_CACHE_HOME", "")
    try:
        place = (Path(home) if os.path.isabs(home) else Path.home() / ".cache") / "conespot"
        place.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):
        return None
    return place if os.access(place, os.W_OK | os.X_OK) else None


def kept(address: str, shape: tuple[int, int, int], render: Callable[[], Image]) -> Image:
    """The image `[H, W, C]` of that shape and address, read-only: from disk, else rendered and put there.

    An image from disk is mapped, so that processes share its memory; one that is torn or altered is rendered anew.
    """
    image = _HELD.get(address)
    if image is None:
        image = _HELD[address] = _fetched(address, shape, render)
    return image


def _fetched(address: str, shape: tuple[int, int, int], render: Callable[[], Image]) -> Image:
    place = folder()
    if place is None:
        return render()
    path = place / f"{address}.background"
    found = _read(path, shape)
    if found is not None:
        return found
    image = render()
    if image.nbytes <= LIMIT:
        # a full disk costs time, not the run
        with contextlib.suppress(OSError):
            _write(path, image)
            _shrink(place)
            found = _read(path, shape)
    return image if found is None else found


def occupied() -> tuple[int, int]:
    """How many backgrounds are kept, and in how many bytes."""
    sizes = [size for _, size, _ in _files(folder())]
    return len(sizes), sum(sizes)


def clear() -> int:
    """Keep nothing any more; how many bytes that frees."""
    freed = 0
    for path, size, _ in _files(folder()):
        with contextlib.suppress(OSError):
            path.unlink()
            freed += size
    return freed


@cache
def made_by() -> tuple[str, ...]:
    """What an image depends on beside its scene: this package's code and data, those it rests on, and the machine."""
    code = hashlib.blake2b()
    rooms = [Path(__file__).parent, Path(__file__).parent.parent / "scene"]
    for path in sorted(p for room in rooms for p in room.rglob("*") if p.is_file() and p.suffix != ".pyc"):
        code.update(path.name.encode() + path.read_bytes())
    versions = []
    for name in _PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            versions.append(f"{name} {importlib.metadata.version(name)}")
    return code.hexdigest(), *versions, platform.machine(), _processor()


def _processor() -> str:
    """The processor's name, where the system tells it: code is compiled for it, to the last bit."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith(("model name", "flags")):
                return line
    return platform.processor()


def _read(path: Path, shape: tuple[int, int, int]) -> Image | None:
    size = 4 * math.prod(shape)
    with contextlib.suppress(OSError, ValueError):
        if path.stat().st_size != _DIGEST + size:
            return None
        whole = np.memmap(path, np.uint8, "r")
        if _digest(path, whole[_DIGEST:]) != whole[:_DIGEST].tobytes():
            return None
        os.utime(path)
        return np.asarray(whole[_DIGEST:]).view(np.float32).reshape(shape)
    return None


def _write(path: Path, image: Image) -> None:
    content = np.ascontiguousarray(image).reshape(-1).view(np.uint8)
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(4)}")
    try:
        with open(temporary, "xb") as stream:
            stream.write(_digest(path, content))
            stream.write(content.data)
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _digest(path: Path, content: NDArray[np.uint8]) -> bytes:
    """Of an image's bytes and its address: a file under another's name is not it."""
    return hashlib.blake2b(content.data, key=path.stem.encode()).digest()


def _shrink(place: Path) -> None:
    """Remove what was not used for longest until the rest fits, and what others began and left."""
    room = LIMIT
    for path, size, used in sorted(_files(place), key=lambda file: -file[2]):
        unfinished = path.name.startswith(".")
        room -= 0 if unfinished else size
        if room < 0 or (unfinished and time.time() - used > _ABANDONED):
            with contextlib.suppress(OSError):
                path.unlink()


def _files(place: Path | None) -> Iterator[tuple[Path, int, float]]:
    """Path, bytes and time of use of all that is kept."""
    for path in place.iterdir() if place else ():
        with contextlib.suppress(OSError):
            found = path.stat()
            yield path, found.st_size, found.st_mtime
