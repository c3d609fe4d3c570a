"""The executor for the workers of Dask, of a machine, a cluster's jobs, or a scheduler that somebody else started."""

from __future__ import annotations

import contextlib
import pickle
import uuid
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from conespot.campaigns.cluster import client_of
from conespot.campaigns.dask_crew import Crew
from conespot.campaigns.interruption import interruption
from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.profile import Profile
from conespot.campaigns.row import Record
from conespot.campaigns.waiting import Waiting
from conespot.campaigns.worker import MakeBench, make_bench


@dataclass(frozen=True)
class DaskCluster:
    """An executor: the workers of a profile."""

    profile: Profile
    make: MakeBench = make_bench

    def execute(
        self, plan: Plan, units: Iterable[Unit], *, frames: Path | None, note: Callable[[str], None]
    ) -> Generator[Record]:
        """Records of the units as they are finished, in any order. `note` is told of workers lost or refused.

        Raises RunError if there is no scheduler, or none any more, or no worker can be used, and InputError without
        Dask. Ends early when an interruption is asked for.
        """
        from conespot.campaigns.dask_worker import Errand

        waiting = Waiting(plan, units)
        with client_of(self.profile) as client, _token(frames) as token:
            errand = Errand(uuid.uuid4().hex, pickle.dumps(plan), self.make, frames and frames.absolute(), token)
            crew = Crew(client, plan, waiting, errand, note, self.profile)
            try:
                while not interruption.asked and crew.hand_out():
                    yield from crew.hear()
            finally:
                crew.end()


@contextlib.contextmanager
def _token(frames: Path | None) -> Iterator[str]:
    """A file in the frames' folder that only those find who see the same folder."""
    if frames is None:
        yield ""
        return
    token = frames / f".seen-{uuid.uuid4().hex}"
    token.touch()
    try:
        yield token.name
    finally:
        token.unlink(missing_ok=True)
