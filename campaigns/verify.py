"""`campaign verify`: whether a packed run is what its checksums say, its rows what its poses say, and those true.

Nothing of an archive is executed or unpickled, and no file is opened that a stranger's campaign names beside it.
"""

from __future__ import annotations

import contextlib
import secrets
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from conespot.campaigns import crate
from conespot.campaigns.archive import Archive
from conespot.campaigns.executor import Executor
from conespot.campaigns.frame_names import FILE as EXPORTED
from conespot.campaigns.journal import FILE as JOURNAL
from conespot.campaigns.maker import items
from conespot.campaigns.pack import INPUTS, with_files
from conespot.campaigns.plan import Plan, Unit, make_plan
from conespot.campaigns.row import Finding, Record
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.scores import FOLDER as SCORES
from conespot.campaigns.store import Store, look_into
from conespot.results.rows import read_rows
from conespot.scene import InputError
from conespot.scene.document import read_document

#: how far apart [mm] tips of the same pose may be, as docs/cluster.md measured it: of one Mitsuba variant, and of two,
#: between which the published method's thresholds jump by pixels
#: and of one program: what else it says of a tip may be worked out otherwise by a checkout of the same version
_SAME_PROGRAM_MM = 1e-9
SAME_VARIANT_MM, OTHER_VARIANT_MM = 0.005, 0.3
#: rows that follow from a journal by arithmetic alone, which differs in the last digits between machines
_ROUNDING = 1e-6
#: rows follow from the journal, and those of other methods from their scores, which name exported frames
_NEEDED = ("campaign.yaml", JOURNAL, "cases.jsonl", "errors.csv", "errors.parquet", EXPORTED)
_MOST_NAMED = 5


@dataclass
class Verdict:
    """What was looked at, in sentences, and what is wrong."""

    said: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)


def verify(path: Path, sample: int, seed: int | None, executor: Executor) -> Verdict:
    """Check an archive, and measure a random `sample` of its poses again; a `seed` draws the same ones again.

    Raises InputError for what is no archive of a run, or cannot be measured by this version.
    """
    archive, verdict = Archive(path), Verdict()
    damage = list(archive.damage())
    verdict.wrong += damage
    verdict.said.append(f"sha256 {archive.digest()}")
    if damage:
        return verdict
    verdict.said.append(f"{len(archive.entries)} files are what their checksums say")
    missing = [name for name in (*_NEEDED[:2], crate.FILE) if name not in archive.entries]
    if missing:
        raise InputError(f"{path}: holds no {', '.join(missing)}; it is no run that `campaign pack` packed")
    with tempfile.TemporaryDirectory(prefix="conespot-") as unpacked:
        folder = Path(unpacked)
        beside = (name for name in archive.entries if name.startswith((f"{INPUTS}/", f"{SCORES}/")))
        archive.unpack((name for name in (*_NEEDED, *beside) if name in archive.entries), folder)
        plan = _plan(path, folder)
        with look_into(folder, plan) as store:
            verdict.wrong += [sentence.replace(f"{folder}/", "") for sentence in store.damage]
            _compare_rows(folder, store, verdict)
            if sample:
                _measure_again(store, sample, secrets.randbits(32) if seed is None else seed, executor, verdict)
    return verdict


def _plan(path: Path, folder: Path) -> Plan:
    """The plan of the unpacked run, which names no file but its own."""
    own = folder / INPUTS

    def inside(name: str) -> str:
        place = (folder / name).resolve()
        if not place.is_relative_to(own.resolve()) or not place.is_file():
            raise InputError(f"{path}: its campaign names {name[:100]}, which is none of the archive's {INPUTS}")
        return name

    try:
        with_files(read_document(folder / "campaign.yaml").data, inside)
        plan = make_plan(read_campaign(str(folder / "campaign.yaml")))
    except InputError as error:  # most likely of a newer version
        raise InputError(str(error).replace(f"{folder}/", f"{path}, ")) from None
    stated = plan.campaign.made_with.get("identity")
    if stated != plan.identity:
        raise InputError(f"{path}: its campaign is not the one that it states ({stated}), or another version's")
    return plan


def _compare_rows(folder: Path, store: Store, verdict: Verdict) -> None:
    """Whether the rows follow from the journal."""
    expected = store.rows()
    for name in ("errors.csv", "errors.parquet"):
        if not (folder / name).is_file():
            if len(expected):
                verdict.wrong.append(f"{name}: is missing, and the journal holds {len(store.entries)} poses")
            continue
        found = read_rows(folder / name, [*store.plan.cases[0].swept]).frame
        off = list(differing(expected, found))
        verdict.wrong += [f"{name}: {sentence}" for sentence in off[:_MOST_NAMED]]
        if off[_MOST_NAMED:]:
            verdict.wrong.append(f"{name}: and {len(off) - _MOST_NAMED} more rows")
        if not off:
            verdict.said.append(f"{len(found)} rows of {name} follow from {len(store.entries)} poses of the journal")


