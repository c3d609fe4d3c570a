"""What happens on a Dask worker: it is told the plan once, then measures batches of poses and gives small answers."""

from __future__ import annotations

import pickle
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from distributed import get_worker

from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.software import software
from conespot.campaigns.worker import MakeBench, Measures, made, measured

T = TypeVar("T")


class NotAtHomeError(Exception):
    """This process was never told the plan, or was told another since."""


@dataclass(frozen=True)
class Errand:
    """What a worker is told: the `session` it works for, the pickled plan, and how a bench is made.

    `frames` is where frames are to be kept, and `token` a file there by which a worker knows that it sees that folder.
    """

    session: str
    plan: bytes
    make: MakeBench
    frames: Path | None = None
    token: str = ""


@dataclass(frozen=True)
class Welcome:
    """What a worker is: software, Mitsuba variant, what it warns of, whether it sees the frames' folder.

    With a `refusal` it cannot render.
    """

    software: dict[str, str]
    variant: str = ""
    warnings: tuple[str, ...] = ()
    sees_frames: bool = True
    refusal: str = ""


@dataclass(frozen=True)
class Answer:
    """A batch's records as JSON and the time of each pose [s]; frames by name that could not be put in place.

    A worker that is `worn` asks to be replaced.
    """

    records: tuple[str, ...]
    seconds: tuple[float, ...]
    frames: dict[str, bytes] = field(default_factory=dict)
    worn: bool = False


class _Place:
    """A worker's bench. One thread of its own does everything, since Mitsuba must not be called from several."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(1)
        self._session = ""
        self._bench: Measures | None = None
        self._away: tempfile.TemporaryDirectory[str] | None = None

    def do(self, what: Callable[..., T], *arguments: object) -> T:
        return self._thread.submit(what, *arguments).result()

    def enter(self, errand: Errand) -> Welcome:
        self._bench = self._away = None
        folder = errand.frames
        sees = folder is None or (folder / errand.token).is_file()
        if not sees:
            self._away = tempfile.TemporaryDirectory()
            folder = Path(self._away.name)
        plan: Plan = pickle.loads(errand.plan)
        try:
            self._bench, said = made(errand.make, plan, folder)
        except Exception as error:
            return Welcome(software(), refusal=f"cannot render: {error}")
        self._session = errand.session
        return Welcome(software(), self._bench.variant, tuple(said), sees)

    def measure(self, session: str, batch: Sequence[Unit]) -> Answer:
        if self._bench is None or session != self._session:
            raise NotAtHomeError
        records, seconds = [], []
        for unit in batch:
            begun = time.perf_counter()
            records.append(measured(self._bench, unit).model_dump_json(exclude_defaults=True))
            seconds.append(time.perf_counter() - begun)
        return Answer(tuple(records), tuple(seconds), self._frames(), self._bench.worn)

    def _frames(self) -> dict[str, bytes]:
        if self._away is None:
            return {}
        frames = {}
        for path in sorted(Path(self._away.name).iterdir()):
            frames[path.name] = path.read_bytes()
            path.unlink()
        return frames


#: by the worker's address: several share a process in tests
_PLACES: dict[str, _Place] = {}


def enter(errand: Errand) -> Welcome:
    """Be told the plan, in place of any other."""
    place = _PLACES.setdefault(get_worker().address, _Place())
    return place.do(place.enter, errand)


def measure(session: str, batch: Sequence[Unit]) -> Answer:
    """Measure a batch of the session's plan. Raises NotAtHomeError in a process that was not told it."""
    place = _PLACES.setdefault(get_worker().address, _Place())
    return place.do(place.measure, session, batch)
