"""What comes from other machines: records and frames, of which nothing is believed unchecked."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.row import Record
from conespot.scene.atomic import write_atomically

_FRAME = re.compile(r"[0-9a-f]{1,64}-[0-9]{5,9}\.(exr|png)")


def records_of(plan: Plan, batch: Sequence[Unit], texts: Sequence[str]) -> list[Record]:
    """The records of a batch from their JSON; an error stands for a pose whose record is missing or no answer to it."""
    found: dict[str, Record] = {}
    for text in texts:
        try:
            record = Record.model_validate_json(text)
        except ValueError:
            continue
        found[record.unit] = record
    return [_whole(plan, unit, found.get(unit.key)) for unit in batch]


def _whole(plan: Plan, unit: Unit, record: Record | None) -> Record:
    group = plan.groups[unit.group]
    asked = sorted((case.key, name) for case in group.cases for name in case.localizers)
    if record is None or not (record.error or sorted((f.case, f.localizer) for f in record.findings) == asked):
        return Record(unit=unit.key, error="what the worker sent is no record of this pose")
    return record


def keep_frames(frames: Mapping[str, bytes], folder: Path | None) -> None:
    """Write frames that a worker sent, by name; a name that no frame has is left out."""
    for name, content in frames.items():
        if folder is not None and _FRAME.fullmatch(name):
            write_atomically(folder / name, content)
