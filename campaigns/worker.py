"""A worker: a process of one thread that measures unit after unit, until it is worn, dies, or is told to end.

It ignores Ctrl-C, which is for the process that owns the store, and ends with that process, however that ends.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import signal
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Protocol

from conespot.campaigns.interruption import SIGNALS
from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.row import Record

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

#: a terminal sends these to every process of the command; SIGTERM still ends a worker, which is then replaced
_DEAF = [number for number in SIGNALS if number != signal.SIGTERM]


class Measures(Protocol):
    """What a worker does with a unit; `campaigns.cropper.Cropper` with its bench but in tests."""

    @property
    def variant(self) -> str:
        """The Mitsuba variant it renders with."""

    @property
    def worn(self) -> bool:
        """True when its process should be replaced before the next unit."""

    def measure(self, unit: Unit) -> Record:
        """The unit's record."""


#: after which a pose hangs [s]: the slowest that was ever measured, of 4000 px on the scalar variant, takes minutes
POSE_LIMIT_S = 3600.0

#: makes what measures, in the worker's own process
MakeBench = Callable[[Plan, Path | None], Measures]


def make_bench(plan: Plan, frames: Path | None) -> Measures:
    """The bench of a worker, imported where it is used: the parent process never loads Mitsuba."""
    from conespot.campaigns.bench import Bench
    from conespot.campaigns.cropper import Cropper

    return Cropper(plan, Bench(plan, frames))


@dataclass(frozen=True)
class Done:
    """The unit's record; with `last` the process has ended, to make room for a fresh one."""

    record: Record
    last: bool = False


@dataclass(frozen=True)
class Note:
    """A warning that all workers give alike."""

    sentence: str


@dataclass(frozen=True)
class Refused:
    """No process of this machine can measure anything."""

    reason: str


@dataclass(frozen=True)
class Lost:
    """The process is gone with its unit."""

    how: str


Message = Done | Note | Refused | Lost


class Worker:
    """A process, the unit it is busy with, the one it will go on with, and the key of the scene it has loaded."""

    def __init__(self, plan: Plan, frames: Path | None, make: MakeBench) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.unit: Unit | None = None
        self.next: Unit | None = None
        self.scene: str | None = None
        #: how long its last unit took [s]
        self.took = math.inf
        self._begun = time.monotonic()
        self._process = context.Process(target=_work, args=(theirs, plan, frames, make), daemon=True)
        with born():
            self._process.start()
        theirs.close()

    def give(self, unit: Unit, scene: str) -> None:
        """Send a unit of a scene, to be measured at once or, if it is busy, next."""
        if self.unit is None:
            self.unit, self.scene, self._begun = unit, scene, time.monotonic()
        else:
            self.next = unit
        # a dead worker is found when its answer is awaited
        with contextlib.suppress(OSError):
            self.connection.send(unit)

    @property
    def since(self) -> float:
        """How long ago it began its unit [s]."""
        return time.monotonic() - self._begun

    def finish(self) -> None:
        """Its unit is finished; it goes on with the next, if it has one."""
        self.took = self.since
        self.unit, self.next, self._begun = self.next, None, time.monotonic()

    def hear(self) -> Message:
        """What it says next; waits for it."""
        try:
            message: Message = self.connection.recv()
        except (EOFError, OSError):
            return Lost(self.end())
        return message

    def end(self, at_once: bool = False) -> str:
        """Stop the process; how it ended."""
        if at_once:
            self._process.kill()
        self.connection.close()
        self._process.join(timeout=0.5)
        if self._process.exitcode is None:
            self._process.kill()
            self._process.join()
        code = self._process.exitcode or 0
        if code >= 0:
            return f"ended with exit code {code}"
        hint = " (out of memory?)" if code == -signal.SIGKILL else ""
        return f"was killed by {signal.Signals(-code).name}{hint}"


def _work(connection: Connection, plan: Plan, frames: Path | None, make: MakeBench) -> None:
    """A worker's life: units come in, messages go out."""
    for number in _DEAF:
        signal.signal(number, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    with contextlib.suppress(EOFError, OSError):
        try:
            bench, sentences = made(make, plan, frames)
        except Exception as error:
            connection.send(Refused(f"cannot render: {error}"))
            return
        for sentence in sentences:
            connection.send(Note(sentence))
        last = False
        while not last:
            unit = connection.recv()
            record = measured(bench, unit)
            last = bench.worn
            connection.send(Done(record, last))


def made(make: MakeBench, plan: Plan, frames: Path | None) -> tuple[Measures, list[str]]:
    """What measures, and what it warns of."""
    with warnings.catch_warnings(record=True) as caught:
        bench = make(plan, frames)
    return bench, [str(warning.message) for warning in caught if issubclass(warning.category, RuntimeWarning)]


def measured(bench: Measures, unit: Unit) -> Record:
    """The unit's record, which holds an error if its code raises."""
    try:
        return bench.measure(unit)
    except Exception as error:
        return Record(unit=unit.key, error=_sentence(error))


def _end_with_parent() -> None:
    """End this process when its parent is gone, in the middle of a pose too."""
    parent = multiprocessing.parent_process()
    assert parent is not None, "workers are started by multiprocessing"
    parent.join()
    os._exit(1)


def _sentence(error: BaseException) -> str:
    """The error in a line, with the place in the code it came from."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    text = " ".join(str(error).split())[:800]
    return f"{type(error).__name__}: {text} ({Path(frame.filename).name}:{frame.lineno})"


@contextlib.contextmanager
def born() -> Iterator[None]:
    """Processes started meanwhile use one thread, import nothing of ours or the standard library's from the working
    folder, and never hear of Ctrl-C: all must be so before they run anything.
    """
    meanwhile = {**dict.fromkeys(_ONE_THREAD, "1"), "PYTHONSAFEPATH": "1"}
    before = {key: os.environ.get(key) for key in meanwhile}
    os.environ.update(meanwhile)
    try:
        with held_back():
            yield
    finally:
        for key, value in before.items():
            if value is None:
                del os.environ[key]
            else:
                os.environ[key] = value


@contextlib.contextmanager
def held_back() -> Iterator[None]:
    """Let the signals wait that a terminal sends to everybody; processes started meanwhile never get them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _DEAF)
    try:
        resource_tracker.ensure_running()  # it would be started with the first process, and lets Ctrl-C through again
        signal.pthread_sigmask(signal.SIG_BLOCK, _DEAF)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
