"""`campaign export`: the frames of a run as its sensors recorded them, with what its localizers are told; no truth.

A run keeps no such frames, so they are rendered again. What the run's own localizers answer on them is compared with
the run's rows: only frames that are the run's are exported.
"""

from __future__ import annotations

import csv
import functools
import io
import math
import sys
from collections.abc import Iterator
from pathlib import Path

from conespot.campaigns.begun import plan_of
from conespot.campaigns.ending import RunError
from conespot.campaigns.exporter import make_exporter
from conespot.campaigns.frame_names import FrameNames
from conespot.campaigns.interruption import interruption
from conespot.campaigns.plain_file import open_plain
from conespot.campaigns.plan import Case, Group, Plan, Unit, told
from conespot.campaigns.pool import LocalPool
from conespot.campaigns.progress import Progress
from conespot.campaigns.row import Record
from conespot.campaigns.store import Store, look_into
from conespot.localize import LOCALIZERS
from conespot.scene import InputError, Scene
from conespot.scene.atomic import write_atomically
from conespot.scene.document import dump

INDEX = "index.csv"
#: two answers are the same if their tips are nearer than this [mm]: another processor rounds otherwise, other noise or
#: other light moves a tip by more
_SAME_MM = 1e-6
_MOST_NAMED = 3
#: how an index begins
_BEGINS = b"frame,case,pose,"


def export(folder: Path, frames: Path, workers: int) -> Iterator[str]:
    """Write the frames of a run's finished poses into the folder `frames`, and say what was written.

    `index.csv` has a line for each: its file, the scene's, and the numbers of a plain scene that a simple method
    needs. What was exported before is left as it is. Raises InputError for what is no run of this version or a folder
    that holds other files, RunError if frames cannot be rendered as the run saw them.
    """
    plan = plan_of(folder)
    if not plan.cases:
        raise InputError(f"{folder}: holds theory alone; there are no frames")
    with look_into(folder, plan) as store:
        finished = [unit for unit in plan.units() if unit.key in store.entries and not store.entries[unit.key].error]
        if not finished:
            raise InputError(f"{folder}: no pose is finished; `campaign run` or `campaign retry` goes on with it")
        make_export(frames)
        names = FrameNames.begun(folder, plan)
        left = [unit for unit in finished if not _all_there(plan, unit, names, frames)]
        _write(plan, left, names, frames, workers, store)
        lines = _write_index(plan, finished, names, frames)
    more = sum(1 for _ in plan.units()) - len(finished)
    yield f"{frames}: {INDEX} with {lines} frames, images/, scenes/"
    if more:
        yield f"{more} poses of the run are not finished; export again when they are"
    yield f"score what a method finds in them with: campaign score {folder} ESTIMATES.csv --name NAME"


def make_export(frames: Path) -> None:
    """Make the folder of an export, or find that one is begun there. Raises InputError for one that holds others."""
    try:
        if frames.is_dir():
            others = {entry.name for entry in frames.iterdir()} - {INDEX, "images", "scenes"}
            if (index := frames / INDEX).exists() and not _is_index(index):
                others.add(INDEX)
            if others:
                raise InputError(f"{frames}: holds {min(others)!r}, which is no export's; choose another --frames")
        for path in (frames, frames / "images", frames / "scenes"):
            path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{frames}: cannot be made: {error.strerror}; choose another --frames") from None


def _is_index(path: Path) -> bool:
    with open_plain(path) as stream:
        return stream.readline(len(_BEGINS)) == _BEGINS


def _all_there(plan: Plan, unit: Unit, names: FrameNames, frames: Path) -> bool:
    # the image is written after all else that a case is given
    return all((frames / names.image(case, unit.pose)).is_file() for case in plan.groups[unit.group].cases)


