"""The rows of a run as a table, filled pose by pose: of a million rows only one pose's findings are in memory."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from conespot.campaigns.plan import Case, Group, Plan
from conespot.campaigns.row import Record, Stated, errors, in_frame, wall_distances

if TYPE_CHECKING:
    import pandas as pd


def row_table(plan: Plan, finished: Container[str], record: Callable[[str], Record], stated: Stated) -> pd.DataFrame:
    """The rows of all finished units in the plan's order: case, localizer, pose. Columns: conespot.results.columns.

    `record` gives the record of a unit that is `finished`, and `stated` says which columns their findings fill. The
    order and every value depend on the campaign alone, not on who finished a unit when.
    """
    import pandas as pd

    poses = {g.key: [i for i in range(len(g.positions)) if g.unit(i) in finished] for g in plan.groups}
    homes = {case.key: group for group in plan.groups for case in group.cases}
    blocks = [(case, name, poses[homes[case.key].key]) for case in plan.cases for name in case.localizers]
    starts: dict[tuple[str, str], int] = {}
    count = 0
    for case, name, finished_poses in blocks:
        starts[case.key, name] = count
        count += len(finished_poses)
    reasons = [""] * count
    numbers: dict[str, NDArray[np.float64]] = {}
    for group in plan.groups:
        for rank, pose in enumerate(poses[group.key]):
            for case, name, reason, row in _rows(group, pose, record(group.unit(pose)), stated):
                at = starts[case.key, name] + rank
                reasons[at] = reason
                for column, value in row.items():
                    if column not in numbers:
                        numbers[column] = np.empty(count)
                    numbers[column][at] = value
    described = [{"case": c.key, "frame": c.frame, **c.labels, "localizer": name} for c, name, _ in blocks]
    columns: dict[str, list[str] | list[str | float] | list[int] | NDArray[np.float64]] = {
        column: [said[column] for said, (_, _, here) in zip(described, blocks, strict=True) for _ in here]
        for column in (described[0] if described else ())
    }
    columns["pose"] = [pose for _, _, here in blocks for pose in here]
    columns["status"] = ["failed" if reason else "ok" for reason in reasons]
    columns["reason"] = reasons
    swept = {key: [c.swept[key] for c, _, here in blocks for _ in here] for key in plan.cases[0].swept}
    return pd.DataFrame({**columns, **numbers, **swept}, copy=False)


def _rows(
    group: Group, number: int, record: Record, stated: Stated
) -> Iterator[tuple[Case, str, str, dict[str, float]]]:
    """Of a unit: case, localizer, why it failed, and the columns that hold numbers."""
    pose = group.pose(number)
    answers = {(found.case, found.localizer): found for found in record.findings}
    visible = in_frame(pose, group.scene) if stated.sigmas else None
    wall = wall_distances(pose, group.scene) if stated.distance else None
    for case in group.cases:
        rcm = case.scene.instrument.rcm
        for name in case.localizers:
            found = answers.get((case.key, name))
            reason = record.error if found is None else found.reason
            yield case, name, reason, errors(pose, found, rcm) | stated.row(pose, found, visible, wall)
