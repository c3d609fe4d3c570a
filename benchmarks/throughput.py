"""How busy campaigns keep their workers: poses that take 10 ms each, through an executor onto the disk.

Run with `python benchmarks/throughput.py [POSES]`, 10,000 of them without one. A pose is simulated: it sleeps 10 ms and
answers for one localizer. Each line says for how much of the time between the first and the last record its workers
were at a pose, with every record in the journal and on the disk, as in a run. Threads of workers: one each.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from conespot.campaigns.dask_cluster import DaskCluster
from conespot.campaigns.executor import Executor
from conespot.campaigns.plan import Plan, Unit, make_plan
from conespot.campaigns.pool import LocalPool
from conespot.campaigns.profile import LocalMachine
from conespot.campaigns.row import Finding, Record
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.store import open_store

POSE_S = 0.01


class Sleeper:
    """A bench that renders nothing."""

    worn = False
    variant = "none"

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    def measure(self, unit: Unit) -> Record:
        """Sleep, and answer as a localizer that finds nothing."""
        time.sleep(POSE_S)
        cases = self._plan.groups[unit.group].cases
        return Record(unit=unit.key, findings=tuple(Finding(case=c.key, localizer="paper", reason="-") for c in cases))


def make(plan: Plan, _frames: Path | None) -> Sleeper:
    """The bench of a worker."""
    return Sleeper(plan)


def measured(poses: int, workers: int, executor: Executor) -> str:
    """Run that many poses and say how busy the workers were."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "c.yaml"
        path.write_text(f"scene: paper\nposes: {poses}\nlocalizers: [paper]\n")
        document = read_campaign(str(path))
        plan = make_plan(document)
        begun, first, count = time.perf_counter(), 0.0, 0
        with open_store(Path(folder) / "run", plan, document) as store:
            for record in executor.execute(plan, plan.units(), frames=None, note=print):
                store.append(record)
                first, count = first or time.perf_counter(), count + 1
        seconds = time.perf_counter() - first
    busy = count * POSE_S / workers / seconds
    return f"{count / seconds:6.0f} poses/s, {busy:4.0%} busy, first record after {first - begun:.1f} s"


def main() -> None:
    """Print the figures."""
    poses = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    for workers in (1, 2):
        local = LocalPool(workers, make)
        dask = DaskCluster(LocalMachine(kind="local", workers=workers), make)
        for name, executor in (("local pool", local), ("Dask", dask)):
            sys.stdout.write(f"{name:10} {workers} workers {measured(poses, workers, executor)}\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
