"""The log of a run for other programs: a JSON object a line with time, level, event, and the case and pose it is of."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.row import Record
from conespot.scene import InputError


class Log:
    """A file that lines are appended to; a run goes on without it when it can no longer be written.

    Raises InputError if it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        #: is told, once, that the file can no longer be written
        self.complain: Callable[[str], object] = sys.stderr.write
        try:
            self._file: int | None = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
        except OSError as error:
            raise InputError(f"--log {path}: cannot be written: {error.strerror}") from None

    def write(self, level: str, event: str, **fields: str | int) -> None:
        """Append a line."""
        if self._file is None:
            return
        time = datetime.now(UTC).isoformat(timespec="milliseconds")
        line = json.dumps({"time": time, "level": level, "event": event, **fields})
        try:
            os.write(self._file, f"{line}\n".encode())
        except OSError as error:
            os.close(self._file)
            self._file = None
            self.complain(f"--log {self._path}: cannot be written: {error.strerror}; the run goes on without it")

    def record(self, plan: Plan, unit: Unit, record: Record) -> None:
        """Append what became of a unit: a line for the pose, or one for each case that lost it, and one for every
        localizer that found nothing.
        """
        cases = plan.groups[unit.group].cases
        if not record.error:
            self.write("info", "finished", case=cases[0].key, pose=unit.pose, localizations=len(record.findings))
        for case in cases if record.error else ():
            self.write("error", "lost", case=case.key, pose=unit.pose, reason=record.error)
        for found in record.findings:
            if found.reason:
                self.write(
                    "warning",
                    "not localized",
                    case=found.case,
                    pose=unit.pose,
                    localizer=found.localizer,
                    reason=found.reason,
                )
