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
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Protocol

from conespot.campaigns.ending import RunError, held_back
from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.row import Record

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
    from conespot.campaigns.bench import Bench

    return Bench(plan, frames)


class _Queue:
    """Units that wait, by the scene they need."""

    def __init__(self, plan: Plan, units: Iterable[Unit]) -> None:
        self._plan = plan
        self._scenes: dict[str, deque[Unit]] = {}
        for unit in units:
            self._scenes.setdefault(self.scene(unit), deque()).append(unit)

    def scene(self, unit: Unit) -> str:
        return self._plan.groups[unit.group].scene_key

    def put_back(self, unit: Unit) -> None:
        self._scenes.setdefault(self.scene(unit), deque()).appendleft(unit)

    def take(self, loaded: str | None, elsewhere: Sequence[str | None]) -> Unit | None:
        """The next unit: of the scene that is `loaded`, else of the one that is loaded least `elsewhere`."""
        if not self._scenes:
            return None
        scene = loaded if loaded in self._scenes else min(self._scenes, key=elsewhere.count)
        unit = self._scenes[scene].popleft()
        if not self._scenes[scene]:
            del self._scenes[scene]
        return unit


class _Worker:
    """A process and the unit it is busy with."""

    def __init__(self, plan: Plan, frames: Path | None, make: Callable[[Plan, Path | None], Measures]) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, theirs = context.Pipe()
        self.unit: Unit | None = None
        self.scene: str | None = None
        self.process = context.Process(target=_work, args=(theirs, plan, frames, make), daemon=True)
        with _born():
            self.process.start()
        theirs.close()

    def give(self, unit: Unit, scene: str) -> None:
        """Send a unit of a scene."""
        self.unit, self.scene = unit, scene
        # a dead worker is found when its answer is awaited
        with contextlib.suppress(OSError):
            self.connection.send(unit)

    def end(self, at_once: bool = False) -> str:
        """Stop the process; how it ended."""
        if at_once:
            self.process.kill()
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
    queue, suspects, noted = _Queue(plan, units), set[str](), set[str]()
    crew: list[_Worker | None] = [None] * workers
    lost, finished = 0, False
    try:
        while True:
            for i, worker in enumerate(crew):
                if worker is None or worker.unit is None:
                    elsewhere = [w.scene for w in crew if w is not None and w is not worker]
                    unit = queue.take(worker.scene if worker else None, elsewhere)
                    if unit is not None:
                        crew[i] = worker = worker or _Worker(plan, frames, make)
                        worker.give(unit, queue.scene(unit))
            busy = {w.connection: w for w in crew if w is not None and w.unit is not None}
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
                    crew[crew.index(worker)] = None
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
                    queue.put_back(done)
    finally:
        for worker in crew:
            if worker is not None:
                worker.end(at_once=worker.unit is not None)


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
def _born() -> Iterator[None]:
    """Processes started meanwhile use one thread and never hear of Ctrl-C: both must be so before they run anything."""
    before = {key: os.environ.get(key) for key in _ONE_THREAD}
    resource_tracker.ensure_running()  # started with the first process, it would let the signal through
    with held_back(signal.SIGINT):
        os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
        try:
            yield
        finally:
            for key, value in before.items():
                if value is None:
                    del os.environ[key]
                else:
                    os.environ[key] = value
