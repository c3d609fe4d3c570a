"""campaigns.pool: workers that die, raise or never live lose nothing that is finished. The bench is a fake."""

import os
import signal
import subprocess
import sys
import time
import warnings

import pytest

from conespot.campaigns.ending import RunError
from conespot.campaigns.plan import make_plan
from conespot.campaigns.pool import LocalPool
from conespot.campaigns.row import Finding, Record
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.worker import Worker


class FakeBench:
    """Answers at once; what happens at which pose stands in the file `script` of the folder it is given."""

    worn = False

    def __init__(self, plan, folder):
        self.plan, self.folder = plan, folder
        self.script = dict(line.split() for line in (folder / "script").read_text().splitlines())

    def measure(self, unit):
        what = self.script.get(str(unit.pose)) if unit.group == 0 else None
        tried = self.folder / f"tried-{unit.key}"
        first, _ = not tried.exists(), tried.touch()
        (self.folder / f"did-{os.getpid()}-{unit.key}").touch()
        if what == "dies" or (what == "dies-once" and first):
            os.kill(os.getpid(), signal.SIGKILL)
        if what == "hangs":
            time.sleep(3600)
        if what == "exits":
            os._exit(3)
        if what == "raises":
            raise ValueError("no such\nluck")
        if what == "wears":
            self.worn = True
        group = self.plan.groups[unit.group]
        findings = [Finding(case=c.key, localizer=n, reason="fake") for c in group.cases for n in c.localizers]
        return Record(unit=unit.key, findings=findings)


def lives(plan, folder):
    return FakeBench(plan, folder)


def cannot_start(plan, folder):
    raise RuntimeError("mitsuba 3.10 is installed but 3.9.* is needed")


def dies_at_once(plan, folder):
    os.abort()


def warns(plan, folder):
    warnings.warn("rendering with the slow scalar variant", RuntimeWarning, stacklevel=1)
    return FakeBench(plan, folder)


@pytest.fixture
def plan(tmp_path):
    (tmp_path / "c.yaml").write_text("scene: paper\nposes: 6\nsweep: {scene.surface: [smooth, bumps]}\n")
    (tmp_path / "script").touch()
    return make_plan(read_campaign(str(tmp_path / "c.yaml")))


def do(plan, tmp_path, workers=2, make=lives, script="", limit_s=3600.0):
    (tmp_path / "script").write_text(script)
    notes = []
    pool = LocalPool(workers, make, limit_s)
    records = {r.unit: r for r in pool.execute(plan, plan.units(), frames=tmp_path, note=notes.append)}
    return records, notes


def errors(plan, records):
    return {u.pose: records[u.key].error for u in plan.units() if records[u.key].error}


def test_every_unit_is_done_once(plan, tmp_path):
    records, notes = do(plan, tmp_path)
    assert set(records) == {u.key for u in plan.units()}
    assert errors(plan, records) == {}
    assert notes == []
    assert len(list(tmp_path.glob("did-*"))) == 12


def test_a_worker_keeps_to_its_scene_while_there_is_work_in_it(plan, tmp_path):
    do(plan, tmp_path)
    seen = {}
    for path in tmp_path.glob("did-*"):
        _, pid, group, _ = path.name.split("-")
        seen.setdefault(pid, set()).add(group)
    assert sum(map(len, seen.values())) <= 3  # at most one of two workers helps the other at the end


def test_code_that_raises_costs_its_unit_alone(plan, tmp_path):
    records, notes = do(plan, tmp_path, script="2 raises")
    assert len(records) == 12
    assert list(errors(plan, records)) == [2]
    assert errors(plan, records)[2].startswith("ValueError: no such luck (test_pool.py:")
    assert notes == []


def test_a_unit_whose_worker_dies_is_tried_once_more(plan, tmp_path):
    records, notes = do(plan, tmp_path, script="1 dies-once")
    assert len(records) == 12
    assert errors(plan, records) == {}
    assert notes == [
        "a worker was killed by SIGKILL (out of memory?) at pose 1 of box, single, smooth; trying that pose once more"
    ]


