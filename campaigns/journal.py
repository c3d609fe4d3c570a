"""The journal of a run: a line a finished unit, each on the disk before the next, none ever changed or removed.

A line is a JSON object that begins with the CRC-32 of all that follows it, `{"crc":"1a2b3c4d",`; then come the unit,
`by` what made it, and its findings or its error. A line that is torn, altered, or no unit of the plan is named and
left where it is, and its unit runs again. Of several lines of a unit the last counts. Lines without a checksum are
those of earlier versions, and believed if they are units of the plan.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from pydantic import ValidationError

from conespot.campaigns.plan import Plan
from conespot.campaigns.row import Record, Stated

FILE = "journal.jsonl"
_MARK = b'{"crc":"'  # nothing in a line looks like it: within JSON's texts a quotation mark is escaped
_HEAD = re.compile(rb'\{"crc":"([0-9a-f]{8})",')
_UNCHECKED = b'{"unit":"'
#: a finding with its longest reason and a covariance is shorter
_LONGEST_FINDING = 8192
#: no line is longer, whatever its campaign
_LONGEST = 200_000_000


@dataclass(frozen=True, slots=True)
class Entry:
    """A finished unit: where its line stands, what lost it, who made it, its answers and why some are failures.

    `stated` are the columns that its answers' own statements fill.
    """

    offset: int
    length: int
    error: str
    by: str
    answers: int
    reasons: tuple[str, ...]
    stated: Stated


class Journal:
    """The finished units of a plan, in the file `stream`, which was opened for reading, and "a+b" to append.

    `entries` are the units by their key; `damage` names the lines that are none.
    """

    def __init__(self, path: Path, plan: Plan, stream: IO[bytes]) -> None:
        self.path = path
        self.entries: dict[str, Entry] = {}
        self.damage: list[str] = []
        self._stream = stream
        self._stated: dict[Stated, Stated] = {}
        self._answers = {
            group.key: (len(group.positions), Counter((c.key, name) for c in group.cases for name in c.localizers))
            for group in plan.groups
        }
        longest = max((group.rows for group in plan.groups), default=0) + 1
        self._longest = min(longest * _LONGEST_FINDING, _LONGEST)
        self._whole = True  #: the file ends with a line's end
        self._read()

    def append(self, records: Iterable[Record]) -> None:
        """Write finished units: they are on the disk when this returns. Raises OSError."""
        fresh: dict[str, Entry] = {}
        for record in records:
            length = self._write(record)
            fresh[record.unit] = self._entry(record, self.size - length, length)
        os.fsync(self._stream.fileno())
        self.entries.update(fresh)

    def _write(self, record: Record) -> int:
        """Write a line; its length."""
        line, file = encode(record), self._stream.fileno()
        # a line that was torn ends here, so that this one begins its own
        data = line if self._whole else b"\n" + line
        written = 0
        try:
            while written < len(data):  # not through a buffer, which would try again when it is closed
                written += os.write(file, data[written:])
        finally:
            self._whole = written == len(data) or (self._whole and not written)
        return len(line)

    def record(self, unit: str) -> Record:
        """The record of a finished unit, read again. Raises KeyError for one that is not finished."""
        entry = self.entries[unit]
        self._stream.seek(entry.offset)
        return Record.model_validate_json(_json(self._stream.read(entry.length)))

    def records(self) -> Iterator[Record]:
        """The records of all finished units, one after the other."""
        return (self.record(unit) for unit in self.entries)

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return os.fstat(self._stream.fileno()).st_size

    def _read(self) -> None:
        """Read what the file holds now."""
        for number, offset, line, ended in _lines(self._stream, self._longest):
            self._whole = ended
            wrong = self._take(line, offset)
            if wrong is None:
                continue
            if not ended:
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

    def _take(self, line: bytes, offset: int) -> str | None:
        """Keep the unit of a line, or say what is wrong with it."""
        try:
            record = Record.model_validate_json(_json(line))
        except ValidationError:
            return "holds no finished pose"
        except ValueError as error:
            return str(error)
        if not self._planned(record):
            return "is no pose of this campaign"
        self.entries[record.unit] = self._entry(record, offset, len(line))
        return None

    def _planned(self, record: Record) -> bool:
        group, _, pose = record.unit.rpartition("-")
        count, answers = self._answers.get(group, (0, Counter()))
        known = pose.isdecimal() and str(int(pose)) == pose and int(pose) < count
        return known and (bool(record.error) or Counter((f.case, f.localizer) for f in record.findings) == answers)

    def _entry(self, record: Record, offset: int, length: int) -> Entry:
        reasons = tuple(sys.intern(found.reason) for found in record.findings if found.reason)
        stated = Stated.among(record.findings)
        stated = self._stated.setdefault(stated, stated)  # one of each kind is enough
        error, by, answers = sys.intern(record.error), sys.intern(record.by), len(record.findings)
        return Entry(offset, length, error, by, answers, reasons, stated)


def encode(record: Record) -> bytes:
    """A record as a line with its checksum."""
    body = record.model_dump_json(exclude_defaults=True).encode()[1:]
    return b'%s%08x",%s\n' % (_MARK, zlib.crc32(body), body)


def whole_lines(stream: IO[bytes]) -> Iterator[bytes]:
    """The JSON of a journal's lines whose checksum holds, whatever campaign they are of."""
    for _, _, line, _ in _lines(stream, _LONGEST):
        with contextlib.suppress(ValueError):
            yield _json(line)


def _lines(stream: IO[bytes], longest: int) -> Iterator[tuple[int, int, bytes, bool]]:
    """Number, place and bytes of the lines, of one that is too long its beginning, and whether they end as lines do."""
    stream.seek(0)
    number = offset = 0
    while line := stream.readline(longest):
        number, at, begins = number + 1, offset, line
        offset += len(line)
        while not line.endswith(b"\n") and (line := stream.readline(longest)):
            offset += len(line)
        yield number, at, begins, line.endswith(b"\n")


def _json(line: bytes) -> bytes:
    """The JSON of a record in a line. Raises ValueError if the line is none or is not what was written."""
    head = _HEAD.match(line)
    if head is None:
        if line.startswith(_UNCHECKED):
            return line
        raise ValueError("is no line of a journal")
    body = line.removesuffix(b"\n")[head.end() :]
    if int(head[1], 16) != zlib.crc32(body):
        raise ValueError("does not match its checksum")
    return b"{" + body
