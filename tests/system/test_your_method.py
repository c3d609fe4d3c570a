"""docs/your-method.md as a stranger follows it: frames out, a script that knows nothing of us, a CSV in."""

import json
import subprocess
import sys
import zlib
from pathlib import Path

import cv2
import pandas as pd
import pytest

from conespot import load_scene, locate

PAGE = (Path(__file__).parents[2] / "docs" / "your-method.md").read_text("utf-8")
SCRIPT = PAGE.partition("```python\n")[2].partition("```")[0]
CAMPAIGN = """\
scene: {preset: paper-code, camera: {resolution: 300}}
trajectory: helix
poses: 3
localizers: [paper-code-float]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("stranger")
    (path / "c.yaml").write_text(CAMPAIGN)
    (path / "mine.py").write_text(SCRIPT)
    for line in ("run c.yaml --workers 1 --out run", "export run --frames frames --workers 1"):
        campaign(path, *line.split())
    return path


def campaign(folder, *arguments, code=0):
    command = [sys.executable, "-m", "conespot", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
    assert done.returncode == code, done.stderr
    return done


@pytest.mark.slow
def test_exported_frames_are_the_very_ones_that_the_run_localized(folder):
    rows = pd.read_csv(folder / "run" / "errors.csv").set_index("pose")
    for line in pd.read_csv(folder / "frames" / "index.csv").itertuples():
        image = cv2.imread(str(folder / "frames" / line.image), cv2.IMREAD_UNCHANGED)
        found = locate(image, load_scene(folder / "frames" / line.scene), "paper-code-float")
        assert found.apex_mm.tolist() == rows.loc[line.pose, ["est_x_mm", "est_y_mm", "est_z_mm"]].tolist()


@pytest.mark.slow
def test_a_stranger_who_follows_the_page_stands_in_the_tables(folder):
    assert "conespot" not in SCRIPT
    done = subprocess.run(
        [sys.executable, "-P", "mine.py", "frames"], cwd=folder, capture_output=True, text=True, check=True
    )
    (folder / "estimates.csv").write_text(done.stdout)
    assert "3 of 3 frames localized" in campaign(folder, "score", "run", "estimates.csv", "--name", "mine").stdout
    rows = pd.read_csv(folder / "run" / "errors.csv")
    assert rows[rows["localizer"] == "mine"]["position_error_mm"].max() < 0.5
    assert "mine" in (folder / "run" / "report.html").read_text()


@pytest.mark.slow
def test_frames_that_the_run_did_not_see_are_not_exported(folder):
    """A journal whose answer is another one stands for a machine that renders otherwise."""
    journal = folder / "run" / "journal.jsonl"
    kept = journal.read_text()
    lines = []
    for line in kept.splitlines():
        record = json.loads(line)
        del record["crc"]
        record["findings"][0]["apex"][0] += 1e-4
        body = json.dumps(record, separators=(",", ":"))[1:]
        lines.append(f'{{"crc":"{zlib.crc32(body.encode()):08x}",{body}')
    try:
        journal.write_text("\n".join(lines) + "\n")
        said = campaign(folder, "export", "run", "--frames", "others", "--workers", "1", code=1).stderr
    finally:
        journal.write_text(kept)
    assert "3 of 3 poses are not rendered as the run saw them" in said
    assert not list((folder / "others" / "images").iterdir())
