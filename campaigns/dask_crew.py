"""The Dask workers of a run: who is there, what they are busy with, and what became of those that were lost.

Every task is bound to a worker and Dask repeats none: a batch whose worker is lost is split into its poses, and a pose
that alone takes two workers is given up. A worker of other software or another Mitsuba variant gets nothing to do.
"""

from __future__ import annotations

import contextlib
import math
import queue
import statistics
import threading
import time
import uuid
from collections.abc import Callable
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from conespot.campaigns.arrival import keep_frames, records_of
from conespot.campaigns.ending import RunError
from conespot.campaigns.losses import REMEDY, Losses
from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.profile import Profile
from conespot.campaigns.row import Record
from conespot.campaigns.software import software
from conespot.campaigns.waiting import Waiting

if TYPE_CHECKING:
    from distributed import Client, Future

    from conespot.campaigns.dask_worker import Answer, Errand, Welcome

_GLANCE = 0.2  #: how often an interruption is looked for [s]
_ROLL_CALL = 1.0  #: how often we ask who is there [s]
_PATIENCE = 60.0  #: how long a scheduler may take to answer, or a worker to be replaced [s]
_ENTRY_S = 600.0  #: how long a worker may take to import what it needs [s]
#: what a batch should take [s]: long beside the hundredth of a second that a task costs, short beside what one who dies
#: makes others repeat
_BATCH_S = 2.0
_MOST = 500


@dataclass
class _Hand:
    """A worker: what it is busy with since when [s], if anything, and what it has loaded."""

    address: str
    welcome: Welcome | None = None
    refused: str = ""
    task: Future | None = None
    batch: list[Unit] = field(default_factory=list)
    since: float = 0.0
    scene: str | None = None

    @property
    def idle(self) -> bool:
        return self.task is None and not self.refused


