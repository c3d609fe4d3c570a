"""The command line refuses bad input: one sentence that says what and where, exit code 2, nothing half-written."""

import os
import subprocess
import sys

import pytest

from conespot.campaigns.command import main

GOOD = "scene: {preset: paper-code, camera: {resolution: 200}}\nposes: 2\n"


@pytest.fixture
def campaign(tmp_path, monkeypatch, capsys):
    """Runs a command in this process, which starts sooner: its exit code, and what it said on stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        try:
            code = main(arguments)
        except SystemExit as ending:  # argparse's
            code = ending.code
        return code, *capsys.readouterr()

    return run


@pytest.mark.parametrize(
    ("text", "options", "says"),
    [
        ("", [], "c.yaml: is empty; `campaign show power_sweep` prints an example"),
        ("# only a comment\n", [], "c.yaml: is empty"),
        ("- a list\n", [], "c.yaml:1: must hold `key: value` lines, not list"),
        ("scene: [1\n", [], "c.yaml:2: not valid YAML"),
        (GOOD + "poses: 3\n", [], "c.yaml:3: 'poses' stands twice"),
        (GOOD.replace("2\n", "many\n"), [], "c.yaml:2: poses: input should be a valid integer, got 'many'"),
        (GOOD + "trajctory: box\n", [], "c.yaml:3: trajctory: unknown key 'trajctory'; did you mean 'trajectory'?"),
        (GOOD + "trajectory: boxx\n", [], "c.yaml:3: trajectory: unknown trajectory 'boxx'; did you mean 'box'?"),
        (GOOD.replace("}}", "}, power: {value: -1 W}}"), [], "c.yaml:1: scene.power.value: input should be greater"),
        (GOOD, ["--set", "scene.power.value=-1 W"], "--set scene.power.value: scene.power.value: input should be"),
        (GOOD, ["--resolution", "0"], "--resolution: scene.camera.resolution: input should be greater than or equal"),
        (GOOD, ["--resolution", "1000000"], "--resolution: scene.camera.resolution: input should be less than"),
        (GOOD, ["--set", "scene.beam.half_angle=0 deg"], "half_angle: input should be greater than 0 deg, got '0 deg'"),
        (GOOD, ["--set", "scene.beam.half_angle=90 deg"], "half_angle: input should be less than 90 deg, got '90 deg'"),
        (
            GOOD + "trajectory: {kind: line, start: [0 mm, 0 mm, 30 mm]}\n",
            [],
            "c.yaml:3: pose 0 of the line: the tip at (0, 0, 30) mm is outside the eye (radius 12.5 mm)",
        ),
        (GOOD, ["--poses", "0"], "--poses: poses: input should be greater than or equal to 1, got 0"),
        (GOOD, ["--localizers", "paper,guess"], "--localizers: localizers.1: unknown localizer 'guess'"),
        (GOOD, ["--set", "poses"], "--set poses: write KEY=VALUE, such as --set poses=10"),
        (GOOD, ["--workers", "0"], "argument --workers: must be a whole number from 1 to 1024"),
        (GOOD, ["--out", "c.yaml"], "c.yaml: is a file, not a run folder; choose another --out"),
        (GOOD, ["--out", "c.yaml/run"], "c.yaml/run: cannot be written: Not a directory; choose another --out"),
        (GOOD, ["--out", "/proc/run"], "/proc/run: cannot be written: "),
    ],
)  # fmt: skip
def test_bad_input_is_refused_in_one_sentence(campaign, tmp_path, text, options, says):
    (tmp_path / "c.yaml").write_text(text)
    code, out, err = campaign("run", "c.yaml", *options)
    assert code == 2
    assert says in err
    assert err.splitlines()[-1].startswith("campaign")
    assert len(err.splitlines()) == 1 or "usage:" in err
    assert out == ""
    assert os.listdir(tmp_path) == ["c.yaml"]


def test_a_missing_file_is_refused(tmp_path):
    """By the command as it is called."""
    command = [sys.executable, "-m", "conespot", "run", "absent.yaml"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert done.stderr.startswith("campaign: absent.yaml: no such campaign, neither a file nor shipped; ")
    assert os.listdir(tmp_path) == []


def test_a_misspelt_shipped_campaign_is_refused_with_the_right_one(campaign):
    code, _, err = campaign("plan", "powr_sweep")
    assert code == 2
    assert "did you mean 'power_sweep'?" in err


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_permission_is_refused(campaign, tmp_path):
    (tmp_path / "c.yaml").write_text(GOOD)
    (tmp_path / "closed").mkdir(mode=0o500)
    code, _, err = campaign("run", "c.yaml", "--out", "closed/run")
    assert code == 2
    assert "closed/run: cannot be written: Permission denied" in err


@pytest.mark.parametrize("arguments", [[], ["fly"], ["run"], ["run", "power_sweep", "--fast"]])
def test_a_wrong_command_line_is_exit_code_2(campaign, arguments):
    code, _, err = campaign(*arguments)
    assert code == 2
    assert "usage: campaign" in err