def differing(expected: pd.DataFrame, found: pd.DataFrame) -> Iterator[str]:
    """The rows of a table that are not those that were expected, a sentence each."""
    if len(expected) != len(found):
        yield f"{len(found)} rows, where the journal says {len(expected)}"
        return
    wrong: dict[int, list[str]] = {}
    for name in expected.columns.intersection(found.columns):
        a, b = expected[name].to_numpy(), found[name].to_numpy()
        if a.dtype.kind in "fi" and b.dtype.kind in "fi":
            same = np.isclose(a.astype(float), b.astype(float), rtol=_ROUNDING, atol=_ROUNDING, equal_nan=True)
        else:
            same = a.astype(str) == b.astype(str)
        for at in np.flatnonzero(~same).tolist():
            wrong.setdefault(at, []).append(str(name))
    for row, names in sorted(wrong.items()):
        which = f"{found['localizer'].iloc[row]}, pose {found['pose'].iloc[row]} of case {found['case'].iloc[row]}"
        yield f"row {row + 1} ({which}) differs from the journal in {', '.join(names[:4])}"


def _measure_again(store: Store, sample: int, seed: int, executor: Executor, verdict: Verdict) -> None:
    """Measure a random sample of the finished poses again, and compare what is found."""
    done = [unit for unit in store.plan.units() if unit.key in store.entries and not store.entries[unit.key].error]
    chosen = np.random.default_rng(seed).permutation(len(done))[:sample]
    units = {done[i].key: done[i] for i in sorted(chosen.tolist())}
    same, rows, furthest = 0, 0, 0.0
    notes: list[str] = []
    with contextlib.closing(
        executor.execute(store.plan, list(units.values()), frames=None, note=notes.append)
    ) as records:
        for record in records:
            compared = _compared(store, units.pop(record.unit), record)
            rows += len(compared)
            same += len([one for one in compared if one.off == 0.0])
            furthest = max([furthest, *(one.off for one in compared)])
            verdict.wrong += [one.sentence for one in compared if one.sentence]
    verdict.wrong += [f"{store.plan.says(unit)}: was not measured again" for unit in units.values()]
    rest = "" if same == rows else f", the others up to {1e3 * furthest:.3g} um off"
    verdict.said.append(
        f"{len(chosen) - len(units)} of {len(done)} poses measured again (--seed {seed}): "
        f"{same} of {rows} answers are the same to the bit{rest}"
    )


@dataclass(frozen=True)
class _Compared:
    """How far an answer is off the kept one [mm], infinite where one of the two is a refusal, and what is wrong."""

    off: float
    sentence: str = ""


def _compared(store: Store, unit: Unit, again: Record) -> Sequence[_Compared]:
    kept = store.record(unit.key)
    where = store.plan.says(unit)
    if again.error:
        return [_Compared(np.inf, f"{where}: was lost: {again.error}")]
    within = _within(kept.by, again.by)
    answers = {(f.case, f.localizer): f for f in again.findings}
    found = []
    for before in kept.findings:
        after = answers[before.case, before.localizer]
        off = _off(before, after)
        wrong = off > within
        allowed = (
            f"{1e3 * within:g} um are allowed" if within > _SAME_PROGRAM_MM else "the same program must find the same"
        )
        said = f"{_said(before)} is kept, {_said(after)} was found; {allowed}"
        found.append(_Compared(off, f"{where}, {before.localizer}, case {before.case}: {said}" if wrong else ""))
    return found


def _within(kept: str, again: str) -> float:
    """How far apart two makers' tips may be [mm]."""
    if kept == again:
        return _SAME_PROGRAM_MM
    return SAME_VARIANT_MM if items(kept).get("variant") == items(again).get("variant") else OTHER_VARIANT_MM


def _off(a: Finding, b: Finding) -> float:
    if a == b:
        return 0.0
    if a.apex is None or b.apex is None:
        return 0.0 if a.reason == b.reason else np.inf
    # of the same tip, what else is said of it must be the same but for its last digits
    return max(float(np.linalg.norm(np.subtract(a.apex, b.apex))), 1e-12)


def _said(found: Finding) -> str:
    return (
        f"a refusal ({found.reason})"
        if found.apex is None
        else f"a tip at {' '.join(f'{c:.6f}' for c in found.apex)} mm"
    )
