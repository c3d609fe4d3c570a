"""The journal of a run: a line a finished unit, each on the disk before the next, none ever changed or removed.

A line is a JSON object that begins with the CRC-32 of all that follows it, `{"crc":"1a2b3c4d",`; then come the unit,
`by` what made it, and its findings or its error. A line that is torn, altered, or no unit of the plan is named and
left where it is, and its unit runs again. Of several lines of a unit the last counts. Lines without a checksum are
those of earlier versions, and believed if they are units of the plan.
"""

from __future__ import annotations

import os
import re
import sys
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from conespot.campaigns.plan import Plan
from conespot.campaigns.row import Record

FILE = "journal.jsonl"
_MARK = b'{"crc":"'  # nothing in a line looks like it: within JSON's texts a quotation mark is escaped
_HEAD = re.compile(rb'\{"crc":"([0-9a-f]{8})",')
_UNCHECKED = b'{"unit":"'
#: a finding with its longest reason and a covariance is shorter
_LONGEST_FINDING = 8192


@dataclass(frozen=True, slots=True)
class Entry:
    """A finished unit: where its line stands, what lost it, who made it, and why which of its findings failed."""

    offset: int
    length: int
    error: str
    by: str
    reasons: tuple[str, ...]


class Journal:
    """The finished units of a plan, in the file `stream`, which was opened for reading, and "a+b" to append.

    `entries` are the units by their key; `damage` names the lines that are none.
    """

    def __init__(self, path: Path, plan: Plan, stream: IO[bytes]) -> None:
        self.path = path
        self.entries: dict[str, Entry] = {}
        self.damage: list[str] = []
        self._stream = stream
        self._answers = {
            group.key: (len(group.positions), Counter((c.key, name) for c in group.cases for name in c.localizers))
            for group in plan.groups
        }
        self._longest = _LONGEST_FINDING * (1 + max((group.rows for group in plan.groups), default=0))
        self._whole = True  #: the file ends with a line's end
        self._read()

    def append(self, record: Record) -> None:
        """Write a finished unit: it is on the disk when this returns. Raises OSError."""
        line, file = encode(record), self._stream.fileno()
        # a line that was torn ends here, so that this one begins its own
        data = line if self._whole else b"\n" + line
        written = 0
        try:
            while written < len(data):  # not through a buffer, which would try again when it is closed
                written += os.write(file, data[written:])
        finally:
            self._whole = written == len(data) or (self._whole and not written)
        os.fsync(file)
        self._keep(record, os.fstat(file).st_size - len(line), len(line))

    def record(self, unit: str) -> Record:
        """The record of a finished unit, read again. Raises KeyError for one that is not finished."""
        entry = self.entries[unit]
        self._stream.seek(entry.offset)
        return Record.model_validate_json(_body(self._stream.read(entry.length)))

    def records(self) -> Iterator[Record]:
        """The records of all finished units, one after the other."""
        return (self.record(unit) for unit in self.entries)

    def _read(self) -> None:
        """Read what the file holds now."""
        for number, offset, line in self._lines():
            wrong = self._take(line, offset)
            if wrong is None:
                continue
            if not self._whole:
                if not self._stream.writable():
                    return  # another process may be writing it
                wrong = "was torn before its end"
            # where the end of a line was lost, the next one is whole, and begins within
            within = line.find(_MARK, 1)
            while within > 0:
                after = line.find(_MARK, within + 1)
                self._take(line[within : after if after > 0 else None], offset + within)
                within = after
            self.damage.append(f"{self.path}:{number}: {wrong}; the line is passed over, and its pose runs again")

    def _lines(self) -> Iterator[tuple[int, int, bytes]]:
        """Number, place and bytes of the lines; of one that is too long its beginning."""
        self._stream.seek(0)
        number = offset = 0
        while line := self._stream.readline(self._longest):
            number, at, begins = number + 1, offset, line
            offset += len(line)
            while not line.endswith(b"\n") and (line := self._stream.readline(self._longest)):
                offset += len(line)
            self._whole = line.endswith(b"\n")
            yield number, at, begins

    def _take(self, line: bytes, offset: int) -> str | None:
        """Keep the unit of a line, or say what is wrong with it."""
        head = _HEAD.match(line)
        body = line.removesuffix(b"\n")
        if head is None and not line.startswith(_UNCHECKED):
            return "is no line of a journal"
        if head is not None and int(head[1], 16) != zlib.crc32(body[head.end() :]):
            return "does not match its checksum"
        try:
            record = Record.model_validate_json(_body(line))
        except ValueError:
            return "holds no finished pose"
        if not self._planned(record):
            return "is no pose of this campaign"
        self._keep(record, offset, len(line))
        return None

    def _planned(self, record: Record) -> bool:
        group, _, pose = record.unit.rpartition("-")
        count, answers = self._answers.get(group, (0, Counter()))
        known = pose.isdecimal() and str(int(pose)) == pose and int(pose) < count
        return known and (bool(record.error) or Counter((f.case, f.localizer) for f in record.findings) == answers)

    def _keep(self, record: Record, offset: int, length: int) -> None:
        reasons = tuple(sys.intern(found.reason) for found in record.findings if found.reason)
        self.entries[record.unit] = Entry(offset, length, record.error, sys.intern(record.by), reasons)


def encode(record: Record) -> bytes:
    """A record as a line with its checksum."""
    body = record.model_dump_json(exclude_defaults=True).encode()[1:]
    return b'%s%08x",%s\n' % (_MARK, zlib.crc32(body), body)


def _body(line: bytes) -> bytes:
    """The JSON of a record in a line, without the checksum."""
    head = _HEAD.match(line)
    return line if head is None else b"{" + line[head.end() :]
