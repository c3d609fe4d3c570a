"""Worker processes: one thread and one scene each, fed unit by unit, and replaced when they die.

A unit whose code raises, or that loses its worker twice, becomes a record with an error. Workers ignore Ctrl-C, which
is for the process that owns the store, and end by themselves when that process is gone.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Protocol

from campaigns.ending import RunError
from campaigns.plan import Plan, Unit
from campaigns.row import Record

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
#: workers lost in a row, with nothing ever finished, after which the machine is to blame and not the units
_HOPELESS = 4


class Measures(Protocol):
    """What a worker does with a unit; `campaigns.bench.Bench` but in tests."""

    @property
    def worn(self) -> bool:
        """True when its process should be replaced before the next unit."""

    def measure(self, unit: Unit) -> Record:
        """The unit's record."""


def make_bench(plan: Plan, frames: Path | None) -> Measures:
    """The bench of a worker, imported where it is used: the parent process never loads Mitsuba."""
    from campaigns.bench import Bench

    return Bench(plan, frames)


class _Worker:
    """A process and the unit it is busy with."""

    def __init__(self, plan: Plan, frames: Path | None, make: Callable[[Plan, Path | None], Measures]) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.unit: Unit | None = None
        self.process = context.Process(target=_work, args=(theirs, plan, frames, make), daemon=True)
        with _environment(dict.fromkeys(_ONE_THREAD, "1")):
            self.process.start()
        theirs.close()

    def give(self, unit: Unit) -> None:
        self.unit = unit
        # a dead worker is found when its answer is awaited
        with contextlib.suppress(OSError):
            self.connection.send(unit)

    def end(self) -> str:
        """Stop the process; how it ended."""
        self.connection.close()
        self.process.join(timeout=0.5)
        if self.process.exitcode is None:
            self.process.kill()
            self.process.join()
        code = self.process.exitcode or 0
        if code >= 0:
            return f"ended with exit code {code}"
        hint = " (out of memory?)" if code == -signal.SIGKILL else ""
        return f"was killed by {signal.Signals(-code).name}{hint}"


def execute(
    plan: Plan,
    units: Iterable[Unit],
    workers: int,
    *,
    frames: Path | None = None,
    note: Callable[[str], None] = lambda sentence: None,
    make: Callable[[Plan, Path | None], Measures] = make_bench,
) -> Generator[Record]:
    """Records of the units as they are finished, in any order. `note` is told of lost workers.

    Raises RunError if workers cannot start. Closing the iterator stops the workers.
    """
    waiting, again, suspects, noted = iter(units), deque[Unit](), set[str](), set[str]()
    crew: list[_Worker] = []
    lost, finished = 0, False
    try:
        while True:
            for unit in _next(again, waiting, workers - sum(w.unit is not None for w in crew)):
                idle = next((w for w in crew if w.unit is None), None)
                if idle is None:
                    idle = _Worker(plan, frames, make)
                    crew.append(idle)
                idle.give(unit)
            busy = {w.connection: w for w in crew if w.unit is not None}
            if not busy:
                return
            for connection in wait(list(busy)):
                worker = busy[connection]  # type: ignore[index]
                try:
                    kind, answer = worker.connection.recv()
                except (EOFError, OSError):
                    kind, answer = "lost", worker.end()
                    lost += 1
                if kind == "refused" or (lost == _HOPELESS and not finished):
                    reason = f"no worker lives to finish anything, the last {answer}" if kind == "lost" else answer
                    raise RunError(f"{reason}; try `campaign doctor`")
                if kind == "note":
                    if answer not in noted:
                        note(answer)
                    noted.add(answer)
                    continue
                done, worker.unit = worker.unit, None
                if kind in ("lost", "last"):
                    crew.remove(worker)
                    worker.end()
                if isinstance(answer, Record):
                    finished = True
                    yield answer
                elif done is not None and done.key in suspects:
                    note(f"a worker {answer} at {plan.says(done)} again; its frames are recorded as failed")
                    yield Record(unit=done.key, error=f"the worker {answer}, twice")
                elif done is not None:
                    note(f"a worker {answer} at {plan.says(done)}; trying that pose once more")
                    suspects.add(done.key)
                    again.append(done)
    finally:
        for worker in crew:
            if worker.unit is not None:
                worker.process.kill()
            worker.end()


def _next(again: deque[Unit], waiting: Iterator[Unit], count: int) -> Iterator[Unit]:
    for _ in range(count):
        unit = again.popleft() if again else next(waiting, None)
        if unit is not None:
            yield unit


def _work(
    connection: Connection, plan: Plan, frames: Path | None, make: Callable[[Plan, Path | None], Measures]
) -> None:
    """A worker's life: units come in, ("done", record) goes out, or "last" before it makes room for a fresh one.

    Before that, warnings go out as ("note", text), and ("refused", text) if it cannot work at all.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(EOFError, OSError):
        try:
            with warnings.catch_warnings(record=True) as caught:
                bench = make(plan, frames)
        except Exception as error:
            connection.send(("refused", f"cannot render: {error}"))
            return
        for warning in caught:
            if issubclass(warning.category, RuntimeWarning):
                connection.send(("note", str(warning.message)))
        while True:
            unit = connection.recv()
            try:
                record = bench.measure(unit)
            except Exception as error:
                record = Record(unit=unit.key, error=_sentence(error))
            connection.send(("last" if bench.worn else "done", record))
            if bench.worn:
                return


def _sentence(error: BaseException) -> str:
    """The error in a line, with the place in the code it came from."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    text = " ".join(str(error).split())[:800]
    return f"{type(error).__name__}: {text} ({Path(frame.filename).name}:{frame.lineno})"


@contextlib.contextmanager
def _environment(settings: dict[str, str]) -> Iterator[None]:
    """Environment variables for the processes that are started meanwhile: set before they import anything."""
    before = {key: os.environ.get(key) for key in settings}
    os.environ.update(settings)
    try:
        yield
    finally:
        for key, value in before.items():
            if value is None:
                del os.environ[key]
            else:
                os.environ[key] = value
