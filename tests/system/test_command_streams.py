"""The command where streams are closed, broken, full or of another encoding, and Python or its surroundings are odd."""

import os
import subprocess
import sys

import pandas as pd
import pytest

CAMPAIGN = [sys.executable, "-m", "conespot"]
TEXT = """\
scene: {preset: paper-code, camera: {resolution: 100}}
trajectory: helix
poses: 1
samples: 1
localizers: [paper]
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "c.yaml").write_text(TEXT)
    return tmp_path


def shell(line, cwd, python=(), **environment):
    """Run a line of bash in which $C is the command."""
    command = " ".join([sys.executable, *python, "-m", "conespot"])
    return subprocess.run(
        ["bash", "-c", line],
        cwd=cwd,
        env={**os.environ, "C": command, **environment},
        capture_output=True,
        text=True,
        timeout=300,
    )


RUN = "$C run c.yaml --workers 1 --out r"
STREAMS = {
    "stdin, stdout and stderr closed": f"{RUN} <&- >&- 2>&-",
    "stderr's reader gone": f"{RUN} 2> >(exec true)",
    "stdout's reader gone": f"set -o pipefail; {RUN} | true",
    "both on a full disk": f"{RUN} >/dev/full 2>/dev/full",
}


@pytest.mark.parametrize(
    "line",
    [
        pytest.param(line, id=name, marks=pytest.mark.slow if i else ())
        for i, (name, line) in enumerate(STREAMS.items())
    ],
)
def test_a_run_is_done_whoever_listens(folder, line):
    done = shell(line, folder)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
    assert len(pd.read_csv(folder / "r" / "errors.csv")) == 1
    # nothing that was said went into a file that took a closed stream's number
    assert (folder / "r" / "journal.jsonl").read_text().count("\n") == 1
    assert (folder / "r" / "report.html").exists()


def test_what_was_asked_for_and_cannot_be_said_is_a_failure_in_one_sentence(folder):
    done = shell("$C validate c.yaml >/dev/full", folder)
    assert done.returncode == 1
    assert done.stderr == "campaign: stdout cannot be written: No space left on device\n"


#: options of Python, and surroundings
ODD = {
    "a Latin-1 terminal and a backend of a desktop": ((), {"PYTHONIOENCODING": "latin-1", "MPLBACKEND": "TkAgg"}),
    "an ASCII terminal, isolated": (("-I",), {"PYTHONIOENCODING": "ascii", "PYTHONDONTWRITEBYTECODE": "1"}),
    "no locale, and no backend of that name": (
        (),
        {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0", "MPLBACKEND": "no-such-backend"},
    ),
    "without assertions and docstrings, warnings are errors": (("-OO", "-W", "error"), {}),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ODD)
def test_a_run_is_done_in_odd_surroundings(folder, name):
    options, environment = ODD[name]
    done = shell(RUN, folder, python=options, **environment)
    assert done.returncode == 0, done.stderr
    assert (folder / "r" / "report.html").exists()
