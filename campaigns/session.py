"""A session of work on a run: from what is left of a plan to a run folder with everything in it."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from conespot.campaigns.ending import RunError
from conespot.campaigns.executor import Executor
from conespot.campaigns.interruption import interruption
from conespot.campaigns.maker import Makers, in_a_line, maker
from conespot.campaigns.plan import Plan, Unit, make_plan
from conespot.campaigns.pool import LocalPool
from conespot.campaigns.progress import Progress
from conespot.campaigns.schema import override, read_campaign
from conespot.campaigns.shard import Shard
from conespot.campaigns.store import Store, goes_on, open_store, read_begun_with
from conespot.scene import InputError
from conespot.scene.atomic import write_atomically
from conespot.scene.document import Document


@dataclass(frozen=True)
class Session:
    """How a session ended: the run folder, the errors of poses that were `lost`, which another tries again.

    `interrupted` says what is kept if the session was interrupted: then the rows are written and nothing else.
    """

    folder: Path
    lost: tuple[str, ...] = ()
    interrupted: str = ""

    @property
    def sentence(self) -> str:
        """What to say of the poses that were lost."""
        return f"{len(self.lost)} poses were lost, the first: {self.lost[0]}; the same command retries them"


def run_campaign(
    campaign: str | Path,
    out: str | Path | None = None,
    *,
    workers: int = 1,
    settings: Mapping[str, str] | None = None,
    executor: Executor | None = None,
) -> Path:
    """Run a shipped campaign or a YAML file, or continue it, as `campaign run` does; the run folder.

    `out` is the run folder (default runs/NAME), `settings` are keys and YAML values such as {"poses": "10"}. The work
    is done by `workers` processes of this machine, or by the `executor`; a script must start processes below
    `if __name__ == "__main__":`. Progress goes to stderr. `load_run` reads what the folder holds.

    Raises InputError for what a user can mend, RunError if the disk refuses, nothing can run or poses were lost (all
    others are in the folder), and KeyboardInterrupt, after which the same call goes on where it was.
    """
    document = read_campaign(str(campaign))
    for key, value in (settings or {}).items():
        document = override(document, key, value, f"settings[{key!r}]")
    session = carry_out(document, out, executor or LocalPool(workers))
    if session.interrupted:
        raise KeyboardInterrupt(session.interrupted)
    if session.lost:
        raise RunError(session.sentence)
    return session.folder


def carry_out(document: Document, out: str | Path | None, executor: Executor, shard: Shard | None = None) -> Session:
    """Do what is left of a campaign and write what its folder holds: rows, theory, tables, figures, report.

    Of a `shard` its poses alone, by default into a folder that is named after it.
    Raises as `run_campaign` does, but for poses that were lost and for interruptions while poses are measured.
    """
    from conespot.results import write_results

    plan = make_plan(document)
    units = shard.units(plan) if shard and plan.cases else list(plan.units())
    name = plan.campaign.name + (f"-{shard.number}-of-{shard.count}" if shard else "")
    folder = Path(out or Path("runs") / name)
    with open_store(folder, plan, document) as store:
        if plan.cases and _measure(plan, store, executor, units):
            done = f"{len(store.entries)} of {len(units)} poses are kept"
            return Session(folder, interrupted=f"interrupted; {done}, and the same command continues the run")
        if plan.campaign.theory:
            _write_theory(folder)
        lost = tuple(entry.error for entry in store.entries.values() if entry.error)
    write_results(folder)
    return Session(folder, lost)


def renew_rows(folder: Path) -> None:
    """Write the rows of a run folder again from its journal.

    Rows are left as they are where this installation cannot tell what the journal means: a run of another schema, one
    whose localizers are not installed, a stranger's without a journal. Raises InputError if there are none either.
    """
    from conespot.results.rows import find_rows

    begun = (folder / "journal.jsonl").exists() and (folder / "campaign.yaml").exists()
    if not begun or not goes_on(read_begun_with(folder)):
        return
    try:
        document = read_campaign(str(folder / "campaign.yaml"))
        plan = make_plan(document)
    except InputError:
        if find_rows(folder) is None:
            raise
        return
    if plan.campaign.made_with.get("identity") == plan.identity:
        with open_store(folder, plan, document) as store:
            sys.stderr.write("".join(f"{sentence}\n" for sentence in store.damage))
            store.write_rows()


def _measure(plan: Plan, store: Store, executor: Executor, units: Sequence[Unit]) -> bool:
    """Do what is left of the units, then write the rows of all that is finished; True when it was interrupted.

    Units that were lost before are tried again.
    """
    left = [u for u in units if u.key not in store.entries or store.entries[u.key].error]
    groups = {unit.key: plan.groups[unit.group] for unit in left}
    progress = Progress(
        sum(group.frames for group in groups.values()), sum(group.work for group in groups.values()), sys.stderr
    )
    begun = in_a_line(store.begun_with)
    makers = Makers(entry.by or begun for entry in store.entries.values())
    _say_where_it_stands(store, units, len(left), progress, makers)
    frames = None
    if plan.campaign.frames:
        frames = store.folder / "frames"
        frames.mkdir(exist_ok=True)
    raised = False
    with interruption:
        records = executor.execute(plan, left, frames=frames, note=progress.note)
        try:
            for record in records:
                kept = store.append(record)
                if another := makers.meet(kept.by):
                    progress.note(another)
                group = groups[record.unit]
                progress.update(group.frames, group.work, sum(bool(f.reason) for f in record.findings))
        except KeyboardInterrupt:  # in a program that calls `run_campaign`; the command has the flag in its place
            raised = True
        except BaseException:
            # what ended the run is what to say, not that its rows cannot be written either
            with contextlib.suppress(InputError):
                store.write_rows()
            raise
        finally:
            records.close()
        store.write_rows()
        progress.close()
        return raised or interruption.asked


def _write_theory(folder: Path) -> None:
    """Table I as theory.csv: largest distance of curve and ellipse in the plane, in 3D, and in 3D over the volume."""
    from conespot.localize.theory.conic import table_1

    lines = ["half_angle_deg,in_plane_um,distance_3d_um,volume_distance_3d_um"]
    lines += [f"{r.half_angle_deg!r},{r.in_plane_um!r},{r.distance_um!r},{r.volume_distance_um!r}" for r in table_1()]
    write_atomically(folder / "theory.csv", "".join(f"{line}\n" for line in lines).encode())


def _say_where_it_stands(store: Store, units: Sequence[Unit], left: int, progress: Progress, makers: Makers) -> None:
    for sentence in store.damage:
        progress.note(sentence)
    poses = len(units)
    if left < poses:
        progress.note(f"{store.folder}: {poses - left} of {poses} poses are finished, continuing")
    else:
        groups = [store.plan.groups[unit.group] for unit in units]
        frames, rows = sum(group.frames for group in groups), sum(group.rows for group in groups)
        progress.note(f"{store.folder}: {poses} poses, {frames} frames, {rows} localizations")
    if left and (another := makers.expect(maker())):
        progress.note(another)
