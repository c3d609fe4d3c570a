"""Locks of a run folder: one writer of the journal, and one at a time of what is made from it.

They end with their process, however that ends. Where the system or a network's disk has none, nobody is held back.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from conespot.campaigns.plain_file import open_plain

#: `is_taken` holds the lock for a moment, which is not to keep a run from beginning [s]
_PATIENCE, _STEP = 0.5, 0.05


def take(file: IO[bytes]) -> bool:
    """Lock a file for as long as it is open; False if another process has."""
    end = time.monotonic() + _PATIENCE
    while not _flock(file.fileno(), "LOCK_EX", "LOCK_NB"):
        if time.monotonic() > end:
            return False
        time.sleep(_STEP)
    return True


def is_taken(path: Path) -> bool:
    """Whether a process has locked a file. Raises OSError if it cannot be read."""
    with open_plain(path) as file:
        return not _flock(file.fileno(), "LOCK_SH", "LOCK_NB")


@contextlib.contextmanager
def alone(folder: Path) -> Iterator[None]:
    """Nobody else who asks writes rows, tables, figures and report of the folder meanwhile; waits for who does.

    Who reads the journal only then never writes less than what another wrote before.
    """
    handle = os.open(folder, os.O_RDONLY) if hasattr(os, "O_DIRECTORY") else None
    try:
        if handle is not None:
            _flock(handle, "LOCK_EX")
        yield
    finally:
        if handle is not None:
            os.close(handle)


def _flock(file: int, *operations: str) -> bool:
    """Lock an open file or folder; False if another process has."""
    try:
        import fcntl
    except ImportError:
        return True
    try:
        fcntl.flock(file, sum(getattr(fcntl, name) for name in operations))
    except BlockingIOError:
        return False
    except OSError:
        pass  # a network file system without locks
    return True
