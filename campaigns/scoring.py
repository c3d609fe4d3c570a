"""`campaign score`: what a method of somebody else found in a run's exported frames, beside the run's own."""

from __future__ import annotations

from pathlib import Path

from conespot.campaigns.begun import plan_of
from conespot.campaigns.lock import alone
from conespot.campaigns.plain_file import open_plain
from conespot.campaigns.scores import FOLDER, check_name, read_score
from conespot.campaigns.session import report
from conespot.campaigns.store import look_into
from conespot.scene import InputError
from conespot.scene.atomic import write_atomically


def score(folder: Path, estimates: Path, name: str) -> str:
    """Keep a method's estimates in a run and make its rows, tables, figures and report again; what was joined.

    A name that was scored before is replaced. Raises InputError for what is no run of this version, a name that is
    taken, or estimates that are not valid: then nothing is written.
    """
    plan = plan_of(folder)
    check_name(name, plan)
    found = read_score(estimates, name, folder, plan)
    with open_plain(estimates) as stream:
        kept = stream.read()
    home = folder / FOLDER
    try:
        home.mkdir(exist_ok=True)
    except OSError as error:
        raise InputError(f"{home}: cannot be made: {error.strerror}") from None
    with alone(folder):
        write_atomically(home / f"{name}.csv", kept)
    report(folder)
    with look_into(folder, plan) as store:
        finished = {key for key, entry in store.entries.items() if not entry.error}
    frames = sum(len(g.cases) for g in plan.groups for i in range(len(g.positions)) if g.unit(i) in finished)
    localized = sum(not finding.reason for finding in found.values())
    return (
        f"{name}: {localized} of {frames} frames localized, {len(found) - localized} refused with a reason,"
        f" {max(0, frames - len(found))} left out"
    )
