"""Interruption: what Ctrl-C, SIGTERM and SIGHUP ask for, as a flag that loops look at. Nothing is raised anywhere.

Everything on the disk is whole at any moment, so a signal ends the process at once; but while a loop says that it looks
at the flag, the first signal only sets it, and the second ends the process. It is light: a command listens first.
"""

from __future__ import annotations

import os
import signal
import time

from conespot.campaigns.ending import Ending

TYPE_CHECKING = False  # `typing` itself takes longer to import than all that is used here
if TYPE_CHECKING:
    from types import FrameType

_NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
#: the signals that interrupt, where the system has them
SIGNALS = tuple(signal.Signals[name] for name in _NAMES if name in signal.Signals.__members__)
#: signals this close are one [s]: `timeout` and a terminal that hangs up send theirs twice
_ONE = 0.2


class Interruption:
    """Whether somebody wants this process to end. Without `listen`, as in a library, nobody ever does.

    `with interruption:` says that what happens there looks at `asked`, soon and again and again.
    """

    def __init__(self) -> None:
        self.asked = False
        self._asked_at = 0.0
        self._heeded = False

    def listen(self) -> None:
        """Take the signals, but for those that were ignored when the process began, as `nohup` has it."""
        for number in SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, self._hear)

    def __enter__(self) -> None:
        self._heeded = True

    def __exit__(self, *_: object) -> None:
        self._heeded = False

    def _hear(self, _number: int, _frame: FrameType | None) -> None:
        now = time.monotonic()
        if self.asked and now - self._asked_at < _ONE:
            return
        if self._heeded and not self.asked:
            self.asked, self._asked_at = True, now
            return
        kept = "; what is finished is kept, and the same command continues the run" if self.asked else ""
        try:
            # past the buffers: the signal may have come in the middle of a write to them
            line = "\n" if os.isatty(2) else ""  # below the line of progress
            os.write(2, f"{line}campaign: interrupted{kept}\n".encode())
        finally:
            os._exit(Ending.INTERRUPTED)


#: of this process, as signals are
interruption = Interruption()
