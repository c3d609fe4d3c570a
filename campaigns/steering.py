"""Looking at a run and steering it: `campaign status` and `campaign retry`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from conespot.campaigns.executor import Executor
from conespot.campaigns.journal import FILE, Entry
from conespot.campaigns.log import Log
from conespot.campaigns.plan import make_plan
from conespot.campaigns.progress import clock_time
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.session import Session, carry_out
from conespot.campaigns.standing import Standing, read_standing
from conespot.campaigns.store import look_into
from conespot.scene import InputError


def status(folder: Path) -> str:
    """Where a run stands, in words, while it goes or after; its files are only read.

    Raises InputError for a folder that is no run.
    """
    standing, running = read_standing(folder)
    if standing is None:  # an older version's, or the count is damaged
        plan = make_plan(read_campaign(str(folder / "campaign.yaml")))
        with look_into(folder, plan) as store:
            standing = store.standing()
    return "\n".join(_words(folder, standing, running))


def retry(folder: Path, reason: str | None, executor: Executor, log: Log | None) -> Session:
    """Run poses of a run again: those that were lost, or those with a `reason` that holds that text.

    Their lines stay in the journal; the new ones count. Raises as `session.carry_out` does.
    """
    if not (folder / FILE).is_file() or not (folder / "campaign.yaml").is_file():
        raise InputError(f"{folder}: is no run folder; `campaign run NAME --out {folder}` makes one")

    return carry_out(
        read_campaign(str(folder / "campaign.yaml")),
        folder,
        executor,
        choose=lambda entry: entry is not None and _failed(entry, reason),
        log=log,
    )


def _failed(entry: Entry, reason: str | None) -> bool:
    if reason is None:
        return bool(entry.error)
    return any(reason in said for said in (entry.error, *entry.reasons))


def _words(folder: Path, standing: Standing, running: bool) -> list[str]:
    share = standing.finished / standing.poses if standing.poses else 1.0
    goes = "running" if running else "done" if standing.finished == standing.poses else "not running"
    if running and standing.pace is not None and standing.left_s is not None:
        goes += f", {standing.pace:.3g} poses/s, {clock_time(standing.left_s)} left"
    lines = [f"{folder}: {standing.finished} of {standing.poses} poses ({share:.0%}), {goes}"]
    lost, failed = sum(standing.lost.values()), sum(standing.failed.values())
    if lost:
        lines.append(f"lost: {lost} poses; `campaign retry {folder} --failed` runs them again")
        lines += _reasons(standing.lost)
    lines.append(f"not localized: {failed} of {standing.answers} answers")
    return lines + _reasons(standing.failed)


def _reasons(counted: Mapping[str, int]) -> list[str]:
    """A line a reason; what a stranger's journal says cannot steer a terminal."""
    ordered = sorted(counted.items(), key=lambda item: -item[1])
    return [f"{n:8}  {''.join(c if c.isprintable() else '?' for c in reason)[:300]}" for reason, n in ordered]
