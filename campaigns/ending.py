"""How a command ends."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator
from enum import IntEnum


class Ending(IntEnum):
    """Exit codes of `campaign`."""

    DONE = 0
    FAILED = 1
    BAD_INPUT = 2
    INTERRUPTED = 130


class RunError(Exception):
    """The run cannot go on; the message says why and how to mend it."""


@contextlib.contextmanager
def held_back(*signals: signal.Signals) -> Iterator[None]:
    """Let these signals wait while something must be done whole; processes started meanwhile never get them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
