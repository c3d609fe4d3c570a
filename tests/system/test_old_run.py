"""A run folder of version 0.1.0, some rows of `reproduce_ci`: it is reported as it is, and not continued."""

import shutil
from pathlib import Path

import pytest

from conespot.campaigns.command import main

OLD = Path(__file__).parents[1] / "data" / "run_0.1.0"


@pytest.fixture
def run(tmp_path):
    return Path(shutil.copytree(OLD, tmp_path / "old"))


def test_it_can_still_be_reported_and_its_rows_are_used_as_they_are(run, capsys):
    assert main(["report", str(run)]) == 0
    assert "Table IV" in capsys.readouterr().out
    assert (run / "report.html").exists()
    for name in ("errors.csv", "journal.jsonl", "campaign.yaml"):
        assert (run / name).read_bytes() == (OLD / name).read_bytes()
    assert not (run / "cases.jsonl").exists()


def test_it_is_not_continued(run, capsys):
    assert main(["run", "power_sweep", "--poses", "1", "--out", str(run)]) == 2
    assert capsys.readouterr().err == (
        f"campaign: {run}: was begun by conespot 0.1.0, which named cases otherwise, and cannot go on; "
        f"choose another --out (`campaign report {run}` still makes its tables)\n"
    )
    assert sorted(path.name for path in run.iterdir()) == sorted(path.name for path in OLD.iterdir())
