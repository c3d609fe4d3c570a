"""Who wants to know how a session goes: the terminal, the log, and the count that is kept beside the journal."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence

from conespot.campaigns.log import Log
from conespot.campaigns.maker import Makers, in_a_line, maker
from conespot.campaigns.plan import Unit
from conespot.campaigns.progress import Progress
from conespot.campaigns.row import Record
from conespot.campaigns.store import Store

#: how often the count beside the journal is renewed [s]
_OFTEN = 1.0


class Watch:
    """Tells of a session that does the units that are `left` of all its `units`; begins with where it stands."""

    def __init__(self, store: Store, units: Sequence[Unit], left: Sequence[Unit], log: Log | None) -> None:
        self._store, self._log = store, log
        self._left = {unit.key: unit for unit in left}
        groups = [store.plan.groups[unit.group] for unit in left]
        self._progress = Progress(sum(g.frames for g in groups), sum(g.work for g in groups), sys.stderr)
        begun = in_a_line(store.begun_with)
        self._makers = Makers(entry.by or begun for entry in store.entries.values())
        self._kept = time.monotonic()
        if log is not None:
            log.complain = self._progress.note
        self._begin(units)

    def _begin(self, units: Sequence[Unit]) -> None:
        for sentence in self._store.damage:
            self.note(sentence)
        entries = [entry for entry in (self._store.entries.get(unit.key) for unit in units) if entry is not None]
        if entries:
            finished = sum(not entry.error for entry in entries)
            self.note(f"{self._store.folder}: {finished} of {len(units)} poses are finished, continuing", "info")
        else:
            groups = [self._store.plan.groups[unit.group] for unit in units]
            words = f"{sum(g.frames for g in groups)} frames, {sum(g.rows for g in groups)} localizations"
            self.note(f"{self._store.folder}: {len(units)} poses, {words}", "info")
        if self._left and (another := self._makers.expect(maker())):
            self.note(another)

    def note(self, sentence: str, level: str = "warning") -> None:
        """Say something that must not be lost."""
        self._progress.note(sentence)
        if self._log is not None:
            self._log.write(level, "note", reason=sentence)

    def finished(self, record: Record) -> None:
        """A unit is finished and kept."""
        if another := self._makers.meet(record.by):
            self.note(another)
        unit = self._left[record.unit]
        group = self._store.plan.groups[unit.group]
        self._progress.update(group.frames, group.work, sum(bool(found.reason) for found in record.findings))
        if self._log is not None:
            self._log.record(self._store.plan, unit, record)
        if time.monotonic() - self._kept > _OFTEN:
            self._kept = time.monotonic()
            self._store.keep_standing(self._progress.pace(), self._progress.remaining())

    def close(self) -> None:
        """The session is at its end."""
        self._progress.close()
