"""A session of work on a run: from what is left of a plan to a run folder with everything in it."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from conespot.campaigns import rows_stamp
from conespot.campaigns.ending import RunError
from conespot.campaigns.executor import Executor
from conespot.campaigns.interruption import interruption
from conespot.campaigns.journal import Entry
from conespot.campaigns.lock import alone
from conespot.campaigns.log import Log
from conespot.campaigns.plan import Unit, make_plan
from conespot.campaigns.pool import LocalPool
from conespot.campaigns.schema import override, read_campaign
from conespot.campaigns.shard import Shard
from conespot.campaigns.store import Store, goes_on, look_into, open_store, read_begun_with
from conespot.campaigns.watch import Watch
from conespot.scene import InputError
from conespot.scene.atomic import write_atomically
from conespot.scene.document import Document

#: whether a session does a unit, given its entry in the journal, None if it has none
Choose = Callable[[Entry | None], bool]


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


def what_is_left(entry: Entry | None) -> bool:
    """Choose the units that are not finished, or were lost."""
    return entry is None or bool(entry.error)


def carry_out(
    document: Document,
    out: str | Path | None,
    executor: Executor,
    shard: Shard | None = None,
    choose: Choose = what_is_left,
    log: Log | None = None,
    crops: int | None = 0,
) -> Session:
    """Do what is left of a campaign and write what its folder holds: rows, theory, tables, figures, report.

    Of a `shard` its poses alone, by default into a folder that is named after it. `choose` says which poses are left,
    `log` is told of each. `crops` are pictures of so many worst frames of each box (campaigns.cropping). Raises as
    `run_campaign` does, but for poses that were lost and for interruptions while poses are measured.
    """
    plan = make_plan(document)
    units = shard.units(plan) if shard and plan.cases else list(plan.units())
    name = plan.campaign.name + (f"-{shard.number}-of-{shard.count}" if shard else "")
    folder = Path(out or Path("runs") / name)
    with contextlib.ExitStack() as meanwhile:
        # whoever measures here draws the crops too, with the scene at hand that it has loaded
        here = meanwhile.enter_context(executor.staying()) if isinstance(executor, LocalPool) else None
        with open_store(folder, plan, document) as store:
            if shard:
                store.poses = len(units)
            left = [unit for unit in units if choose(store.entries.get(unit.key))]
            if plan.cases and _measure(store, here or executor, left, Watch(store, units, left, log)):
                done = f"{len(store.entries)} of {len(units)} poses are kept"
                return Session(folder, interrupted=f"interrupted; {done}, and the same command continues the run")
            if plan.campaign.theory:
                _write_theory(folder)
            lost = tuple(entry.error for entry in store.entries.values() if entry.error)
        if plan.cases and not lost and crops != 0:
            _keep_crops(folder, crops, here or LocalPool())
    finish(folder)
    return Session(folder, lost)


def _keep_crops(folder: Path, crops: int | None, executor: Executor) -> None:
    from conespot.campaigns.cropping import keep_crops

    with alone(folder):
        try:
            keep_crops(folder, crops, executor)
        except RunError as error:  # the rows are whole without a picture
            sys.stderr.write(f"no crops: {error}\n")


def finish(folder: Path) -> None:
    """Write tables, figures and report of the rows that a run folder holds. Raises InputError."""
    from conespot.results import write_results

    with alone(folder):
        write_results(folder)


def report(folder: Path, crops: int = 0, workers: int = 1) -> None:
    """Make rows, tables, figures and report of a run folder again, of what is finished if the run still goes.

    With `crops`, the pictures of so many worst frames of each box are made anew, by that many `workers`.
    Raises InputError for a folder that is no run or holds no rows, RunError for crops that cannot be rendered.
    """
    from conespot.results import write_results

    if not folder.is_dir():
        raise InputError(f"{folder}: no such run folder; `campaign run NAME --out {folder}` makes one")
    with alone(folder):
        renew_rows(folder)
        if crops:
            from conespot.campaigns.cropping import keep_crops

            keep_crops(folder, crops, LocalPool(workers))
        write_results(folder)


def report_beside(folders: Sequence[Path], out: Path | None = None) -> tuple[Path, list[str]]:
    """Lay runs side by side on one page, by default in the first one's folder; the file and what it says.

    Raises InputError for a folder that is no run or holds no rows, and where no setting is in both.
    """
    from conespot.results.report.beside import FILE, lay_beside
    from conespot.results.run import load_run

    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"{folder}: no such run folder; `campaign run NAME --out {folder}` makes one")
        with alone(folder):
            renew_rows(folder)
    page, sentences = lay_beside([load_run(folder) for folder in folders])
    path = out or folders[0] / FILE
    write_atomically(path, page)
    return path, sentences


def renew_rows(folder: Path) -> None:
    """Write the rows of a run folder again from its journal, unless they follow from it already.

    Rows are left as they are where this installation cannot tell what the journal means: a run of another schema, one
    whose localizers are not installed, a stranger's without a journal. Raises InputError if there are none either.
    """
    from conespot.results.rows import find_rows

    begun = (folder / "journal.jsonl").exists() and (folder / "campaign.yaml").exists()
    if not begun or rows_stamp.follows(folder) or not goes_on(read_begun_with(folder)):
        return
    try:
        document = read_campaign(str(folder / "campaign.yaml"))
        plan = make_plan(document)
    except InputError:
        if find_rows(folder) is None:
            raise
        return
    if plan.campaign.made_with.get("identity") == plan.identity:
        with look_into(folder, plan) as store:
            sys.stderr.write("".join(f"{sentence}\n" for sentence in store.damage))
            store.write_rows()


def _measure(store: Store, executor: Executor, left: Sequence[Unit], watch: Watch) -> bool:
    """Measure the units that are left, then write the rows of all that is finished; True when it was interrupted."""
    frames = None
    if store.plan.campaign.frames:
        frames = store.folder / "frames"
        frames.mkdir(exist_ok=True)
    raised = False
    with interruption:
        records = executor.execute(store.plan, left, frames=frames, note=watch.note)
        try:
            for record in records:
                watch.finished(store.append(record))
        except KeyboardInterrupt:  # in a program that calls `run_campaign`; the command has the flag in its place
            raised = True
        except BaseException:
            # what ended the run is what to say, not that its rows cannot be written either
            with contextlib.suppress(InputError), alone(store.folder):
                store.write_rows()
            raise
        finally:
            records.close()
        with alone(store.folder):
            store.write_rows()
        watch.close()
        return raised or interruption.asked


def _write_theory(folder: Path) -> None:
    """Table I as theory.csv: largest distance of curve and ellipse in the plane, in 3D, and in 3D over the volume."""
    from conespot.localize.theory.conic import table_1

    lines = ["half_angle_deg,in_plane_um,distance_3d_um,volume_distance_3d_um"]
    lines += [f"{r.half_angle_deg!r},{r.in_plane_um!r},{r.distance_um!r},{r.volume_distance_um!r}" for r in table_1()]
    write_atomically(folder / "theory.csv", "".join(f"{line}\n" for line in lines).encode())
