"""campaigns.steering: a run is looked at and steered from beside it, while it goes and after."""

import json

import pandas as pd
import pytest
from truth import true_record

from conespot.campaigns.command import main
from conespot.campaigns.ending import RunError
from conespot.campaigns.log import Log
from conespot.campaigns.row import Record
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.session import carry_out, report, run_campaign
from conespot.campaigns.steering import retry, status
from conespot.scene import InputError

TEXT = "scene: paper\nposes: 4\nlocalizers: [paper, paper-code]\nsweep: {scene.power.value: [0.5 W, 1 W]}\n"


class AtOnce:
    """An executor without workers: it finds nothing in pose 0, loses some, and does `between` before pose 2."""

    def __init__(self, loses=(), between=lambda: None, by=""):
        self.loses, self.between, self.by = loses, between, by
        self.asked = []

    def execute(self, plan, units, *, frames, note):
        for unit in units:
            self.asked.append(unit.pose)
            if unit.pose == 2:
                self.between()
            if unit.pose in self.loses:
                yield Record(unit=unit.key, by=self.by, error=f"lost pose {unit.pose}")
                continue
            record = true_record(plan, unit, by=self.by)
            if unit.pose == 0:
                nothing = [
                    f.model_copy(update={"apex": None, "axis": None, "reason": "no spotlight found"})
                    for f in record.findings
                ]
                record = record.model_copy(update={"findings": tuple(nothing)})
            yield record


@pytest.fixture
def run(tmp_path, monkeypatch):
    monkeypatch.setattr("conespot.results.write_results", lambda folder: [])  # slow, and tested elsewhere
    (tmp_path / "c.yaml").write_text(TEXT)

    def go(executor, **more):
        return run_campaign(tmp_path / "c.yaml", tmp_path / "run", executor=executor, **more)

    return go


def test_status_says_what_is_done_and_what_failed_for_which_reason(run, tmp_path):
    folder = tmp_path / "run"
    with pytest.raises(RunError):
        run(AtOnce(loses=[1, 3]))
    assert status(folder).splitlines() == [
        f"{folder}: 4 of 4 poses (100%), done",
        f"lost: 2 poses; `campaign retry {folder} --failed` runs them again",
        "       1  lost pose 1",
        "       1  lost pose 3",
        "not localized: 4 of 8 answers",
        "       4  no spotlight found",
    ]


def test_status_and_report_of_a_run_that_goes_disturb_nothing(run, tmp_path):
    folder, seen = tmp_path / "run", []

    def look():
        seen.append(status(folder).splitlines()[0])
        report(folder)
        seen.append(len(pd.read_parquet(folder / "errors.parquet")))

    run(AtOnce(between=look))
    # the count beside the journal is from before the first pose, a moment ago
    assert seen == [f"{folder}: 0 of 4 poses (0%), running", 2 * 2 * 2]
    assert len(pd.read_parquet(folder / "errors.parquet")) == 16


@pytest.mark.parametrize("count", [None, b"", b"{}", b'{"poses": 1e999}', b'{"poses": -1}', b"[" * 10_000])
def test_the_journal_is_counted_where_the_count_is_missing_or_damaged(run, tmp_path, count):
    folder = run(AtOnce())
    before = status(folder)
    (folder / "progress.json").unlink()
    if count is not None:
        (folder / "progress.json").write_bytes(count)
    assert status(folder) == before


def test_a_stale_count_is_not_believed(run, tmp_path):
    folder = tmp_path / "run"
    early = []
    run(AtOnce(between=lambda: early.append((folder / "progress.json").read_bytes())))
    before = status(folder)
    (folder / "progress.json").write_bytes(early[0])
    assert status(folder) == before
    assert "4 of 4 poses (100%), done" in before


def test_status_of_what_is_no_run_is_a_sentence(tmp_path, capsys):
    assert main(["status", str(tmp_path)]) == 2
    assert capsys.readouterr().err.startswith(f"campaign: {tmp_path}: is no run folder")


def test_retry_runs_lost_poses_again_and_nothing_else(run, tmp_path):
    folder = tmp_path / "run"
    with pytest.raises(RunError):
        run(AtOnce(loses=[1, 3]))
    lines = (folder / "journal.jsonl").read_bytes()
    again = AtOnce(loses=[3])
    session = retry(folder, None, again, None)
    assert again.asked == [1, 3]
    assert session.lost == ("lost pose 3",)
    assert (folder / "journal.jsonl").read_bytes().startswith(lines)
    rows = pd.read_parquet(folder / "errors.parquet")
    assert set(rows.loc[rows["status"] == "failed", "pose"]) == {0, 3}


def test_retry_by_reason_runs_poses_again_that_failed_so(run):
    folder = run(AtOnce())
    again = AtOnce()
    retry(folder, "no spotlight", again, None)
    assert again.asked == [0]


def test_retry_of_what_is_no_run_makes_none(tmp_path):
    with pytest.raises(InputError, match="is no run folder"):
        retry(tmp_path / "none", None, AtOnce(), None)
    assert not (tmp_path / "none").exists()


def test_another_variant_is_said_once_when_its_first_pose_comes_in(run, tmp_path, capsys):
    with pytest.raises(KeyboardInterrupt):
        run(AtOnce(between=interrupt, by="variant scalar_spectral, conespot 1"))
    assert "rows of both" not in capsys.readouterr().err
    run(AtOnce(by="variant llvm_ad_spectral, conespot 1"))
    said = capsys.readouterr().err
    assert said.count("rows of both are mixed from here on") == 2  # conespot before the first pose, the variant with it
    assert "made with variant scalar_spectral, new ones with variant llvm_ad_spectral;" in said


def interrupt():
    raise KeyboardInterrupt


def test_the_log_has_a_line_for_what_became_of_every_pose(run, tmp_path):
    log = tmp_path / "log.jsonl"
    carry_out(read_campaign(str(tmp_path / "c.yaml")), tmp_path / "run", AtOnce(loses=[3]), log=Log(log))
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert all({"time", "level", "event"} <= set(line) for line in lines)
    poses = [(line["event"], line["pose"], line["level"]) for line in lines if "pose" in line]
    assert [p for p in poses if p[0] == "finished"] == [("finished", i, "info") for i in range(3)]
    assert [p for p in poses if p[0] == "not localized"] == [("not localized", 0, "warning")] * 4
    assert [p for p in poses if p[0] == "lost"] == [("lost", 3, "error")] * 2
    assert {line["reason"] for line in lines if line["event"] == "lost"} == {"lost pose 3"}
    assert all(len(line["case"]) == 16 for line in lines if "pose" in line)


def test_a_log_that_can_no_longer_be_written_is_said_once_and_the_run_goes_on(run, tmp_path, capsys):
    log = Log("/dev/full")
    session = carry_out(read_campaign(str(tmp_path / "c.yaml")), tmp_path / "run", AtOnce(), log=log)
    assert session.lost == ()
    said = capsys.readouterr().err
    assert said.count("--log /dev/full: cannot be written: No space left on device; the run goes on without it") == 1


def test_a_log_that_cannot_be_opened_is_refused_before_the_run(tmp_path):
    with pytest.raises(InputError, match="cannot be written: Is a directory"):
        Log(tmp_path)


def test_help_shows_how_to_retry(capsys):
    with pytest.raises(SystemExit):
        main(["retry", "--help"])
    assert "campaign retry runs/power_sweep --failed" in " ".join(capsys.readouterr().out.split())
