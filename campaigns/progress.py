"""Progress: one rewritten line on a terminal, now and then a plain line anywhere else."""

from __future__ import annotations

import contextlib
import shutil
import time
from collections import deque
from collections.abc import Callable
from typing import TextIO

#: finished units the pace is taken from: enough to be steady, few enough to follow a change of scene
_WINDOW = 40
#: of the bar on a terminal: its width, and how much of a place is filled
_WIDE, _EIGHTHS = 24, "\u258f\u258e\u258d\u258c\u258b\u258a\u2589\u2588"
_FIRST_WAIT, _LONGEST_WAIT = 5.0, 60.0


class Progress:
    """Counts frames and failures, and says what time remains at the pace of the last units.

    `work` is in any unit that is proportional to time; nothing is promised before the pace is known.
    """

    def __init__(self, frames: int, work: float, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self._frames, self._work = frames, work
        self._stream, self._clock = stream, clock
        self._tty = stream.isatty()
        self._start = self._said = clock()
        self._wait = _FIRST_WAIT
        self._done = self._failed = 0
        self._pace: deque[tuple[float, float]] = deque(maxlen=_WINDOW)
        self._width = 0

    def update(self, frames: int, work: float, failed: int) -> None:
        """A unit is finished: its frames, its share of the work, and the localizations among them that failed."""
        now = self._clock()
        self._done += frames
        self._failed += failed
        self._work -= work
        self._pace.append((now, work))
        if self._tty:
            self._rewrite(f"{self._bar()} {self.line()}{self._speed()}")
        elif now - self._said >= self._wait:
            self._said, self._wait = now, min(2.0 * self._wait, _LONGEST_WAIT)
            self._plain(self.line())

    def line(self) -> str:
        """Where the run stands."""
        share = self._done / self._frames if self._frames else 1.0
        failed = f", {self._failed} not localized" if self._failed else ""
        text = f"{self._done} of {self._frames} frames ({share:.0%}){failed}, {clock_time(self._clock() - self._start)}"
        remaining = self.remaining()
        known = remaining is not None and self._done < self._frames
        return f"{text}, {clock_time(remaining)} left" if known and remaining is not None else text

    def remaining(self) -> float | None:
        """Time left [s]; None until a few units have shown the pace."""
        if len(self._pace) < 5 or self._pace[-1][0] <= self._pace[0][0]:
            return None
        # the first unit of the window only marks its beginning
        done = sum(work for _, work in self._pace) - self._pace[0][1]
        return max(self._work, 0.0) * (self._pace[-1][0] - self._pace[0][0]) / done

    def pace(self) -> float | None:
        """Units a second; None until a few have shown it."""
        if self.remaining() is None:
            return None
        return (len(self._pace) - 1) / (self._pace[-1][0] - self._pace[0][0])

    def _bar(self) -> str:
        """How far it is, as wide as a glance; in eighths where the terminal has them."""
        share = min(self._done / self._frames, 1.0) if self._frames else 1.0
        encoding = getattr(self._stream, "encoding", None) or "ascii"
        try:
            _EIGHTHS.encode(encoding)
        except (UnicodeEncodeError, LookupError):
            return f"[{'#' * round(_WIDE * share):{_WIDE}}]"
        whole, rest = divmod(round(8 * _WIDE * share), 8)
        return f"{(_EIGHTHS[-1] * whole + _EIGHTHS[:rest][-1:]).ljust(_WIDE)}|"

    def _speed(self) -> str:
        """Frames a second since the beginning."""
        took = self._clock() - self._start
        return f", {self._done / took:.3g} frames/s" if took > 1.0 else ""

    def note(self, sentence: str) -> None:
        """Say something that must not be lost among the progress."""
        if self._tty:
            self._rewrite("")
        self._plain(sentence)

    def close(self) -> None:
        """The last word on how far it came."""
        if self._tty:
            self._rewrite("")
        self._plain(self.line())

    def _plain(self, text: str) -> None:
        self._write(f"{text}\n")

    def _rewrite(self, text: str) -> None:
        text = text[: shutil.get_terminal_size().columns - 1]
        self._write(f"\r{text.ljust(self._width)}" if text else f"\r{' ' * self._width}\r")
        self._width = len(text)

    def _write(self, text: str) -> None:
        with contextlib.suppress(OSError):  # nobody listens any more: the run matters, not what is said of it
            self._stream.write(text)
            self._stream.flush()


def clock_time(seconds: float) -> str:
    """Seconds as people read them: minutes and seconds, with hours where there are any."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
