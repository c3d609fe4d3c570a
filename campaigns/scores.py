"""What other methods found in a run's exported frames: kept in the run folder, a file each, and joined to its rows.

`scores/NAME.csv` is the table of estimates as it was given. The journal knows nothing of it, so that what was measured
here stays what it was, and a file that is removed is gone with the next report.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from conespot.campaigns.estimates import Estimate, read_estimates
from conespot.campaigns.frame_names import FrameNames
from conespot.campaigns.plan import Case, Plan
from conespot.campaigns.row import Finding, Record
from conespot.localize import LOCALIZERS
from conespot.results.columns import MAX_ROWS
from conespot.scene import InputError, Pose

FOLDER = "scores"
#: the reason of a frame that the table of estimates leaves out
NO_ESTIMATE = "no estimate was given"
_NAME = re.compile(r"[A-Za-z0-9][\w .+-]{0,58}", re.ASCII)

#: by case and pose
Found = Mapping[tuple[str, int], Finding]


@dataclass(frozen=True)
class Scores:
    """The findings of other methods, by name. `plan` is the run's with these among its localizers."""

    plan: Plan
    found: Mapping[str, Found] = field(default_factory=dict)

    @classmethod
    def of(cls, folder: Path, plan: Plan) -> Scores:
        """Those that a run folder holds. Raises InputError for one that is damaged, or not of this run."""
        home = folder / FOLDER
        paths = sorted(path for path in home.glob("*.csv") if not path.name.startswith(".")) if home.is_dir() else []
        found: dict[str, Found] = {}
        for path in paths:
            check_name(path.stem, plan)
            found[path.stem] = read_score(path, path.stem, folder, plan)
        return cls(_with(plan, tuple(found)), found) if found else cls(plan)

    def joined(self, record: Record) -> Record:
        """A finished unit's record with the other methods' findings; one that was lost is lost for them too."""
        if not self.found or record.error:
            return record
        pose = int(record.unit.rpartition("-")[2])
        cases = dict.fromkeys(finding.case for finding in record.findings)
        theirs = tuple(
            found.get((case, pose)) or Finding(case=case, localizer=name, reason=NO_ESTIMATE)
            for name, found in self.found.items()
            for case in cases
        )
        return record.model_copy(update={"findings": record.findings + theirs})


def check_name(name: str, plan: Plan) -> None:
    """Raises InputError for a name that rows cannot have, or that is a localizer's."""
    if not _NAME.fullmatch(name):
        raise InputError(f"--name {name[:80]}: letters, digits, space and .+-_ make a name of up to 59 characters")
    if name in LOCALIZERS or any(name in case.localizers for case in plan.cases):
        raise InputError(f"--name {name}: is a localizer of the run or of this package; choose another name")


def read_score(path: Path, name: str, folder: Path, plan: Plan) -> Found:
    """The findings in a table of estimates, by case and pose. Raises InputError, with the line."""
    names = FrameNames.of(folder, plan)
    if names is None:
        raise InputError(f"{folder}: no frames of this run were exported; `campaign export {folder} --frames FOLDER`")
    estimates = read_estimates(path)
    places = {
        names.frame(case, pose): (case, pose)
        for group in plan.groups
        for case in group.cases
        for pose in range(len(group.positions))
    }
    found: dict[tuple[str, int], Finding] = {}
    behind: list[int] = []
    for written, estimate in estimates.items():
        frame = written if written in places else Path(written).stem  # the image's file may be named
        if frame not in places:
            raise InputError(
                f"{path}:{estimate.line}: {written[:40]!r} is no frame that was exported from {folder}; give the column"
                " frame of its index.csv"
            )
        case, pose = places[frame]
        if (case.key, pose) in found:
            raise InputError(f"{path}:{estimate.line}: the frame {frame} stands in another line too")
        finding, forward = _finding(path, case, name, estimate)
        found[case.key, pose] = finding
        behind += [] if forward else [estimate.line]
    if 2 * len(behind) > len(found):
        raise InputError(
            f"{path}:{behind[0]}: the axis points from the tip back to the RCM, as most here do; give the direction"
            " from the RCM into the light"
        )
    rows = plan.rows + len(places)
    if rows > MAX_ROWS:
        raise InputError(f"{path}: with these a run has {rows} rows, more than {MAX_ROWS}; score runs of fewer poses")
    return found


def _finding(path: Path, case: Case, name: str, estimate: Estimate) -> tuple[Finding, bool]:
    """An estimate as a run keeps it, and whether its axis points away from the RCM, as light does."""
    if estimate.tip is None:
        return Finding(case=case.key, localizer=name, reason=estimate.reason), True
    rcm = np.asarray(case.scene.instrument.rcm)
    away = np.asarray(estimate.tip) - rcm
    if not np.any(away):
        raise InputError(f"{path}:{estimate.line}: the tip is the remote centre of motion itself; give a reason")
    axis = estimate.axis or tuple(Pose.through(estimate.tip, rcm).axis.tolist())
    return Finding(case=case.key, localizer=name, apex=estimate.tip, axis=axis), bool(away @ np.asarray(axis) > 0.0)


def _with(plan: Plan, names: tuple[str, ...]) -> Plan:
    """The plan with more localizers in every case."""

    def joined(cases: tuple[Case, ...]) -> tuple[Case, ...]:
        return tuple(replace(case, localizers=(*case.localizers, *names)) for case in cases)

    groups = tuple(replace(group, cases=joined(group.cases)) for group in plan.groups)
    return replace(plan, cases=joined(plan.cases), groups=groups)
