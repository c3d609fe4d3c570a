"""campaigns.store: killed at any moment, on a disk that fills or turns read-only, a run goes on to the same bytes."""

import errno
import multiprocessing
import os
import random
import resource
import signal
import subprocess
import time

import pytest
from truth import true_record

from conespot.campaigns.ending import RunError
from conespot.campaigns.journal import Journal
from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.session import carry_out
from conespot.scene import InputError

TEXT = "scene: paper\nposes: 400\nlocalizers: [paper]\n"


class AtOnce:
    """An executor without workers that answers the truth, and writes into a file which poses it was asked for.

    After `most` of them it waits to be killed.
    """

    def __init__(self, asked, most=400):
        self.asked, self.most = asked, most

    def execute(self, plan, units, *, frames, note):
        with open(self.asked, "ab", buffering=0) as asked:
            for number, unit in enumerate(units):
                if number == self.most:
                    time.sleep(3600.0)
                asked.write(f"{unit.key}\n".encode())
                yield true_record(plan, unit)


@pytest.fixture(autouse=True)
def no_results(monkeypatch):
    monkeypatch.setattr("conespot.results.write_results", lambda folder: [])  # slow, and tested elsewhere


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    path = tmp_path_factory.mktemp("campaign") / "c.yaml"
    path.write_text(TEXT)
    return read_campaign(str(path))


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory, document):
    folder = tmp_path_factory.mktemp("undisturbed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("conespot.results.write_results", lambda folder: [])
        carry_out(document, folder, AtOnce(folder.parent / "all"))
    return rows_of(folder)


@pytest.fixture
def tmpfs(tmp_path):
    """A small disk of its own."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", disk], capture_output=True, text=True)
    if mounted.returncode:
        pytest.skip(f"cannot mount a tmpfs: {mounted.stderr.strip()}")
    yield disk
    subprocess.run(["umount", disk], check=True)


def rows_of(folder):
    return (folder / "errors.csv").read_bytes(), (folder / "errors.parquet").read_bytes()


def lines_in(path):
    return path.read_bytes().count(b"\n") if path.exists() else 0


def finished(folder, plan):
    """The poses whose lines are whole on the disk."""
    journal = folder / "journal.jsonl"
    if not journal.exists():
        return set()
    with journal.open("rb") as stream:
        return set(Journal(journal, plan, stream).entries)


@pytest.mark.slow
def test_killed_at_fifty_moments_nothing_is_lost_or_run_twice(tmp_path, document, undisturbed):
    """kill -9 of the process that owns the journal, a moment after one to eight poses more, or while it waits."""
    folder, plan, moment = tmp_path / "run", make_plan(document), random.Random(1)
    fork = multiprocessing.get_context("fork")
    for kill in range(50):
        before, asked = finished(folder, plan), tmp_path / f"asked-{kill}"
        more = moment.randint(1, 7)
        process = fork.Process(target=carry_out, args=(document, folder, AtOnce(asked, more + 1)))
        process.start()
        wanted = lines_in(folder / "journal.jsonl") + more
        while lines_in(folder / "journal.jsonl") < wanted and process.is_alive():
            time.sleep(0.0005)
        time.sleep(moment.random() * 0.004)
        os.kill(process.pid, signal.SIGKILL)
        process.join()
        again = set(asked.read_text().split())
        assert not again & before
        assert before < finished(folder, plan) <= before | again
    before = finished(folder, plan)
    assert 0 < len(before) < 400
    carry_out(document, folder, AtOnce(tmp_path / "rest"))
    assert sorted((tmp_path / "rest").read_text().split()) == sorted({u.key for u in plan.units()} - before)
    assert rows_of(folder) == undisturbed


def test_a_disk_that_fills_and_one_that_is_read_only_are_a_sentence_and_the_run_goes_on(
    tmp_path, document, undisturbed, tmpfs
):
    folder = tmpfs / "run"
    (tmpfs / "ballast").write_bytes(b"x" * 100_000)
    with pytest.raises(RunError, match=r"cannot be written: No space left on device; what is finished is kept, and"):
        carry_out(document, folder, AtOnce(tmp_path / "first"))
    kept = finished(folder, make_plan(document))
    assert 0 < len(kept) < 400
    (tmpfs / "ballast").unlink()
    subprocess.run(["mount", "-o", "remount,ro", tmpfs], check=True)
    with pytest.raises(InputError, match="cannot be written: Read-only file system; choose another --out"):
        carry_out(document, folder, AtOnce(tmp_path / "none"))
    assert not (tmp_path / "none").exists()
    subprocess.run(["mount", "-o", "remount,rw,size=4m", tmpfs], check=True)
    carry_out(document, folder, AtOnce(tmp_path / "rest"))
    assert not set((tmp_path / "rest").read_text().split()) & kept
    assert rows_of(folder) == undisturbed


def test_a_line_that_only_half_fits_on_the_disk_costs_its_pose_alone(tmp_path, document, undisturbed):
    """As a quota does: a limit on the size of files, in a process of its own."""
    folder, plan = tmp_path / "run", make_plan(document)

    def limited():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
        try:
            carry_out(document, folder, AtOnce(tmp_path / "first"))
        except RunError as error:
            (tmp_path / "said").write_text(str(error))

    process = multiprocessing.get_context("fork").Process(target=limited)
    process.start()
    process.join()
    assert (tmp_path / "said").read_text().startswith(f"{folder}: cannot be written: File too large; what is finished")
    journal = folder / "journal.jsonl"
    torn = journal.read_bytes()
    assert len(torn) == 20_000
    assert not torn.endswith(b"\n")
    kept = finished(folder, plan)
    carry_out(document, folder, AtOnce(tmp_path / "rest"))
    assert sorted((tmp_path / "rest").read_text().split()) == sorted({u.key for u in plan.units()} - kept)
    assert rows_of(folder) == undisturbed
    assert journal.read_bytes().startswith(torn + b"\n")


def test_a_disk_that_turns_read_only_in_the_middle_of_a_run_is_a_sentence(tmp_path, document, undisturbed):
    write, lines = os.write, []

    def refuse(file, data):
        lines.append(data)
        if len(lines) > 10:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        return write(file, data)

    folder = tmp_path / "run"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("os.write", refuse)
        with pytest.raises(RunError, match="cannot be written: Read-only file system; what is finished is kept"):
            carry_out(document, folder, AtOnce(tmp_path / "first"))
    assert len(finished(folder, make_plan(document))) == 10
    carry_out(document, folder, AtOnce(tmp_path / "rest"))
    assert rows_of(folder) == undisturbed
