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


ODD = {
    "an ASCII terminal": {"PYTHONIOENCODING": "ascii"},
    "a Latin-1 terminal": {"PYTHONIOENCODING": "latin-1"},
    "no locale": {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
    "another backend": {"MPLBACKEND": "TkAgg"},
    "no backend": {"MPLBACKEND": "no-such-backend"},
    "nothing written": {"PYTHONDONTWRITEBYTECODE": "1"},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", ODD)
def test_a_run_is_done_in_odd_surroundings(folder, name):
    done = shell(RUN, folder, **ODD[name])
    assert done.returncode == 0, done.stderr
    assert (folder / "r" / "report.html").exists()


@pytest.mark.slow
@pytest.mark.parametrize("options", [("-O",), ("-OO",), ("-I",), ("-W", "error")], ids=" ".join)
def test_a_run_is_done_by_an_odd_python(folder, options):
    done = shell(RUN, folder, python=options)
    assert done.returncode == 0, done.stderr
    assert (folder / "r" / "report.html").exists()
