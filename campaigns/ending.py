"""How a command ends."""

from __future__ import annotations

from enum import IntEnum


class Ending(IntEnum):
    """Exit codes of `campaign`."""

    DONE = 0
    FAILED = 1
    BAD_INPUT = 2
    INTERRUPTED = 130


class RunError(Exception):
    """The run cannot go on; the message says why and how to mend it."""
