"""Interruptions of `campaign run` as terminals, clusters and users in a hurry send them. Only the bench is a fake."""

import json
import os
import random
import signal
import subprocess
import sys
import time

import pandas as pd
import pytest

#: the command, but for what measures a pose, and for rows that may take long to write
COMMAND = """\
import os, sys, time
from pathlib import Path
from conespot.campaigns.command import main
from conespot.campaigns.row import Finding, Record

class Bench:
    worn = False
    def __init__(self, plan):
        self.plan = plan
    def measure(self, unit):
        Path(f"worker-{os.getpid()}").touch()
        time.sleep(float(os.environ["POSE_S"]))
        cases = self.plan.groups[unit.group].cases
        return Record(unit=unit.key, findings=[Finding(case=c.key, localizer="paper", reason="fake") for c in cases])

def make(plan, frames):
    return Bench(plan)

if __name__ == "__main__":
    from conespot.campaigns import pool, store
    class Pool(pool.LocalPool):
        def __init__(self, workers):
            super().__init__(workers, make)

    pool.LocalPool = Pool
    if "ROWS_S" in os.environ:
        store.Store.write_rows = lambda self: (Path("writes").touch(), time.sleep(float(os.environ["ROWS_S"])))
    sys.exit(main())
"""
SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
every_signal = pytest.mark.parametrize("number", SIGNALS, ids=lambda number: number.name)


def begin(folder, poses=2000, ignored=(), **environment):
    """Start a run in a process group of its own, as a shell does."""
    (folder / "campaign.py").write_text(COMMAND)
    (folder / "c.yaml").write_text(f"scene: paper\nposes: {poses}\nlocalizers: [paper]\n")

    def as_a_shell_does():
        for number in SIGNALS:
            signal.signal(number, signal.SIG_IGN if number in ignored else signal.SIG_DFL)

    return subprocess.Popen(
        [sys.executable, "campaign.py", "run", "c.yaml", "--workers", "1", "--out", "run"],
        cwd=folder,
        env={**os.environ, "POSE_S": "0.002", **environment},
        start_new_session=True,
        preexec_fn=as_a_shell_does,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_until(true, seconds=300):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.01)


def finished(folder):
    journal = folder / "run" / "journal.jsonl"
    return journal.read_bytes().count(b"\n") if journal.exists() else 0


def running(folder):
    """The workers that were ever at work in the folder and still live."""

    def lives(pid):
        try:
            with open(f"/proc/{pid}/stat") as stat:
                return stat.read().rpartition(")")[2].split()[0] != "Z"
        except OSError:
            return False

    return [pid for path in folder.glob("worker-*") if lives(pid := path.name.split("-")[1])]


def assert_whole(folder, process, err):
    """The run ended as interrupted, in a sentence, and its rows are those of its journal."""
    assert process.returncode == 130, err
    lines = (folder / "run" / "journal.jsonl").read_bytes().splitlines(keepends=True)
    assert all(line.endswith(b"\n") and json.loads(line) for line in lines)
    assert "Traceback" not in err
    said = f"campaign: interrupted; {len(lines)} of 2000 poses are kept, and the same command continues the run\n"
    assert err.endswith(said)
    assert err.count("interrupted") == 1
    assert len(pd.read_csv(folder / "run" / "errors.csv")) == len(lines)
    assert len(pd.read_parquet(folder / "run" / "errors.parquet")) == len(lines)
    assert not list((folder / "run").rglob("*.tmp"))
    assert not running(folder)


def test_ctrl_c_to_all_processes_leaves_the_rows_of_every_pose_in_the_journal(tmp_path):
    process = begin(tmp_path)
    wait_until(lambda: finished(tmp_path) >= 3)
    os.killpg(process.pid, signal.SIGINT)
    os.killpg(process.pid, signal.SIGINT)  # `timeout` and a terminal that hangs up send it twice
    _, err = process.communicate(timeout=300)
    assert_whole(tmp_path, process, err)
    assert "a worker" not in err


def test_a_second_ctrl_c_ends_at_once_and_what_is_finished_is_kept(tmp_path):
    process = begin(tmp_path, ROWS_S="60")
    wait_until(lambda: finished(tmp_path) >= 3)
    os.killpg(process.pid, signal.SIGINT)
    wait_until((tmp_path / "writes").exists)
    time.sleep(0.3)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 130
    said = "campaign: interrupted; what is finished is kept, and the same command continues the run\n"
    assert err.endswith(said)
    assert err.count("campaign: ") == 1
    assert "Traceback" not in err
    lines = (tmp_path / "run" / "journal.jsonl").read_bytes().splitlines(keepends=True)
    assert all(line.endswith(b"\n") and json.loads(line) for line in lines)
    wait_until(lambda: not running(tmp_path), 5)


@pytest.mark.slow
def test_a_signal_that_was_ignored_at_the_start_stays_ignored(tmp_path):
    """As `nohup` starts a run, and as a shell starts one in the background."""
    process = begin(tmp_path, poses=20, ignored=[signal.SIGHUP, signal.SIGINT], POSE_S="0.05")
    wait_until(lambda: finished(tmp_path) >= 3)
    os.killpg(process.pid, signal.SIGHUP)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    assert finished(tmp_path) == 20


@pytest.mark.slow
def test_workers_end_in_the_middle_of_a_pose_when_the_command_is_killed(tmp_path):
    process = begin(tmp_path, POSE_S="60")
    wait_until(lambda: list(tmp_path.glob("worker-*")))
    process.kill()
    process.communicate(timeout=300)
    wait_until(lambda: not running(tmp_path), 5)


@every_signal
def test_a_signal_before_there_is_a_loop_ends_the_command_in_a_sentence(number):
    """At the first instruction after the command listens, when nothing heavy is imported yet."""
    script = (
        "import os, signal, sys\n"
        f"signal.signal({int(number)}, signal.SIG_DFL)\n"
        "from conespot.campaigns import command\n"
        "assert not {'argparse', 'conespot.scene', 'numpy'} & set(sys.modules)\n"
        f"command._options = lambda arguments: os.kill(os.getpid(), {int(number)})\n"
        "command.main()\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "campaign: interrupted\n")


@pytest.fixture
def load():
    """Two processes that are always busy."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
    yield
    for process in busy:
        process.kill()
        process.wait()


@pytest.mark.slow
@every_signal
@pytest.mark.parametrize("time_round", range(3))
def test_at_any_moment_and_under_load_rows_are_those_of_the_journal(tmp_path, load, number, time_round):
    moment = random.Random(f"{number}{time_round}")
    process = begin(tmp_path, POSE_S="0")
    wait_until(lambda: finished(tmp_path) >= moment.randrange(1, 200))
    time.sleep(moment.random() * 0.02)
    # a terminal signals everybody; SIGTERM, to which workers are not deaf, goes to the command
    (os.kill if number == signal.SIGTERM else os.killpg)(process.pid, number)
    _, err = process.communicate(timeout=300)
    assert_whole(tmp_path, process, err)
