"""Dask workers in processes of their own that die, hang, fall silent or lose their scheduler. The bench is a fake."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from conespot.campaigns.dask_cluster import DaskCluster
from conespot.campaigns.ending import RunError
from conespot.campaigns.plan import make_plan
from conespot.campaigns.profile import LocalMachine, Scheduler
from conespot.campaigns.row import Finding, Record
from conespot.campaigns.schema import read_campaign

pytestmark = pytest.mark.slow


class FakeBench:
    """Takes 20 ms a pose; what else happens at which pose stands in the file `script` of the folder of frames."""

    worn = False
    variant = "fake"

    def __init__(self, plan, folder):
        self.plan, self.folder = plan, folder
        self.script = dict(line.split() for line in (folder / "script").read_text().splitlines())

    def measure(self, unit):
        what = self.script.get(str(unit.pose))
        tried = self.folder / f"tried-{unit.pose}"
        first, _ = not tried.exists(), tried.touch()
        (self.folder / f"did-{os.getpid()}-{unit.pose}").touch()
        time.sleep(0.02)
        if what == "dies":
            os.kill(os.getpid(), signal.SIGKILL)
        if what == "hangs-once" and first:
            time.sleep(3600)
        if what == "wears" and first:
            self.worn = True
        if what == "leaks" and first:
            while len({path.name.split("-")[1] for path in self.folder.glob("did-*")}) < 2:
                time.sleep(0.02)  # until the other worker has begun too, however busy the machine is
            self.kept = b"x" * 800_000_000
            time.sleep(3600)
        cases = self.plan.groups[unit.group].cases
        return Record(unit=unit.key, findings=[Finding(case=c.key, localizer="paper", reason="fake") for c in cases])


def lives(plan, folder):
    return FakeBench(plan, folder)


@pytest.fixture
def plan(tmp_path):
    (tmp_path / "c.yaml").write_text("scene: paper\nposes: 200\nlocalizers: [paper]\n")
    return make_plan(read_campaign(str(tmp_path / "c.yaml")))


def do(plan, profile, folder, script="", then=lambda count: None):
    (folder / "script").write_text(script)
    notes, records = [], []
    for record in DaskCluster(profile, lives).execute(plan, plan.units(), frames=folder, note=notes.append):
        records.append(record)
        then(len(records))
    assert sorted(r.unit for r in records) == sorted(u.key for u in plan.units())
    return {int(r.unit.partition("-")[2]): r.error for r in records if r.error}, notes


def test_poses_that_kill_or_hang_are_found_given_up_and_no_other_is_blamed(plan, tmp_path):
    machine = LocalMachine(kind="local", workers=2, pose_limit=15.0)
    errors, notes = do(plan, machine, tmp_path, "50 dies\n120 hangs-once\n121 dies\n150 wears")
    assert errors == {50: "the worker was lost, twice", 121: "the worker was lost, twice"}
    assert any(note.endswith("trying each of them alone") for note in notes)
    assert any(note.startswith("a worker took longer than 15 s") for note in notes)


def test_a_worker_that_is_killed_from_outside_costs_no_pose(plan, tmp_path):
    def kill(count):
        if count in (20, 100):
            newest = max(tmp_path.glob("did-*"), key=lambda path: path.stat().st_mtime_ns)
            os.kill(int(newest.name.split("-")[1]), signal.SIGKILL)

    errors, notes = do(plan, LocalMachine(kind="local", workers=2), tmp_path, then=kill)
    assert errors == {}
    assert 1 <= len([note for note in notes if note.startswith("a worker was lost")]) <= 2


def test_a_worker_that_leaks_is_replaced_by_its_nanny_and_costs_no_pose(plan, tmp_path, caplog):
    machine = LocalMachine(kind="local", workers=2, memory="600 MB")
    errors, notes = do(plan, machine, tmp_path, "60 leaks")
    assert errors == {}
    assert len([note for note in notes if note.startswith("a worker was lost")]) == 1
    assert "Restarting worker" in caplog.text  # Dask's nanny; the new one may find all poses done
    assert len({name.name.split("-")[1] for name in tmp_path.glob("did-*")}) in (2, 3)


class Scheduling:
    """A scheduler and workers that somebody else has started, each a process with children of its own."""

    def __init__(self, folder):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = str(free.getsockname()[1])
        self.folder, self.address = folder, f"tcp://127.0.0.1:{self.port}"
        self.processes = []

    def start(self, *command):
        program = [sys.executable, "-m", f"distributed.cli.{command[0]}", *command[1:]]
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        # the fake bench reaches a worker by its module's name
        env = os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}
        self.processes.append(subprocess.Popen(program, cwd=self.folder, env=env, **quiet))
        return self.processes[-1]

    def scheduler(self):
        return self.start("dask_scheduler", "--host", "127.0.0.1", "--port", self.port, "--no-dashboard")

    def worker(self):
        return self.start("dask_worker", self.address, "--nthreads", "1", "--no-dashboard")

    def stop(self):
        for process in self.processes:
            process.terminate()
        for process in self.processes:
            process.wait(timeout=60)


@pytest.fixture
def scheduling(tmp_path, monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL", "3s")
    found = Scheduling(tmp_path)
    yield found
    found.stop()


def test_a_killed_scheduler_ends_the_run_in_a_sentence_and_a_new_one_goes_on(plan, tmp_path, scheduling):
    first = scheduling.scheduler()
    scheduling.worker()
    profile = Scheduler(kind="scheduler", address=scheduling.address)
    with pytest.raises(RunError, match=f"{scheduling.address}: the scheduler is gone; what is finished is kept"):
        do(plan, profile, tmp_path, then=lambda count: first.kill() if count == 20 else None)
    scheduling.scheduler()
    scheduling.worker()
    errors, _ = do(plan, profile, tmp_path)
    assert errors == {}


def test_the_batch_of_a_worker_that_falls_silent_is_given_to_others(plan, tmp_path, scheduling):
    scheduling.scheduler()
    scheduling.worker()
    scheduling.worker()
    stopped = []

    def stop(count):
        if count >= 20 and not stopped:
            newest = max(tmp_path.glob("did-*"), key=lambda path: path.stat().st_mtime_ns)
            stopped.append(int(newest.name.split("-")[1]))
            os.kill(stopped[0], signal.SIGSTOP)

    errors, notes = do(plan, Scheduler(kind="scheduler", address=scheduling.address), tmp_path, then=stop)
    assert errors == {}
    assert len([note for note in notes if note.startswith("a worker was lost")]) == 1
