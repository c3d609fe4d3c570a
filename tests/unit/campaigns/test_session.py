"""campaigns.session: the one way from a campaign to a run folder, whoever does the work."""

import pandas as pd
import pytest
from truth import true_record

from conespot.campaigns.ending import RunError
from conespot.campaigns.row import Record
from conespot.campaigns.session import renew_rows, run_campaign
from conespot.results import writing
from conespot.results.run import load_run
from conespot.scene import InputError

TEXT = "scene: paper\nposes: 4\nlocalizers: [paper, paper-code]\nsweep: {scene.power.value: [0.5 W, 1 W]}\n"


class AtOnce:
    """An executor without workers: it answers the truth, but for poses that it loses or at which it is interrupted."""

    def __init__(self, loses=(), interrupted_at=None):
        self.loses, self.interrupted_at = loses, interrupted_at
        self.asked = []

    def execute(self, plan, units, *, frames, note):
        for unit in units:
            self.asked.append(unit.pose)
            if unit.pose == self.interrupted_at:
                raise KeyboardInterrupt
            if unit.pose in self.loses:
                yield Record(unit=unit.key, error="lost in thought")
                continue
            yield true_record(plan, unit)


@pytest.fixture
def run(tmp_path):
    (tmp_path / "c.yaml").write_text(TEXT)

    def go(executor, **more):
        return run_campaign(tmp_path / "c.yaml", tmp_path / "run", executor=executor, **more)

    return go


@pytest.fixture
def undrawn(monkeypatch):
    """Results without figures, which take most of the time of a run that renders nothing."""
    monkeypatch.setattr(writing, "plan_figures", lambda run, boxes: ([], 0))


def rows_of(folder):
    return pd.read_csv(folder / "errors.csv", keep_default_na=False)


def test_whoever_works_a_plan_off_the_folder_holds_all_that_a_run_writes(run, capsys):
    folder = run(AtOnce())
    names = {path.name for path in folder.iterdir()}
    assert names >= {"campaign.yaml", "cases.jsonl", "errors.csv", "errors.parquet", "tables", "figures", "report.html"}
    assert len(load_run(folder).rows) == 4 * 2 * 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "4 poses, 8 frames, 16 localizations" in said.err


@pytest.mark.usefixtures("undrawn")
def test_lost_poses_are_said_when_all_else_is_written_and_are_tried_again(run, tmp_path):
    with pytest.raises(RunError, match="1 poses were lost, the first: lost in thought; the same command retries them"):
        run(AtOnce(loses=[2]))
    rows = rows_of(tmp_path / "run")
    assert set(rows.loc[rows["status"] == "failed", "pose"]) == {2}
    assert (tmp_path / "run" / "report.html").exists()
    again = AtOnce()
    assert set(rows_of(run(again))["status"]) == {"ok"}
    assert again.asked == [2]


@pytest.mark.usefixtures("undrawn")
def test_an_interruption_keeps_what_is_finished_and_the_same_call_goes_on(run, tmp_path):
    with pytest.raises(KeyboardInterrupt, match="2 of 4 poses are kept"):
        run(AtOnce(interrupted_at=2))
    assert len(rows_of(tmp_path / "run")) == 2 * 2 * 2
    again = AtOnce()
    assert len(rows_of(run(again))) == 16
    assert again.asked == [2, 3]


@pytest.mark.usefixtures("undrawn")
def test_settings_win_over_the_file_and_a_wrong_one_is_named(run):
    assert len(rows_of(run(AtOnce(), settings={"poses": "2"}))) == 8
    with pytest.raises(InputError, match=r"settings\['posse'\]: posse: unknown key 'posse'; did you mean 'poses'"):
        run(AtOnce(), settings={"posse": "2"})


@pytest.mark.usefixtures("undrawn")
def test_the_order_of_localizers_is_no_other_campaign(run, tmp_path):
    run(AtOnce(loses=[1, 2]), settings={"poses": "1"})
    (tmp_path / "c.yaml").write_text(TEXT.replace("[paper, paper-code]", "[paper-code, paper]"))
    turned = AtOnce()
    assert len(rows_of(run(turned, settings={"poses": "1"}))) == 4
    assert turned.asked == []


@pytest.mark.usefixtures("undrawn")
def test_rows_are_renewed_from_the_journal_where_it_can_be_understood_and_kept_where_not(run, tmp_path):
    """errors.csv deleted and made again; then with a localizer that is not installed, with rows and without."""
    folder = run(AtOnce())
    before = (folder / "errors.csv").read_bytes()
    (folder / "errors.csv").unlink()
    renew_rows(folder)
    assert (folder / "errors.csv").read_bytes() == before
    resolved = folder / "campaign.yaml"
    resolved.write_text(resolved.read_text().replace("[paper, paper-code]", "[paper, beacon]"))
    renew_rows(folder)
    assert (folder / "errors.csv").read_bytes() == before
    for rows in folder.glob("errors.*"):
        rows.unlink()
    with pytest.raises(InputError, match="unknown localizer 'beacon'"):
        renew_rows(folder)


@pytest.mark.usefixtures("undrawn")
def test_rows_that_follow_from_the_journal_are_not_made_again_and_others_are(run):
    folder = run(AtOnce())
    before = {path: path.read_bytes() for path in folder.glob("errors.*")}
    touched = {path: path.stat().st_mtime_ns for path in before}
    renew_rows(folder)
    assert {path: path.stat().st_mtime_ns for path in before} == touched
    for path in before:
        path.write_bytes(before[path].replace(b"ok", b"OK"))
        renew_rows(folder)
        assert path.read_bytes() == before[path]
    journal = folder / "journal.jsonl"
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:-1]))
    renew_rows(folder)
    assert (folder / "errors.csv").stat().st_size < len(before[folder / "errors.csv"])
