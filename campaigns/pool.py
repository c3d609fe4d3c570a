"""The workers of this machine: one scene each, fed unit by unit, and replaced when they die.

A unit whose code raises, or that loses its worker twice, becomes a record with an error.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import wait
from pathlib import Path
from typing import assert_never

from conespot.campaigns.ending import RunError
from conespot.campaigns.interruption import interruption
from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.row import Record
from conespot.campaigns.worker import Done, Lost, MakeBench, Note, Refused, Worker, make_bench

#: workers lost in a row, with nothing ever finished, after which the machine is to blame and not the units: a unit is
#: tried twice, so two units that kill whoever takes them, and the machine may still be sound, lose as many
_HOPELESS = 4
_REMEDY = "try `campaign doctor`"
#: how often an interruption is looked for [s]
_GLANCE = 0.2


@dataclass(frozen=True)
class LocalPool:
    """An executor: up to that many processes of this machine."""

    workers: int = 1
    make: MakeBench = make_bench

    def execute(
        self, plan: Plan, units: Iterable[Unit], *, frames: Path | None, note: Callable[[str], None]
    ) -> Generator[Record]:
        """Records of the units as they are finished, in any order. `note` is told of lost workers.

        Raises RunError if workers cannot start. Ends early when an interruption is asked for. Closing the iterator
        stops the workers.
        """
        waiting = list(units)
        places = max(1, min(self.workers, len(waiting)))
        crew = _Crew(plan, waiting, places, note, lambda: Worker(plan, frames, self.make))
        try:
            while not interruption.asked and crew.hand_out():
                for worker in crew.wait():
                    record = crew.hear(worker)
                    if record is not None:
                        yield record
        finally:
            crew.end()


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


class _Crew:
    """Workers at their places, what they are busy with, and what became of those that were lost."""

    def __init__(
        self, plan: Plan, units: Iterable[Unit], places: int, note: Callable[[str], None], hire: Callable[[], Worker]
    ) -> None:
        self._plan, self._note, self._hire = plan, note, hire
        self._queue = _Queue(plan, units)
        self._places: list[Worker | None] = [None] * places
        self._noted: set[str] = set()
        self._suspects: set[str] = set()
        self._lost, self._finished = 0, False

    def _workers(self) -> Iterator[Worker]:
        return (worker for worker in self._places if worker is not None)

    def hand_out(self) -> bool:
        """Give every idle worker a unit, hiring where a place is empty; False when nobody is busy any more."""
        for i, worker in enumerate(self._places):
            if worker is not None and worker.unit is not None:
                continue
            elsewhere = [other.scene for other in self._workers() if other is not worker]
            unit = self._queue.take(worker.scene if worker else None, elsewhere)
            if unit is not None:
                self._places[i] = worker = worker or self._hire()
                worker.give(unit, self._queue.scene(unit))
        return any(worker.unit is not None for worker in self._workers())

    def wait(self) -> list[Worker]:
        """The busy workers that have something to say; waits for one, but not for long."""
        busy = [worker for worker in self._workers() if worker.unit is not None]
        ready = wait([worker.connection for worker in busy], _GLANCE)
        return [worker for worker in busy if worker.connection in ready]

    def hear(self, worker: Worker) -> Record | None:
        """What a worker says: a record, or something to note. Raises RunError if there is no hope for the others."""
        message = worker.hear()
        match message:
            case Note(sentence):
                if sentence not in self._noted:
                    self._note(sentence)
                self._noted.add(sentence)
                return None
            case Refused(reason):
                raise RunError(f"{reason}; {_REMEDY}")
            case Done(record, last):
                self._finished, worker.unit = True, None
                if last:
                    self._dismiss(worker)
                return record
            case Lost(how):
                return self._give_up_or_try_again(worker, how)
            case never:
                assert_never(never)

    def _give_up_or_try_again(self, worker: Worker, how: str) -> Record | None:
        self._lost += 1
        if self._lost == _HOPELESS and not self._finished:
            raise RunError(f"no worker lives to finish anything, the last {how}; {_REMEDY}")
        unit, worker.unit = worker.unit, None
        self._dismiss(worker)
        assert unit is not None, "only busy workers are heard"
        if unit.key in self._suspects:
            self._note(f"a worker {how} at {self._plan.says(unit)} again; its frames are recorded as failed")
            return Record(unit=unit.key, error=f"the worker {how}, twice")
        self._note(f"a worker {how} at {self._plan.says(unit)}; trying that pose once more")
        self._suspects.add(unit.key)
        self._queue.put_back(unit)
        return None

    def _dismiss(self, worker: Worker) -> None:
        self._places[self._places.index(worker)] = None
        worker.end()

    def end(self) -> None:
        """Stop everybody, at once who is busy."""
        for worker in self._workers():
            worker.end(at_once=worker.unit is not None)
