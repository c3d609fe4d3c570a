"""Where a run stands: a count kept beside its journal while it goes, for others to look at without disturbing it.

`progress.json` is replaced as a whole about once a second. It is believed while the journal is as long as it says, or
was a moment ago; else the journal is counted. A run that goes on counts its journal in any case.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import Field, FiniteFloat, TypeAdapter, ValidationError

from conespot.campaigns.journal import FILE as JOURNAL
from conespot.campaigns.journal import Entry, whole_lines
from conespot.campaigns.lock import is_taken
from conespot.campaigns.plain_file import open_plain
from conespot.campaigns.row import Stated
from conespot.scene import InputError
from conespot.scene.model import Model

FILE = "progress.json"
#: a count of a run that goes is at most that old [s]
_FRESH = 10.0
_MOST_BYTES = 1_000_000
_MOST_REASONS = 50
_OTHER = "other reasons"

_Number = Annotated[int, Field(ge=0, le=10**15)]
_Reasons = Annotated[dict[str, _Number], Field(max_length=_MOST_REASONS + 1)]
_Positive = Annotated[FiniteFloat, Field(ge=0.0)]


class Standing(Model):
    """How far a run is. `poses` are planned, `finished` ones stand in the journal, `lost` ones among them by reason.

    `answers` are those of the localizers so far, `failed` ones among them by reason. `pace` is in poses a second and
    `left_s` [s], None where the run does not go, or is too young to know. `at` is the time of the count [s].
    """

    poses: _Number
    journal_bytes: _Number
    finished: _Number
    lost: _Reasons
    answers: _Number
    failed: _Reasons
    pace: _Positive | None = None
    left_s: _Positive | None = None
    at: FiniteFloat


class Count:
    """The finished units of a run, counted as they come in."""

    def __init__(self, entries: Iterable[Entry]) -> None:
        self._finished = self._answers = 0
        self._lost: Counter[str] = Counter()
        self._failed: Counter[str] = Counter()
        for entry in entries:
            self._add(entry, 1)

    def replace(self, before: Entry | None, entry: Entry) -> None:
        """A unit is finished, perhaps not for the first time."""
        if before is not None:
            self._add(before, -1)
        self._add(entry, 1)

    def _add(self, entry: Entry, sign: int) -> None:
        self._finished += sign
        self._answers += sign * entry.answers
        if entry.error:
            self._lost[entry.error] += sign
        for reason in entry.reasons:
            self._failed[reason] += sign

    def standing(self, poses: int, journal_bytes: int, pace: float | None, left_s: float | None) -> Standing:
        """Where a run of that many poses stands now."""
        return Standing(
            poses=poses,
            journal_bytes=journal_bytes,
            finished=self._finished,
            lost=_most(self._lost),
            answers=self._answers,
            failed=_most(self._failed),
            pace=pace,
            left_s=left_s,
            at=time.time(),
        )


def read_standing(folder: Path) -> tuple[Standing | None, bool]:
    """Where a run stands, and whether a process works on it; None if nothing says how many poses it has.

    Raises InputError for a folder that is no run.
    """
    journal = folder / JOURNAL
    try:
        running, size = is_taken(journal), journal.stat().st_size
        kept = _read(folder / FILE)
        if kept is None:
            return None, running
        fresh = running and kept.journal_bytes <= size and 0.0 <= time.time() - kept.at <= _FRESH
        if not (fresh or kept.journal_bytes == size):
            kept = Count(_glance(journal).values()).standing(kept.poses, size, kept.pace, kept.left_s)
    except OSError as error:
        raise InputError(f"{folder}: is no run folder: {journal.name}: {error.strerror}") from None
    return kept, running


@dataclass(frozen=True, slots=True)
class _Found:
    reason: str = ""


@dataclass(frozen=True, slots=True)
class _Line:
    """What a count needs of a line; it leaves the rest alone."""

    unit: str
    error: str = ""
    findings: tuple[_Found, ...] = ()


_LINE = TypeAdapter(_Line)


def _glance(journal: Path) -> Mapping[str, Entry]:
    """The units of a journal, without asking whether they are those of its campaign."""
    entries: dict[str, Entry] = {}
    with open_plain(journal) as stream:
        for body in whole_lines(stream):
            try:
                line = _LINE.validate_json(body)
            except ValidationError:
                continue
            reasons = tuple(found.reason for found in line.findings if found.reason)
            entries[line.unit] = Entry(0, 0, line.error, "", len(line.findings), reasons, Stated())
    return entries


def _read(path: Path) -> Standing | None:
    """A kept count; None for one that is not there or is none."""
    try:
        with open_plain(path) as stream:
            return Standing.model_validate_json(stream.read(_MOST_BYTES))
    except (OSError, ValidationError):
        return None


def _most(reasons: Counter[str]) -> dict[str, int]:
    """The most frequent reasons, and how many others."""
    counted = [(reason, count) for reason, count in reasons.most_common() if count > 0]
    others = sum(count for _, count in counted[_MOST_REASONS:])
    return dict(counted[:_MOST_REASONS]) | ({_OTHER: others} if others else {})
