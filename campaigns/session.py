"""A session of work on a run: from what is left of the plan to rows in the store."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Mapping
from pathlib import Path

from conespot.campaigns.ending import Ending
from conespot.campaigns.executor import execute
from conespot.campaigns.plan import Plan, make_plan
from conespot.campaigns.progress import Progress
from conespot.campaigns.schema import override, read_campaign
from conespot.campaigns.store import Store, made_with, open_store
from conespot.scene import InputError
from conespot.scene.atomic import write_atomically


def run_campaign(
    campaign: str | Path, out: Path | None = None, *, workers: int = 1, settings: Mapping[str, str] | None = None
) -> Path:
    """Run a shipped campaign or a YAML file, or continue it; the run folder, with its rows but no report yet.

    `out` is the run folder (default runs/NAME), `settings` are keys and YAML values such as {"poses": "10"}.
    Raises InputError for what a user can mend, RunError if the disk refuses or nothing can run.
    """
    document = read_campaign(str(campaign))
    for key, value in (settings or {}).items():
        document = override(document, key, value, f"settings[{key!r}]")
    plan = make_plan(document)
    folder = out or Path("runs") / plan.campaign.name
    with open_store(folder, plan, document) as store:
        if plan.cases:
            measure(plan, store, workers)
        if plan.campaign.theory:
            write_theory(folder)
    return folder


def measure(plan: Plan, store: Store, workers: int) -> Ending:
    """Do what is left, then write the rows of all that is finished; the exit code.

    Units that were lost before are tried again. Raises RunError if the disk refuses or nothing can run.
    """
    left = [u for u in plan.units() if u.key not in store.records or store.records[u.key].error]
    groups = {unit.key: plan.groups[unit.group] for unit in left}
    progress = Progress(
        sum(group.frames for group in groups.values()), sum(group.work for group in groups.values()), sys.stderr
    )
    _say_where_it_stands(plan, store, len(left), progress)
    frames = None
    if plan.campaign.frames:
        frames = store.folder / "frames"
        frames.mkdir(exist_ok=True)
    interrupted = False
    crew = execute(plan, left, max(1, min(workers, len(left))), frames=frames, note=progress.note)
    try:
        for record in crew:
            store.append(record)
            group = groups[record.unit]
            progress.update(group.frames, group.work, sum(bool(f.reason) for f in record.findings))
    except KeyboardInterrupt:
        interrupted = True
    except BaseException:
        # what ended the run is what to say, not that its rows cannot be written either
        with contextlib.suppress(InputError):
            store.write_rows()
        raise
    finally:
        crew.close()
    store.write_rows()
    progress.close()
    lost = [record for record in store.records.values() if record.error]
    if interrupted:
        done = f"{len(store.records)} of {sum(len(g.positions) for g in plan.groups)} poses are kept"
        progress.note(f"campaign: interrupted; {done}, and the same command continues the run")
        return Ending.INTERRUPTED
    if lost:
        progress.note(
            f"campaign: {len(lost)} poses were lost, the first: {lost[0].error}; the same command retries them"
        )
    return Ending.FAILED if lost else Ending.DONE


def write_theory(folder: Path) -> None:
    """Table I as theory.csv: largest distance of curve and ellipse in the plane, in 3D, and in 3D over the volume."""
    from conespot.localize.theory.conic import table_1

    lines = ["half_angle_deg,in_plane_um,distance_3d_um,volume_distance_3d_um"]
    lines += [f"{r.half_angle_deg!r},{r.in_plane_um!r},{r.distance_um!r},{r.volume_distance_um!r}" for r in table_1()]
    write_atomically(folder / "theory.csv", "".join(f"{line}\n" for line in lines).encode())


def _say_where_it_stands(plan: Plan, store: Store, left: int, progress: Progress) -> None:
    poses = sum(len(group.positions) for group in plan.groups)
    if left < poses:
        progress.note(f"{store.folder}: {poses - left} of {poses} poses are finished, continuing")
    else:
        progress.note(f"{store.folder}: {poses} poses, {plan.frames} frames, {plan.rows} localizations")
    changed = [k for k, v in made_with(plan).items() if store.begun_with.get(k) != v]
    if changed and left < poses:
        before = ", ".join(f"{k} {store.begun_with.get(k)}" for k in changed)
        progress.note(f"the run was begun with {before}; rows of both are mixed from here on")
