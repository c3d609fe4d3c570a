"""Crops of a finished run: the worst frames of its boxes once more, in the run's own settings and seeds.

They are drawn after the run and not by its workers, so that no row waits for a picture and any run can get them later.
"""

from __future__ import annotations

import functools
import sys
import tempfile
from pathlib import Path

import pandas as pd
from pydantic import TypeAdapter

from conespot.campaigns.plan import Plan, Unit, make_plan
from conespot.campaigns.pool import LocalPool
from conespot.campaigns.row import Record
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.store import goes_on, read_begun_with
from conespot.campaigns.worker import Measures
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
_Crops = TypeAdapter(tuple[Crop, ...])

#: a frame, and who looks at it: case, pose, localizers
Wanted = dict[tuple[str, int], tuple[str, ...]]


def keep_crops(folder: Path, per_box: int | None, workers: int) -> None:
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
    units = _units(plan, wanted)
    with tempfile.TemporaryDirectory() as temporary:
        pool = LocalPool(workers, functools.partial(make_cropper, wanted))
        for record in pool.execute(plan, units, frames=Path(temporary), note=lambda said: None):
            if record.error:
                sys.stderr.write(f"no crop of {record.unit}: {record.error}\n")
        # in the order of the rows, whoever was first
        found = [crop for path in Path(temporary).glob("*.json") for crop in _Crops.validate_json(path.read_bytes())]
    found.sort(key=lambda crop: (crop.case, crop.pose, crop.localizer))
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


def _units(plan: Plan, wanted: Wanted) -> list[Unit]:
    found = []
    for number, group in enumerate(plan.groups):
        mine = {case.key for case in group.cases}
        poses = sorted({pose for case, pose in wanted if case in mine and pose < len(group.positions)})
        found += [Unit(number, pose, group.unit(pose)) for pose in poses]
    return found


def make_cropper(wanted: Wanted, plan: Plan, folder: Path | None) -> Measures:
    """What draws crops in a worker's process, a file a unit in the folder."""
    assert folder is not None
    return Cropper(plan, wanted, folder)


class Cropper:
    """Looks at the wanted frames of a unit again and keeps a crop for each localizer."""

    def __init__(self, plan: Plan, wanted: Wanted, folder: Path) -> None:
        from conespot.campaigns.bench import Bench

        self._bench = Bench(plan, None)
        self._plan, self._wanted, self._folder = plan, wanted, folder
        self.variant = self._bench.variant

    @property
    def worn(self) -> bool:
        """True when the process should make room for a fresh one."""
        return self._bench.worn

    def measure(self, unit: Unit) -> Record:
        """The unit's findings that were drawn; the crops are in a file of its name."""
        from conespot.campaigns.bench import finding
        from conespot.campaigns.easel import overlay_of
        from conespot.results.crops import crop_of

        crops, findings = [], []
        for case, image, unlit in self._bench.given(unit, {case for case, pose in self._wanted if pose == unit.pose}):
            for name in self._wanted[case.key, unit.pose]:
                outcome = self._bench.located(unit, case, image, name, unlit)
                overlay = overlay_of(self._plan, unit, case, image, name, outcome, residuals=False)
                crops.append(crop_of(case.key, name, unit.pose, overlay))
                findings.append(finding(case, name, outcome, None))
        (self._folder / f"{unit.key}.json").write_bytes(_Crops.dump_json(tuple(crops)))
        return Record(unit=unit.key, findings=tuple(findings))
