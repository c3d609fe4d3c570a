"""Text that somebody else wrote, bounded in size: a file, or a pipe such as `<(command)`, in UTF-8 or UTF-16."""

from __future__ import annotations

import codecs
import os
from pathlib import Path

#: byte-order marks that editors and spreadsheets write, and what they stand for
_MARKS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}


def read_text(path: Path, most: int, what: str) -> str:
    """The text of a file of at most `most` bytes, without its byte-order mark; `what` is what it should hold.

    Raises ValueError, which names the file, for one that cannot be read, is larger, or is in another encoding. A named
    pipe that nobody writes to is empty.
    """
    raw = read_bytes(path, most, what)
    encoding = next((name for mark, name in _MARKS.items() if raw.startswith(mark)), "utf-8")
    try:
        return raw.decode(encoding)
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise ValueError(f"{path}:{line}: is no text in UTF-8 ({error.reason}); save the {what} as UTF-8") from None


def read_bytes(path: Path, most: int, what: str) -> bytes:
    """The bytes of a file or a pipe, `most` of them; `what` is what it should hold.

    Raises ValueError, which names the file, for one that cannot be read or is larger.
    """
    path = at_home(path)
    try:
        raw = _read(path, most + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise ValueError(f"{path}: cannot be read: {reason}") from None
    if len(raw) > most:
        raise ValueError(f"{path}: larger than {most / 1e6:g} MB, which no {what} needs")
    return raw


def at_home(path: Path) -> Path:
    """The path with a leading `~` as a shell would write it, where nothing has that very name."""
    if str(path).startswith("~") and not os.path.lexists(path):
        return Path(os.path.expanduser(path))
    return path


def _read(path: Path, most: int) -> bytes:
    # a pipe without a writer must not be waited for, one that has a writer must
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
    parts: list[bytes] = []
    try:
        while most > 0:
            try:
                part = os.read(handle, min(most, 1 << 20))
            except BlockingIOError:
                os.set_blocking(handle, True)
                continue
            if not part:
                break
            parts.append(part)
            most -= len(part)
    finally:
        os.close(handle)
    return b"".join(parts)