def _write(plan: Plan, left: list[Unit], names: FrameNames, frames: Path, workers: int, store: Store) -> None:
    """Render what is left. Raises RunError where it is not what the run saw, KeyboardInterrupt if interrupted."""
    units = {unit.key: unit for unit in left}
    total = sum(len(plan.groups[unit.group].cases) for unit in left)
    progress = Progress(total, float(len(left)), sys.stderr)
    others: list[str] = []

    def note(sentence: str) -> None:
        sys.stderr.write(f"{sentence}\n")

    pool = LocalPool(workers, functools.partial(make_exporter, names))
    with interruption:
        for record in pool.execute(plan, left, frames=frames, note=note):
            unit = units[record.unit]
            wrong = record.error or _differs(store.record(record.unit), record)
            if wrong:
                others.append(f"{plan.says(unit)}: {wrong}")
                for case in plan.groups[unit.group].cases:
                    (frames / names.image(case, unit.pose)).unlink(missing_ok=True)
                    (frames / names.unlit(case, unit.pose)).unlink(missing_ok=True)
            progress.update(len(plan.groups[unit.group].cases), 1.0, 0)
        progress.close()
    if interruption.asked:
        raise KeyboardInterrupt
    if others:
        more = f", and {len(others) - _MOST_NAMED} more" if len(others) > _MOST_NAMED else ""
        raise RunError(
            f"{len(others)} of {len(left)} poses are not rendered as the run saw them"
            f" ({'; '.join(others[:_MOST_NAMED])}{more}); export with the versions that makers.json of the run names,"
            " or run the campaign again here"
        )


def _differs(kept: Record, found: Record) -> str:
    """How answers on a pose rendered again differ from the run's; empty if they do not.

    A plug-in may answer by chance: it proves nothing.
    """
    answers = {(f.case, f.localizer): f for f in kept.findings}
    for now in found.findings:
        before = answers[now.case, now.localizer]
        if now.localizer not in LOCALIZERS:
            continue
        if now.apex is None or before.apex is None:
            if now.reason != before.reason:
                return f"{now.localizer} answers {now.reason or 'a tip'!r}, not {before.reason or 'a tip'!r}"
        elif math.dist(now.apex, before.apex) > _SAME_MM:
            return f"{now.localizer} finds the tip {1e3 * math.dist(now.apex, before.apex):.2g} um elsewhere"
    return ""


def _write_index(plan: Plan, finished: list[Unit], names: FrameNames, frames: Path) -> int:
    """Write the scene of every case, and of every frame where each is told its own, and the index; its lines."""
    written: dict[str, str] = {}  # text of a scene to its file
    text = io.StringIO()
    writer: csv.DictWriter[str] | None = None
    lines = 0
    for unit in sorted(finished, key=lambda unit: (unit.group, unit.pose)):
        group = plan.groups[unit.group]
        for case in group.cases:
            scene = told(unit, case)
            described = dump(scene)
            if described not in written:
                number = f"{names.numbers[case.key]:03d}"
                name = names.frame(case, unit.pose) if case.knowledge.drawn_anew else number
                written[described] = f"scenes/{name}.yaml"
                write_atomically(frames / written[described], described.encode(), "--frames")
            row = _line(names, group, case, unit.pose, scene, written[described])
            writer = writer or csv.DictWriter(text, list(row), lineterminator="\n")
            if not lines:
                writer.writeheader()
            writer.writerow(row)
            lines += 1
    write_atomically(frames / INDEX, text.getvalue().encode(), "--frames")
    return lines


def _line(names: FrameNames, group: Group, case: Case, pose: int, scene: Scene, file: str) -> dict[str, object]:
    """A line of the index: what a localizer is told of a frame."""
    camera, knowledge = scene.camera, case.knowledge
    sigmas = knowledge.model_dump(mode="json")
    rcm = dict(zip(("rcm_x_mm", "rcm_y_mm", "rcm_z_mm"), scene.instrument.rcm, strict=True))
    return {
        "frame": names.frame(case, pose),
        "case": names.numbers[case.key],
        "pose": pose,
        "time_s": "" if group.times is None else float(group.times[pose]),
        "image": names.image(case, pose),
        "scene": file,
        "unlit": names.unlit(case, pose) if knowledge.reference or knowledge.sequence else "",
        "width_px": camera.shape[1],
        "height_px": camera.shape[0],
        "white": scene.sensor.full_scale,
        "black": scene.sensor.black_level,
        "focal_px": camera.focal_length_px,
        "centre_x_px": float(camera.principal[0]),
        "centre_y_px": float(camera.principal[1]),
        "camera_x_mm": float(camera.centre[0]),
        "camera_y_mm": float(camera.centre[1]),
        "camera_z_mm": float(camera.centre[2]),
        "eye_radius_mm": scene.eye.radius,
        **rcm,
        "half_angle_deg": math.degrees(scene.beam.half_angle),
        "spotlights": len(scene.spotlights),
        "is_plain": "yes" if camera.is_plain else "no",
        **{
            f"{name}_sigma": sigmas[f"{name}_sigma"]
            for name in ("rcm", "half_angle", "eye_radius", "camera_height", "camera_tilt")
        },
    }