@pytest.mark.parametrize("workers", [2, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("how", "says"),
    [
        ("dies", "was killed by SIGKILL (out of memory?)"),
        pytest.param("exits", "ended with exit code 3", marks=pytest.mark.slow),
    ],
)
def test_a_unit_that_kills_two_workers_is_given_up_and_no_other(plan, tmp_path, workers, how, says):
    records, notes = do(plan, tmp_path, workers, script=f"0 {how}\n4 {how}")
    assert len(records) == 12
    assert errors(plan, records) == {0: f"the worker {says}, twice", 4: f"the worker {says}, twice"}
    assert len(notes) == 4


def test_a_pose_that_hangs_is_stopped_tried_once_more_and_given_up(plan, tmp_path, monkeypatch):
    group = plan.groups[0].key

    def since(worker):
        """No time passes but for the one who hangs, so that nobody is slow under load."""
        return 3601.0 if worker.unit.key == f"{group}-4" and (tmp_path / f"tried-{worker.unit.key}").exists() else 0.0

    monkeypatch.setattr(Worker, "since", property(since))
    records, notes = do(plan, tmp_path, script="4 hangs")
    assert len(records) == 12
    assert errors(plan, records) == {4: "the worker took longer than 3600 s, twice"}
    assert len(notes) == 2


def test_a_worn_worker_makes_room_for_a_fresh_one(plan, tmp_path):
    records, notes = do(plan, tmp_path, workers=1, script="0 wears\n3 wears")
    assert len(records) == 12
    assert notes == []
    assert len({p.name.split("-")[1] for p in tmp_path.glob("did-*")}) == 3


def test_workers_that_cannot_start_end_the_run_with_their_reason(plan, tmp_path):
    with pytest.raises(
        RunError, match="cannot render: mitsuba 3.10 is installed but 3.9.* is needed; try `campaign doctor`"
    ):
        do(plan, tmp_path, make=cannot_start)


def test_workers_that_die_before_anything_is_finished_end_the_run(plan, tmp_path):
    with pytest.raises(RunError, match="no worker lives to finish anything, the last was killed by SIGABRT"):
        do(plan, tmp_path, make=dies_at_once)


def test_a_warning_of_all_workers_is_said_once(plan, tmp_path):
    _, notes = do(plan, tmp_path, make=warns)
    assert notes == ["rendering with the slow scalar variant"]


def test_closing_stops_the_workers(plan, tmp_path):
    records = LocalPool(2, lives).execute(plan, plan.units(), frames=tmp_path, note=print)
    next(records)
    started = {int(p.name.split("-")[1]) for p in tmp_path.glob("did-*")}
    records.close()
    for _ in range(50):
        alive = {pid for pid in started if os.path.exists(f"/proc/{pid}")}
        if not alive:
            break
        time.sleep(0.1)
    assert not alive


def test_workers_that_stay_measure_more_of_the_same_plan(plan, tmp_path):
    units = list(plan.units())
    with LocalPool(1, lives).staying() as crew:
        for part in (units[:3], units[3:5]):
            records = crew.execute(plan, part, frames=tmp_path, note=print)
            assert [record.unit for record in records] == [unit.key for unit in part]
    assert len({path.name.split("-")[1] for path in tmp_path.glob("did-*")}) == 1


def test_the_environment_is_as_it_was(plan, tmp_path, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    do(plan, tmp_path)
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "MKL_NUM_THREADS" not in os.environ
    assert signal.pthread_sigmask(signal.SIG_BLOCK, set()) == set()


def test_a_plan_reaches_its_worker_without_what_only_some_poses_need():
    code = "import sys, conespot.campaigns.plan, conespot.campaigns.worker; print(sys.modules.keys() & set(sys.argv))"
    command = [sys.executable, "-c", code, "scipy", "pandas", "matplotlib", "mitsuba"]
    assert subprocess.run(command, capture_output=True, text=True).stdout == "set()\n"
