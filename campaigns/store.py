"""The run folder: what is finished, safe from a torn write, a second writer and another campaign's rows.

`campaign.yaml` is the campaign as it was resolved, `cases.jsonl` what each of its cases is; both begin the run.
`journal.jsonl` grows by one line per finished unit (conespot.campaigns.journal); everything else in the folder is
written whole or not at all, and can be made again from the journal. Nothing that was measured is ever deleted.
"""

from __future__ import annotations

import contextlib
import io
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from conespot.campaigns import rows_stamp
from conespot.campaigns.cases import write_cases
from conespot.campaigns.ending import RunError
from conespot.campaigns.journal import FILE, Entry, Journal
from conespot.campaigns.lock import take
from conespot.campaigns.maker import in_a_line, made_with, maker
from conespot.campaigns.plain_file import open_plain
from conespot.campaigns.plan import Plan
from conespot.campaigns.row import Record, Stated
from conespot.campaigns.row_table import row_table
from conespot.campaigns.row_text import csv_text
from conespot.campaigns.schema import resolved
from conespot.campaigns.scores import Scores
from conespot.campaigns.standing import FILE as STANDING
from conespot.campaigns.standing import Count, Standing
from conespot.results.makers import FILE as MAKERS
from conespot.scene import InputError
from conespot.scene.atomic import write_atomically
from conespot.scene.document import Document, dump, read_document
from conespot.scene.identity import SCHEMA

if TYPE_CHECKING:
    import pandas as pd

#: damaged lines that are named one by one
_MOST_NAMED = 5


class Store:
    """The finished units of a run and the file they are appended to.

    `entries` are the units by their key, `begun_with` is what began the run, `damage` names lines of the journal that
    hold no unit, a sentence each.
    """

    def __init__(self, folder: Path, plan: Plan, journal: Journal, begun_with: dict[str, str]) -> None:
        self.folder = folder
        self.plan = plan
        self.begun_with = begun_with
        self.entries: Mapping[str, Entry] = journal.entries
        self._journal = journal
        #: how many are to be finished, if not only a share of them is
        self.poses = sum(len(group.positions) for group in plan.groups)
        self._count = Count(journal.entries.values())

    @property
    def damage(self) -> list[str]:
        """The lines of the journal that hold no unit, a sentence each, and how many more there are."""
        found = self._journal.damage
        more = len(found) - _MOST_NAMED
        return [*found[:_MOST_NAMED], *([f"{self._journal.path}: and {more} more such lines"] if more > 0 else [])]

    def append(self, record: Record) -> Record:
        """Keep a finished unit: it is on the disk when this returns. Raises RunError if the disk refuses.

        What is kept also says who made it: this process, if the record does not say so.
        """
        record = _signed(record)
        before = self.entries.get(record.unit)
        self._write([record])
        self._count.replace(before, self.entries[record.unit])
        return record

    def extend(self, records: Iterable[Record]) -> None:
        """Keep many finished units, which the disk is waited for but once. Raises as `append` does."""
        self._write(map(_signed, records))
        self._count = Count(self.entries.values())

    def _write(self, records: Iterable[Record]) -> None:
        try:
            self._journal.append(records)
        except OSError as error:
            reason = f"{self.folder}: cannot be written: {error.strerror}"
            raise RunError(f"{reason}; what is finished is kept, and the same command continues the run") from None

    def record(self, unit: str) -> Record:
        """The record of a finished unit. Raises KeyError for one that is not finished."""
        return self._journal.record(unit)

    def standing(self, pace: float | None = None, left_s: float | None = None) -> Standing:
        """Where the run stands, at a `pace` of poses a second with `left_s` [s] to go."""
        return self._count.standing(self.poses, self._journal.size, pace, left_s)

    def keep_standing(self, pace: float | None = None, left_s: float | None = None) -> None:
        """Write where the run stands, for `campaign status`.

        Nothing rests on it, so that a disk that refuses it is heard of by the journal.
        """
        standing = self.standing(pace, left_s)
        with contextlib.suppress(InputError):
            write_atomically(self.folder / STANDING, standing.model_dump_json().encode())

    def rows(self) -> pd.DataFrame:
        """The rows of what is finished, in the plan's order, with what other methods found (campaigns.scores).

        Raises InputError for scores that are damaged.
        """
        stated = Stated.by(entry.stated for entry in self.entries.values())
        scores = Scores.of(self.folder, self.plan)
        return row_table(scores.plan, self.entries, lambda unit: scores.joined(self.record(unit)), stated)

    def write_rows(self) -> int:
        """Write errors.csv and errors.parquet of what is finished, in the plan's order, who made it; how many rows.

        What other methods found in exported frames (campaigns.scores) is among them. Raises InputError.
        """
        if not self.entries:
            return 0
        frame = self.rows()
        rows_stamp.forget(self.folder)
        begun = in_a_line(self.begun_with)
        makers = Counter(entry.by or begun for entry in self.entries.values() if not entry.error)
        write_atomically(self.folder / MAKERS, json.dumps(dict(sorted(makers.items())), ensure_ascii=False).encode())
        write_atomically(self.folder / "errors.csv", csv_text(frame))
        packed = io.BytesIO()
        frame.to_parquet(packed, index=False)
        write_atomically(self.folder / "errors.parquet", packed.getbuffer())
        if not self._journal.damage:  # which is told whenever rows are made of it
            rows_stamp.stamp(self.folder, max(entry.offset + entry.length for entry in self.entries.values()))
        return len(frame)


