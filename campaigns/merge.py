"""`campaign merge`: run folders of shares of one campaign become one, as if one process had measured everything."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from conespot.campaigns.arrival import keep_frames
from conespot.campaigns.journal import FILE, Journal
from conespot.campaigns.lock import alone
from conespot.campaigns.plain_file import open_plain
from conespot.campaigns.plan import Plan, make_plan
from conespot.campaigns.row import Record
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.store import Store, goes_on, open_store, read_begun_with
from conespot.scene import InputError


@dataclass(frozen=True)
class Merged:
    """What a merged folder holds: the poses that no share measured, or that it lost, and damage in the journals."""

    folder: Path
    poses: int
    missing: tuple[str, ...]
    damage: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """What to say of what is missing."""
        return (
            f"{self.folder}: {len(self.missing)} of {self.poses} poses are missing, the first: {self.missing[0]}; "
            f"merge again with what is missing, or `campaign run {self.folder / 'campaign.yaml'} --out {self.folder}`"
        )


def merge(out: Path, folders: Sequence[Path]) -> Merged:
    """Put what is finished in the run folders into the run folder `out`, begun or continued, and write its rows.

    Raises InputError for folders of different campaigns or schemas, and where two found something else at a pose;
    then nothing is merged.
    """
    document = read_campaign(str(_begun(folders[0])))
    plan = make_plan(document)
    for folder in folders:
        _refuse_others(folder, plan)
    with open_store(out, plan, document) as store:
        found: dict[str, tuple[bytes, Path]] = {}
        for unit, entry in store.entries.items():
            if not entry.error:
                found[unit] = _findings(store.record(unit)), out
        damage = list(store.damage)
        for folder in folders:
            damage += _compare(folder, plan, found)
        for folder in folders:
            with _journal(folder, plan) as journal:
                store.extend(record for record in journal.records() if not record.error and _is_left(store, record))
            _copy_frames(folder, store)
        with alone(out):
            store.write_rows()
        left = [unit for unit in plan.units() if unit.key not in store.entries or store.entries[unit.key].error]
    return Merged(out, sum(len(g.positions) for g in plan.groups), tuple(map(plan.says, left)), tuple(damage))


def _begun(folder: Path) -> Path:
    path = folder / "campaign.yaml"
    if not path.is_file() or not (folder / FILE).is_file():
        raise InputError(f"{folder}: is no run folder; `campaign run --shard 1/N` makes one")
    return path


def _refuse_others(folder: Path, plan: Plan) -> None:
    _begun(folder)
    begun_with = read_begun_with(folder)
    if not goes_on(begun_with):
        raise InputError(f"{folder}: was begun by conespot {begun_with.get('conespot')}, which named cases otherwise")
    if begun_with.get("identity") != plan.identity:
        raise InputError(f"{folder}: holds the run of another campaign or other settings than the first folder")


@contextlib.contextmanager
def _journal(folder: Path, plan: Plan) -> Iterator[Journal]:
    with open_plain(folder / FILE) as stream:
        yield Journal(folder / FILE, plan, stream)


def _is_left(store: Store, record: Record) -> bool:
    """Whether the store lacks the record's unit, or lost it."""
    return record.unit not in store.entries or bool(store.entries[record.unit].error)


def _compare(folder: Path, plan: Plan, found: dict[str, tuple[bytes, Path]]) -> list[str]:
    """Add what a folder found to what was `found`; the damage of its journal. Raises InputError if they contradict."""
    units = {unit.key: unit for unit in plan.units()}
    with _journal(folder, plan) as journal:
        for record in journal.records():
            if record.error:
                continue
            findings = _findings(record)
            before, where = found.setdefault(record.unit, (findings, folder))
            if before != findings:
                raise InputError(
                    f"{where} and {folder}: found different things at {plan.says(units[record.unit])}; they were made "
                    f"with different software or machines ({record.by or 'unknown'}), leave one of them out"
                )
        return journal.damage


def _findings(record: Record) -> bytes:
    """A digest of what was found, in any order, whoever found it."""
    texts = sorted(finding.model_dump_json(exclude_defaults=True) for finding in record.findings)
    return hashlib.sha256("\n".join(texts).encode()).digest()


def _copy_frames(folder: Path, store: Store) -> None:
    source, target = folder / "frames", store.folder / "frames"
    if not source.is_dir():
        return
    target.mkdir(exist_ok=True)
    for path in sorted(source.iterdir()):
        # a link in a folder from others may lead anywhere
        if path.is_file() and not path.is_symlink() and not (target / path.name).exists():
            keep_frames({path.name: path.read_bytes()}, target)
