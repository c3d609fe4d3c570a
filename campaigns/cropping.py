"""Crops of a finished run: the worst frames of its boxes once more, in the run's own settings and seeds.

They are drawn after the run, so that no row waits for a picture, by its workers, which have all that it takes at hand;
and any run can get them later.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pandas as pd

from conespot.campaigns.cropper import Cropped, ToCrop
from conespot.campaigns.executor import Executor
from conespot.campaigns.plan import Plan, make_plan
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.store import goes_on, read_begun_with
from conespot.results.crops import FILE, Crop, Crops
from conespot.results.rows import Rows
from conespot.results.run import load_run
from conespot.scene import InputError
from conespot.scene.atomic import write_atomically

#: frames that are rendered again at most: where they were asked for, and after a run that nobody asked
MOST_FRAMES, MOST_UNASKED = 40, 12
#: a run of fewer rows gets no crops unasked: `campaign debug` draws any of them
FEWEST_ROWS = 300
_ERROR = "position_error_mm"

#: a frame, and who looks at it: case, pose, localizers
Wanted = dict[tuple[str, int], tuple[str, ...]]


def keep_crops(folder: Path, per_box: int | None, executor: Executor) -> None:
    """Write crops.json of a run folder: the `per_box` worst frames of each box, by default one of a run of some size.

    Raises InputError for a folder that is no run, or of a version that named cases otherwise, RunError if nothing can
    be rendered.
    """
    run = load_run(folder)
    asked = 1 if per_box is None else per_box
    if run.rows is None or asked == 0 or (per_box is None and len(run.rows) < FEWEST_ROWS):
        return
    begun_with = read_begun_with(folder)
    if not goes_on(begun_with):
        raise InputError(f"{folder}: was begun by conespot {begun_with.get('conespot')}, which named cases otherwise")
    plan = make_plan(read_campaign(str(folder / "campaign.yaml")))
    wanted, left_out = worst_frames(run.rows, asked, MOST_UNASKED if per_box is None else MOST_FRAMES)
    found: list[Crop] = []
    for record in executor.execute(plan, _units(plan, wanted), frames=None, note=lambda said: None):
        if record.error:
            sys.stderr.write(f"no crop of {record.unit}: {record.error}\n")
        if isinstance(record, Cropped):
            found += record.crops
    found.sort(key=lambda crop: (crop.case, crop.pose, crop.localizer))  # whoever was first
    kept = Crops(per_box=asked, left_out=left_out, crops=tuple(found))
    write_atomically(folder / FILE, kept.model_dump_json().encode())


def worst_frames(rows: Rows, per_box: int, most: int) -> tuple[Wanted, int]:
    """At most so many frames: one that each localizer refused for each reason, then the worst of each box.

    The commonest refusals take a quarter of the frames at most, the rest are those with the largest position errors,
    the worst of all first. The second is how many answers are among these too, on frames beyond the `most`.
    """
    wanted: Wanted = {}
    for case, pose, localizer in _refused(rows.frame).head(most // 4).itertuples(index=False):
        key = str(case), int(pose)
        wanted[key] = (*wanted.get(key, ()), str(localizer))
    ok = rows.frame[rows.frame["status"] == "ok"].sort_values([_ERROR, "case", "pose"], ascending=[False, True, True])
    worst: pd.DataFrame = ok.groupby(list(rows.group), sort=False).head(per_box)
    left_out = 0
    for case, pose, localizer in worst[["case", "pose", "localizer"]].itertuples(index=False):
        key = str(case), int(pose)
        if key in wanted or len(wanted) < most:
            wanted[key] = (*wanted.get(key, ()), str(localizer))
        else:
            left_out += 1
    return wanted, left_out


def _refused(frame: pd.DataFrame) -> pd.DataFrame:
    """Case, pose and localizer of the first frame of each localizer and reason, the commonest reason first."""
    failed = frame[frame["status"] == "failed"]
    groups = failed.groupby(["localizer", "reason"], sort=False)
    first = failed.assign(times=groups["pose"].transform("size"))[~failed.duplicated(["localizer", "reason"])]
    return first.sort_values("times", ascending=False, kind="stable")[["case", "pose", "localizer"]]


def _units(plan: Plan, wanted: Wanted) -> list[ToCrop]:
    found = []
    for number, group in enumerate(plan.groups):
        mine = {case.key for case in group.cases}
        seen: dict[int, list[tuple[str, tuple[str, ...]]]] = {}
        for (case, pose), localizers in wanted.items():
            if case in mine and pose < len(group.positions):
                seen.setdefault(pose, []).append((case, localizers))
        found += [ToCrop(number, pose, group.unit(pose), tuple(seen[pose])) for pose in sorted(seen)]
    return found
