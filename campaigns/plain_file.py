"""The files of a run folder, which a stranger may have made: opened if they are files.

A named pipe would be waited for, and a link to a device has no end.
"""

from __future__ import annotations

import errno
from pathlib import Path
from typing import IO, Literal


def open_plain(path: Path, mode: Literal["rb", "a+b"] = "rb") -> IO[bytes]:
    """Open a file, or begin it where `mode` allows. Raises OSError for what is no file."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise OSError(errno.EINVAL, "Is a pipe or a device", str(path))
    return open(path, mode)