class Crew:
    """Who is there, what they are busy with, and what became of those that were lost."""

    def __init__(
        self,
        client: Client,
        plan: Plan,
        waiting: Waiting,
        errand: Errand,
        note: Callable[[str], None],
        profile: Profile,
    ) -> None:
        self._client, self._plan, self._waiting, self._errand, self._profile = client, plan, waiting, errand, profile
        self._note, self._noted = note, set[str]()
        self._losses = Losses(plan, waiting, note)
        self._hands: dict[str, _Hand] = {}
        self._left: set[str] = set()  #: addresses of workers that we have given up while they are still there
        self._tasks: dict[str, _Hand] = {}
        self._done: queue.SimpleQueue[Future] = queue.SimpleQueue()
        self._variant = profile.variant
        self._pace: dict[str, float] = {}
        self._called = -math.inf

    def hand_out(self) -> bool:
        """Give every idle worker a batch; False when nothing waits and nobody is busy with a batch any more."""
        for hand in self._hands.values():
            if not hand.idle or not len(self._waiting):
                continue
            if hand.welcome is None:
                self._start(hand, "enter", self._errand)
                continue
            elsewhere = [other.scene for other in self._hands.values() if other is not hand]
            scene = self._waiting.next_scene(hand.scene, elsewhere)
            if scene is not None:
                hand.batch, hand.scene = self._waiting.take(scene, self._size(scene, hand.welcome)), scene
                self._start(hand, "measure", self._errand.session, hand.batch)
        return bool(len(self._waiting)) or any(hand.batch for hand in self._hands.values())

    def _size(self, scene: str, welcome: Welcome) -> int:
        """How many poses a batch should hold: at the end few, so that all finish together."""
        if not welcome.sees_frames or scene not in self._pace:
            return 1
        share = math.ceil(len(self._waiting) / (2 * len(self._hands)))
        return max(1, min(_MOST, share, int(_BATCH_S / max(self._pace[scene], 1e-6))))

    def _start(self, hand: _Hand, what: str, *arguments: object) -> None:
        from conespot.campaigns import dask_worker

        key = f"conespot-{what}-{uuid.uuid4().hex}"
        hand.since = time.monotonic()
        hand.task = self._client.submit(
            getattr(dask_worker, what), *arguments, key=key, workers=[hand.address], retries=0, pure=False
        )
        self._tasks[key] = hand
        hand.task.add_done_callback(self._done.put)

    def hear(self) -> list[Record]:
        """What became of tasks, once there is any or a moment has passed; who is free has a new batch by then."""
        records = self._call_the_roll()
        with contextlib.suppress(queue.Empty):
            task = self._done.get(timeout=_GLANCE)
            while True:
                records += self._ended(task)
                task = self._done.get_nowait()
        for hand in list(self._hands.values()):
            limit = self._profile.pose_limit if hand.batch else max(self._profile.pose_limit, _ENTRY_S)
            if hand.task is not None and time.monotonic() - hand.since > limit:
                records += self._lose(hand, f"took longer than {limit:g} s", replace=True)
        self.hand_out()
        return records

    def _call_the_roll(self) -> list[Record]:
        """See who came and who went, now and then; records of what is given up."""
        if time.monotonic() - self._called < _ROLL_CALL:
            return []
        try:
            there = self._client.nthreads(callback_timeout=_PATIENCE)
        except (OSError, RuntimeError):
            raise self._alone() from None
        self._called = time.monotonic()
        self._left &= there.keys()
        for address in there.keys() - self._hands.keys() - self._left:
            self._hands[address] = _Hand(address)
            if there[address] > 1:
                self._say("a pose takes one thread: of workers with more, started without `--nthreads 1`, one is used")
        if not there:
            self._say("there is no worker yet; waiting for the first")
        return [r for a in self._hands.keys() - there.keys() for r in self._lose(self._hands[a], "was lost")]

    def _ended(self, task: Future) -> list[Record]:
        """What a task gave: records of its batch, or of what is given up."""
        from distributed import KilledWorker

        from conespot.campaigns.dask_worker import Answer, NotAtHomeError

        hand = self._tasks.pop(task.key, None)
        if hand is None:
            return []
        try:
            found: Answer | Welcome = task.result(timeout=_PATIENCE)
        except (KilledWorker, TimeoutError):
            return self._lose(hand, "was lost")
        except CancelledError:
            raise self._alone() from None
        except NotAtHomeError:
            self._waiting.put_back(hand.batch)
            hand.task, hand.batch, hand.welcome = None, [], None
            return []
        except Exception as error:
            if hand.welcome is not None:
                return self._lose(hand, f"failed with {type(error).__name__}", replace=True)
            self._refuse(hand, f"it cannot take part: {type(error).__name__}: {' '.join(str(error).split())[:300]}")
            return []
        hand.task = None
        if isinstance(found, Answer):
            return self._answered(hand, found)
        self._welcomed(hand, found)
        return []

    def _welcomed(self, hand: _Hand, welcome: Welcome) -> None:
        """Let a worker take part whose answers will be those of all others."""
        hand.welcome, ours = welcome, software()
        other = [
            f"{k} {welcome.software.get(k, 'missing')}, not {v}"
            for k, v in ours.items()
            if welcome.software.get(k) != v
        ]
        if welcome.refusal or other:
            self._refuse(hand, welcome.refusal or f"it has {', '.join(other)}")
            return
        self._variant = self._variant or welcome.variant
        if welcome.variant != self._variant:
            self._refuse(hand, f"it renders with {welcome.variant}, not {self._variant}")
        for sentence in welcome.warnings:
            self._say(sentence)

    def _refuse(self, hand: _Hand, reason: str) -> None:
        hand.task, hand.refused = None, reason
        self._say(f"the worker {hand.address} is not used: {reason}")
        if all(other.refused for other in self._hands.values()):
            raise RunError(f"no worker can be used; {hand.address}: {reason}; {REMEDY} there")

    def _answered(self, hand: _Hand, answer: Answer) -> list[Record]:
        batch, hand.batch = hand.batch, []
        self._losses.finished = True
        if hand.scene is not None and answer.seconds:
            self._pace[hand.scene] = statistics.median(answer.seconds)
        keep_frames(answer.frames, self._errand.frames)
        if answer.worn:
            self._part_with(hand)
        return records_of(self._plan, batch, answer.records)

    def _lose(self, hand: _Hand, how: str, replace: bool = False) -> list[Record]:
        """Go on without a worker, and with what it was busy with; records of what is given up."""
        batch, hand.batch = hand.batch, []
        if replace:
            self._part_with(hand)
        else:
            self._forget(hand)
        record = self._losses.lost(batch, how) if batch else None
        return [record] if record else []

    def _forget(self, hand: _Hand) -> None:
        del self._hands[hand.address]
        if hand.task is not None:
            self._tasks.pop(hand.task.key, None)
            with contextlib.suppress(OSError, RuntimeError):
                hand.task.cancel()

    def _part_with(self, hand: _Hand) -> None:
        """Have a worker's process replaced by its nanny, without waiting for that; one without a nanny just ends."""
        self._forget(hand)
        self._left.add(hand.address)

        def restart() -> None:
            with contextlib.suppress(Exception):  # it gets nothing to do whatever becomes of it
                self._client.restart_workers([hand.address], timeout=_PATIENCE, raise_for_error=False)

        threading.Thread(target=restart, daemon=True).start()

    def _alone(self) -> RunError:
        where = self._client.scheduler.address if self._client.scheduler else "Dask"
        return RunError(
            f"{where}: the scheduler is gone; what is finished is kept, and the same command continues the run"
        )

    def _say(self, sentence: str) -> None:
        if sentence not in self._noted:
            self._noted.add(sentence)
            self._note(sentence)

    def end(self) -> None:
        """Let go of what is still being done."""
        for hand in list(self._hands.values()):
            self._forget(hand)
