"""docs/ci.md: its workflow is one that a service can read, and the commands in it are this package's."""

import re
import shlex
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from conespot.campaigns.command import main
from conespot.campaigns.schema import base, read_campaign

DOCS = Path(__file__).parents[2] / "docs" / "ci.md"


def blocks():
    return [YAML(typ="safe", pure=True).load(text) for text in re.findall(r"```yaml\n(.*?)```", DOCS.read_text(), re.S)]


@pytest.fixture
def steps():
    (workflow,) = (block for block in blocks() if "jobs" in block)
    assert workflow["on"]
    (job,) = workflow["jobs"].values()
    assert job["runs-on"]
    return job["steps"]


def test_every_step_is_an_action_of_a_version_or_a_command(steps):
    for step in steps:
        assert set(step) <= {"uses", "run", "with", "if"}
        assert ("uses" in step) != ("run" in step)
        assert re.fullmatch(r"[\w-]+/[\w-]+@v\d+", step.get("uses", "a/b@v1"))


def test_its_campaign_commands_make_a_run_and_check_that_one(steps, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run, check = (shlex.split(s["run"])[1:] for s in steps if s.get("run", "").startswith(".venv/bin/campaign"))
    assert main([*run, "--dry-run"]) == 0
    folder = run[run.index("--out") + 1]
    # the arguments are read, and the only thing in the way is that nothing was run
    assert main(check) == 2
    assert f"{folder}: no such run folder" in capsys.readouterr().err
    assert "verdicts.md" in check
    assert any("verdicts.md >>" in step.get("run", "") for step in steps)


def test_the_example_of_expectations_is_one(tmp_path):
    (example,) = (block for block in blocks() if "expect" in block)
    file = tmp_path / "mine.yaml"
    text = DOCS.read_text().split("```yaml\n")[1].split("```")[0]
    file.write_text("theory: [table-1]\n" + text)
    assert len(base(read_campaign(str(file))).expect) == len(example["expect"]) == 2
