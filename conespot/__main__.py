"""The command `campaign`, as `python -m conespot` too. Before anything is imported, Ctrl-C is told how to end it.

What is left is the interpreter's own start, some hundredths of a second in which Ctrl-C is Python's and not ours.
"""

from __future__ import annotations

import os
import sys


def main() -> int:
    """The command; its exit code."""
    # not `signal`, which builds its enumerations first: most of the time until the command itself listens
    raw = __import__("_signal")
    if raw.getsignal(raw.SIGINT) is raw.default_int_handler:
        raw.signal(raw.SIGINT, _end)
    from conespot.campaigns.command import main as command

    return command()


def _end(*_: object) -> None:
    try:
        os.write(2, b"campaign: interrupted\n")
    finally:
        os._exit(130)


if __name__ == "__main__":
    sys.exit(main())
