"""`campaign debug`: one pose of one case of a run once more, with what its localizers saw as pictures and in words."""

from __future__ import annotations

import functools
import math
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from conespot.campaigns.begun import plan_of
from conespot.campaigns.ending import RunError
from conespot.campaigns.plan import Case, Group, Plan, Unit
from conespot.campaigns.row import Finding, Record, Row, errors
from conespot.campaigns.worker import Done, Lost, Measures, Note, Refused, Worker
from conespot.results.run import load_run
from conespot.results.variants import named
from conespot.scene import InputError

if TYPE_CHECKING:
    pass


def debug(folder: Path, wanted: str, pose: int) -> Iterator[str]:
    """Render and localize one pose of a case again, with the run's own settings and seeds, and say what came out.

    Writes frame.png and a picture for each localizer into RUN/debug/CASE-POSE. Raises InputError for what is no run of
    this version, no case or no pose of it, RunError if it cannot be rendered.
    """
    plan = plan_of(folder)
    group, case = _case(plan, wanted, folder)
    if not 0 <= pose < len(group.positions):
        raise InputError(f"pose {pose}: the case has poses 0 to {len(group.positions) - 1}")
    unit = Unit(plan.groups.index(group), pose, group.unit(pose))
    pictures = folder / "debug" / f"{case.key}-{pose}"
    try:
        pictures.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{pictures}: cannot be made: {error.strerror}") from None
    record = _measured(plan, unit, case, group.scene_key, pictures)
    truth = group.pose(pose)
    labels = ", ".join(named(name, value) for name, value in {**case.labels, **case.swept}.items())
    yield f"case {case.key}, pose {pose}: {labels}"
    yield f"true tip {_point(truth.apex)} mm, axis {_point(truth.axis)}"
    if record.error:
        yield f"lost: {record.error}"
        return
    kept = _rows(folder, case, pose)
    for found in record.findings:
        row = errors(truth, found, case.scene.instrument.rcm)
        yield f"{found.localizer}: {_words(found, row)}; {_beside(found, row, kept.get(found.localizer))}"
    yield f"{pictures}: {', '.join(sorted(path.name for path in pictures.glob('*.png')))}"


def _case(plan: Plan, wanted: str, folder: Path) -> tuple[Group, Case]:
    """The case of a key, the beginning of one, or a line of cases.jsonl. Raises InputError."""
    found = [case for case in plan.cases if case.key.startswith(wanted)]
    if wanted.isdecimal() and 1 <= int(wanted) <= len(plan.cases) and wanted not in {case.key for case in plan.cases}:
        found = [plan.cases[int(wanted) - 1]]
    if len(found) != 1:
        which = "is the beginning of several cases" if found else "is no case"
        raise InputError(f"{wanted}: {which}; {folder / 'cases.jsonl'} has a line for each of {len(plan.cases)}")
    return next((group, case) for group in plan.groups for case in group.cases if case.key == found[0].key)


def _measured(plan: Plan, unit: Unit, case: Case, scene_key: str, pictures: Path) -> Record:
    """What a worker like any of a run's finds, which draws what it saw."""
    worker = Worker(plan, pictures, functools.partial(make_easel, case.key))
    try:
        worker.give(unit, scene_key)
        while True:
            match worker.hear():
                case Done(record):
                    return record
                case Note(sentence):
                    sys.stderr.write(f"{sentence}\n")
                case Refused(reason):
                    raise RunError(reason)
                case Lost(how):
                    raise RunError(f"the process that renders {how}")
    finally:
        worker.end(at_once=True)


def make_easel(case: str, plan: Plan, pictures: Path | None) -> Measures:
    """What measures one case in the worker's process, and draws it into the folder `pictures`."""
    from conespot.campaigns.easel import Easel

    assert pictures is not None
    return Easel(plan, case, pictures)


def _rows(folder: Path, case: Case, pose: int) -> dict[str, Row]:
    """The run's own rows of a pose by localizer; none if it has none."""
    try:
        run = load_run(folder)
    except InputError:
        return {}
    if run.rows is None:
        return {}
    frame: pd.DataFrame = run.rows.frame
    mine = frame[(frame["case"] == case.key) & (frame["pose"] == pose)]
    return {row["localizer"]: {str(name): value for name, value in row.items()} for row in mine.to_dict("records")}


def _words(found: Finding, row: Row) -> str:
    if found.apex is None:
        return f"not localized: {found.reason}"
    parts = ", ".join(f"{axis} {1e3 * float(row[f'error_{axis}_mm']):+.1f}" for axis in "xyz")
    off = f"{1e3 * float(row['position_error_mm']):.1f} um off ({parts})"
    return f"tip {_point(found.apex)} mm, {off}, rotation {float(row['rotation_error_deg']):.3g} deg"


def _beside(found: Finding, row: Row, kept: Row | None) -> str:
    """How it stands to the run's row."""
    if kept is None:
        return "the run holds no row of it"
    if str(kept["reason"]) != found.reason:
        return f"the run's row says otherwise: {kept['reason'] or 'localized'}"
    off = [name for name, value in row.items() if not _same(float(value), float(kept[name]))]
    return f"the run's row differs in {', '.join(off)}" if off else "the same as the run's row"


def _same(a: float, b: float) -> bool:
    return a == b or (math.isnan(a) and math.isnan(b))


def _point(values: Iterable[float]) -> str:
    return " ".join(f"{value:.4f}" for value in values)
