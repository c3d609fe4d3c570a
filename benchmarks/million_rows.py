"""A run of 10^6 rows: how long its plan, its status and its report take, and how much memory each of them needs.

`python benchmarks/million_rows.py [FOLDER] [--powers N] [--poses N]` makes a campaign of that many powers and poses for
two localizers, a run folder of made-up answers, every tenth a failure, and prints a line for each step. Every step is a
process of its own, so that its peak is its own. `--campaign power_sweep --crops 1` takes a shipped campaign instead,
whose 5,600 rows get crops of the worst of each box: rendered by the step `crops`, in the page of the step `again`.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterable
from pathlib import Path

import numpy as np

from conespot import campaigns
from conespot.campaigns.command import main as campaign
from conespot.campaigns.plan import Plan, Unit, make_plan
from conespot.campaigns.row import Finding, Record
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.store import open_store

LOCALIZERS = ("paper", "paper-code")


def answers(plan: Plan, units: Iterable[Unit]) -> Generator[Record]:
    """Records that look like those of a bench: 20 um of error, and every tenth a failure."""
    noise = np.random.default_rng(1)
    for unit in units:
        group = plan.groups[unit.group]
        pose = group.pose(unit.pose)
        axis = tuple(map(float, pose.axis))
        count = group.rows
        tips = (pose.apex + noise.normal(0.0, 0.02, (count, 3))).tolist()
        lost = (noise.random(count) < 0.1).tolist()
        pairs = [(case.key, name) for case in group.cases for name in case.localizers]
        yield Record(
            unit=unit.key,
            findings=tuple(
                Finding(case=case, localizer=name, reason="no spotlight was found")
                if lost[i]
                else Finding(case=case, localizer=name, apex=tuple(tips[i]), axis=axis)
                for i, (case, name) in enumerate(pairs)
            ),
        )


def _fill(folder: Path) -> None:
    document = read_campaign(str(folder / "c.yaml"))
    plan = make_plan(document)
    with open_store(folder / "run", plan, document) as store:
        for record in answers(plan, plan.units()):
            store.append(record)


STEPS: dict[str, Callable[[Path], object]] = {
    "plan": lambda folder: campaign(["plan", str(folder / "c.yaml")]),
    "fill": _fill,
    "status": lambda folder: campaign(["status", str(folder / "run")]),
    "count": lambda folder: ((folder / "run/progress.json").write_text(_stale(folder)), STEPS["status"](folder)),
    "report": lambda folder: campaign(["report", str(folder / "run")]),
    "crops": lambda folder: campaign(["report", str(folder / "run"), "--crops", "1"]),
    "again": lambda folder: campaign(["report", str(folder / "run")]),  # whose rows follow from the journal already
}


def _stale(folder: Path) -> str:
    return (folder / "run/progress.json").read_text().replace('"journal_bytes":', '"journal_bytes":1')


def main() -> None:
    """Print time and peak of each step."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path)
    parser.add_argument("--powers", type=int, default=1000)
    parser.add_argument("--poses", type=int, default=500)
    parser.add_argument("--campaign", help="a shipped one")
    parser.add_argument("--crops", type=int, choices=(0, 1), default=0)
    parser.add_argument("--step", choices=list(STEPS))
    options = parser.parse_args()
    if options.step:
        STEPS[options.step](options.folder)
        return
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        folder.mkdir(exist_ok=True)
        powers = ", ".join(f"{0.001 * (i + 1):.3f} W" for i in range(options.powers))
        made = (
            f"scene: paper\nposes: {options.poses}\nlocalizers: [{', '.join(LOCALIZERS)}]\n"
            f"sweep: {{scene.power.value: [{powers}]}}\n"
        )
        shipped = Path(campaigns.__path__[0]) / f"{options.campaign}.yaml"
        (folder / "c.yaml").write_text(shipped.read_text() if options.campaign else made)
        for step in STEPS if options.crops else [step for step in STEPS if step != "crops"]:
            begin = time.perf_counter()
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            done = subprocess.run(
                [sys.executable, __file__, str(folder), "--step", step], check=True, stdout=subprocess.DEVNULL
            )
            assert done.returncode == 0
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            worked = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
            most = "" if after.ru_maxrss > before.ru_maxrss else "at most "
            wall = f"{time.perf_counter() - begin:6.1f} s, {worked:6.1f} s of processor time"
            sys.stdout.write(f"{step:8} {wall}, peak {most}{after.ru_maxrss / 1024:.0f} MB\n")
            sys.stdout.flush()
        page = folder / "run" / "report.html"
        sys.stdout.write(f"report.html has {page.stat().st_size / 1e6:.1f} MB\n")


if __name__ == "__main__":
    main()
