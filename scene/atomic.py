"""Files that are either whole or not there: nobody ever reads half a table."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from conespot.scene.document import InputError

_DEVICE = "is a device or a pipe, no file"


def write_atomically(path: Path, data: bytes | memoryview, option: str = "--out") -> None:
    """Write `data` to `path`: to a temporary file beside it, onto the disk, then renamed over it.

    The folder must exist. Whatever happens, `path` holds its old content or all of the new, and no temporary file
    is left behind by an error. Raises InputError if the file cannot be written; `option` is where to name another.
    """
    with replacing(path, option) as stream:
        stream.write(data)


def can_hold(path: Path, option: str) -> None:
    """Raises InputError for a file that could not be written later, before any work is done; nothing is left there."""
    try:
        if path.is_dir() or not path.parent.is_dir():
            raise _refusal(path, "is a folder" if path.is_dir() else "its folder does not exist", option)
        if _is_device(path):
            raise _refusal(path, _DEVICE, option)
        os.close(_begin(probe := _temporary(path)))
        probe.unlink()
    except OSError as error:
        raise _refusal(path, str(error.strerror), option) from None


def _refusal(path: Path, why: str, option: str) -> InputError:
    return InputError(f"{path}: cannot be written: {why}; choose another {option}")


def _is_device(path: Path) -> bool:
    """Whether a file would take a device's or a pipe's place, for everybody."""
    return path.parent == Path("/dev") or (path.exists() and not (path.is_file() or path.is_dir()))


def _temporary(path: Path) -> Path:
    return path.with_name(f".{path.name[:100]}.{secrets.token_hex(4)}.tmp")


def _begin(temporary: Path) -> int:
    # not tempfile, whose files nobody else may read
    return os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)


@contextlib.contextmanager
def replacing(path: Path, option: str = "--out") -> Iterator[BinaryIO]:
    """A stream whose content stands in `path` once it ends without an error, as `write_atomically` does it."""
    if _is_device(path):
        raise _refusal(path, _DEVICE, option)
    temporary = _temporary(path)
    try:
        handle = _begin(temporary)
        try:
            with open(handle, "w+b") as stream:
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
            os.replace(temporary, path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
        _sync_folder(path.parent)
    except OSError as error:
        raise _refusal(path, str(error.strerror), option) from None


def _sync_folder(folder: Path) -> None:
    """The rename itself reaches the disk only with its folder; not every system can open one."""
    if not hasattr(os, "O_DIRECTORY"):
        return
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