def _signed(record: Record) -> Record:
    """The record with who made it: this process, if it does not say so."""
    return record if record.by else record.model_copy(update={"by": maker()})


@contextlib.contextmanager
def open_store(folder: Path, plan: Plan, document: Document) -> Iterator[Store]:
    """The run folder of a campaign, begun or continued, for this process alone.

    Raises InputError for a folder that cannot be written, is not a run's, is another campaign's or another schema's,
    or is in use.
    """
    try:
        _refuse_strangers(folder)
        folder.mkdir(parents=True, exist_ok=True)
        journal = open_plain(folder / FILE, "a+b")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror}; choose another --out") from None
    with journal:
        if not take(journal):
            raise InputError(f"{folder}: another `campaign run` is writing to it; wait or choose another --out")
        known = folder / "campaign.yaml"
        if not known.exists():
            write_atomically(known, dump(resolved(document, made_with(plan))).encode())
        begun_with = read_begun_with(folder)
        if not goes_on(begun_with):
            raise InputError(
                f"{folder}: was begun by conespot {begun_with.get('conespot')}, which named cases otherwise, "
                f"and cannot go on; choose another --out (`campaign report {folder}` still makes its tables)"
            )
        if begun_with.get("identity") != plan.identity:
            raise InputError(f"{folder}: holds the run of another campaign or other settings; choose another --out")
        if plan.cases:
            write_cases(folder, plan)
        store = Store(folder, plan, Journal(folder / FILE, plan, journal), begun_with)
        store.keep_standing()
        try:
            yield store
        finally:
            store.keep_standing()


@contextlib.contextmanager
def look_into(folder: Path, plan: Plan) -> Iterator[Store]:
    """The store of a run as it is now, which another process may work on meanwhile; nothing can be appended."""
    try:
        stream = open_plain(folder / FILE)
    except OSError as error:
        raise InputError(f"{folder / FILE}: cannot be read: {error.strerror}") from None
    with stream:
        yield Store(folder, plan, Journal(folder / FILE, plan, stream), read_begun_with(folder))


def _refuse_strangers(folder: Path) -> None:
    if not folder.is_dir():
        if folder.exists():
            raise InputError(f"{folder}: is a file, not a run folder; choose another --out")
        return
    # hidden files may be what an interrupted start left behind
    names = {path.name for path in folder.iterdir() if not path.name.startswith(".")}
    if "campaign.yaml" not in names and names - {FILE}:
        raise InputError(f"{folder}: holds other files and is not a run folder; choose another --out")


def read_begun_with(folder: Path) -> dict[str, str]:
    """What began the run in a folder, as its campaign.yaml states it. Raises InputError if that cannot be read."""
    said = read_document(folder / "campaign.yaml").data.get("made_with")
    return {str(k): str(v) for k, v in said.items()} if isinstance(said, dict) else {}


def goes_on(begun_with: dict[str, str]) -> bool:
    """Whether what began a run names its cases as we do; what states no identity is no run of another version."""
    return "identity" not in begun_with or begun_with.get("schema") == str(SCHEMA)
