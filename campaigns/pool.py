"""The workers of this machine: one scene each, fed unit by unit, and replaced when they die.

A unit whose code raises, or that loses its worker twice, becomes a record with an error.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import wait
from pathlib import Path
from typing import assert_never

from conespot.campaigns.ending import RunError
from conespot.campaigns.executor import Executor
from conespot.campaigns.interruption import interruption
from conespot.campaigns.losses import REMEDY, Losses
from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.row import Record
from conespot.campaigns.waiting import Waiting
from conespot.campaigns.worker import POSE_LIMIT_S, Done, Lost, MakeBench, Note, Refused, Worker, make_bench

#: how often an interruption is looked for [s]
_GLANCE = 0.2
#: a worker whose poses take longer [s] waits for us a negligible time
_QUICK_S = 1.0


@dataclass(frozen=True)
class LocalPool:
    """An executor: up to that many processes of this machine. A pose that takes longer than `limit_s` [s] is lost."""

    workers: int = 1
    make: MakeBench = make_bench
    limit_s: float = POSE_LIMIT_S

    def execute(
        self, plan: Plan, units: Iterable[Unit], *, frames: Path | None, note: Callable[[str], None]
    ) -> Generator[Record]:
        """Records of the units as they are finished, in any order. `note` is told of lost workers.

        Raises RunError if workers cannot start. Ends early when an interruption is asked for. Closing the iterator
        stops the workers.
        """
        with self.staying() as crew:
            yield from crew.execute(plan, units, frames=frames, note=note)

    @contextlib.contextmanager
    def staying(self) -> Iterator[Executor]:
        """An executor whose workers stay when their units are finished, for more units of the same plan."""
        crew = _Crew(self)
        try:
            yield crew
        finally:
            crew.end()


class _Crew:
    """Workers at their places, what they are busy with, and what became of those that were lost."""

    def __init__(self, pool: LocalPool) -> None:
        self._pool = pool
        self._places: list[Worker | None] = [None] * max(1, pool.workers)
        self._noted: set[str] = set()

    def execute(
        self, plan: Plan, units: Iterable[Unit], *, frames: Path | None, note: Callable[[str], None]
    ) -> Generator[Record]:
        """As `LocalPool.execute`. Who is busy when this ends is stopped, and nobody else."""
        self._hire: Callable[[], Worker] = lambda: Worker(plan, frames, self._pool.make)
        self._note, self._waiting = note, Waiting(plan, units)
        self._losses = Losses(plan, self._waiting, note)
        try:
            while not interruption.asked and self.hand_out():
                for worker in self.wait():
                    record = self.hear(worker)
                    if record is not None:
                        yield record
                yield from self.lose_the_slow()
        finally:
            self._stop_the_busy()

    def _workers(self) -> Iterator[Worker]:
        return (worker for worker in self._places if worker is not None)

    def hand_out(self) -> bool:
        """Give every idle worker a unit, hiring where a place is empty; False when nobody is busy any more.

        One that is quick has another before it is idle, so that it need not wait for us.
        """
        for i, worker in enumerate(self._places):
            if worker is not None and worker.unit is not None:
                continue
            elsewhere = [other.scene for other in self._workers() if other is not worker]
            scene = self._waiting.next_scene(worker.scene if worker else None, elsewhere)
            if scene is not None:
                self._places[i] = worker = worker or self._hire()
                worker.give(self._waiting.take(scene)[0], scene)
        for worker in self._workers():
            idle_soon = worker.unit is not None and worker.next is None and worker.took < _QUICK_S
            if idle_soon and worker.scene is not None and self._waiting.many(worker.scene, len(self._places)):
                worker.give(self._waiting.take(worker.scene)[0], worker.scene)
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
                raise RunError(f"{reason}; {REMEDY}")
            case Done(record, last):
                self._losses.finished = True
                worker.finish()
                if last:
                    self._dismiss(worker)
                return record
            case Lost(how):
                return self._lose(worker, how)
            case never:
                assert_never(never)

    def lose_the_slow(self) -> Iterator[Record]:
        """Stop the workers whose pose takes too long, as if they had died of it; records of what is given up."""
        for worker in list(self._workers()):
            if worker.unit is not None and worker.since > self._pool.limit_s:
                record = self._lose(worker, f"took longer than {self._pool.limit_s:g} s", at_once=True)
                if record is not None:
                    yield record

    def _lose(self, worker: Worker, how: str, at_once: bool = False) -> Record | None:
        unit = worker.unit
        assert unit is not None, "only busy workers are heard"
        worker.finish()
        self._dismiss(worker, at_once)
        return self._losses.lost([unit], how)

    def _dismiss(self, worker: Worker, at_once: bool = False) -> None:
        """Stop a worker; what it was to go on with waits again."""
        self._places[self._places.index(worker)] = None
        self._waiting.put_back([worker.unit] if worker.unit else [])
        worker.end(at_once)

    def _stop_the_busy(self) -> None:
        for worker in list(self._workers()):
            if worker.unit is not None:
                self._dismiss(worker, at_once=True)

    def end(self) -> None:
        """Stop everybody."""
        self._stop_the_busy()
        for worker in self._workers():
            worker.end()
