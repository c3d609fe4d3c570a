"""The streams of a command: whoever closed or broke them, and whatever they cannot encode, the work is done."""

from __future__ import annotations

import contextlib
import os
import sys

TYPE_CHECKING = False  # `typing` takes long to import
if TYPE_CHECKING:
    from typing import TextIO


def make_safe() -> None:
    """Give the process standard streams that can be written to, and that no file opened later can be mistaken for.

    A stream that is closed (cron, daemons) becomes the null device; what a terminal cannot show becomes `?`.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free: this one
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115 - as long as the process
        elif hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")


def shown(text: str) -> str:
    """A text on one line, with what a terminal obeys and bytes that are no UTF-8 escaped.

    >>> shown("a\\n\\x1b[2J\\udcff")
    'a\\\\n\\\\x1b[2J\\\\xff'
    """
    return "".join(one if one.isprintable() else _escaped(one) for one in text)


def _escaped(one: str) -> str:
    if "\udc80" <= one <= "\udcff":  # how Python keeps a byte of a file's name
        return f"\\x{ord(one) - 0xDC00:02x}"
    return one.encode("unicode_escape").decode()


class UnheardError(Exception):
    """What was said to stdout cannot be written; the message says why, and is empty where the reader went away."""


def say(text: object) -> None:
    """Write a line to stdout, at once. Raises UnheardError if it cannot be written."""
    write(f"{text}\n")


def write(text: str) -> None:
    """Write to stdout, at once. Raises UnheardError if it cannot be written."""
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except OSError as error:
        _silence(sys.stdout)
        gone = isinstance(error, BrokenPipeError)
        raise UnheardError("" if gone else f"stdout cannot be written: {error.strerror}") from None


def complain(text: object) -> None:
    """Write a line to stderr, if anybody can hear it."""
    try:
        sys.stderr.write(f"{text}\n")
        sys.stderr.flush()
    except OSError:
        _silence(sys.stderr)


def _silence(stream: TextIO) -> None:
    """Send what is left in a broken stream nowhere: the interpreter tries to write it when it ends."""
    with contextlib.suppress(OSError, ValueError):
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, stream.fileno())
        os.close(null)
