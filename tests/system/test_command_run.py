"""`campaign run` at low resolution with real rendering: the same rows on any number of workers, through any crash."""

import os
import signal
import subprocess
import sys
import time

import cv2
import pandas as pd
import pytest

from conespot.campaigns.command import main

CAMPAIGN = [sys.executable, "-m", "conespot"]
# many samples: a pose must take long enough to be interrupted
TEXT = """\
scene: {preset: paper-code, camera: {resolution: 300}}
trajectory: random
poses: 10
samples: 512
localizers: [paper]
sweep:
  scene.power.value: [0.25 W, 1 W]
"""


@pytest.fixture(scope="module", autouse=True)
def interruptible():
    """Processes begun here hear of Ctrl-C, even where the tests run in the background of a shell, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("campaign")
    (path / "c.yaml").write_text(TEXT)
    return path


def campaign(*arguments, cwd):
    return subprocess.run([*CAMPAIGN, *map(str, arguments)], cwd=cwd, capture_output=True, text=True, timeout=120)


@pytest.fixture(scope="module")
def straight(folder):
    """A run on one worker without interruption."""
    done = campaign("run", "c.yaml", "--workers", 1, "--out", "straight", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "straight", done


def test_a_run_writes_rows_tables_and_a_report(straight):
    run, done = straight
    rows = pd.read_parquet(run / "errors.parquet")
    assert len(rows) == 2 * 10
    assert (rows["status"] == "ok").mean() > 0.8
    assert rows["position_error_mm"].median() < 1.0  # at 300 px a pixel is 44 um
    for name in ("campaign.yaml", "journal.jsonl", "errors.csv", "boxes.csv", "report.html", "tables", "figures"):
        assert (run / name).exists()
    assert not [p for p in run.rglob("*") if p.name.endswith(".tmp")]
    assert "10 poses, 20 frames, 20 localizations" in done.stderr
    assert "20 of 20 frames (100%)" in done.stderr
    assert "straight: errors.csv, errors.parquet" in done.stdout


@pytest.mark.slow
def test_two_workers_give_the_same_bytes(folder, straight):
    done = campaign("run", "c.yaml", "--workers", 2, "--out", "two", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert (folder / "two" / "errors.csv").read_bytes() == (straight[0] / "errors.csv").read_bytes()


def begin(folder, run, finished):
    """Start a run and wait until that many poses are finished."""
    process = subprocess.Popen(
        [*CAMPAIGN, "run", "c.yaml", "--workers", "1", "--out", run.name],
        cwd=folder,
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    journal = run / "journal.jsonl"
    for _ in range(6000):
        if process.poll() is not None or (journal.exists() and journal.read_bytes().count(b"\n") >= finished):
            return process
        time.sleep(0.01)
    raise TimeoutError("nothing was finished in a minute")


@pytest.mark.slow
def test_a_metered_camera_exposes_alike_on_every_worker(tmp_path):
    """A noisy camera that sets its exposure time once a campaign: rows of one worker against those of two."""
    (tmp_path / "m.yaml").write_text(TEXT + "  scene.sensor: [cmv12000-mono]\n")
    runs = [tmp_path / "one", tmp_path / "two"]
    for workers, run in enumerate(runs, start=1):
        options = ["--poses", 4, "--samples", 16]
        done = campaign("run", "m.yaml", "--workers", workers, *options, "--out", run, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    assert (runs[0] / "errors.csv").read_bytes() == (runs[1] / "errors.csv").read_bytes()
    assert (pd.read_csv(runs[0] / "errors.csv")["status"] == "ok").any()


@pytest.mark.slow
def test_an_interrupted_and_a_killed_run_go_on_to_the_same_bytes(folder, straight):
    """Ctrl-C after one pose, kill -9 after another with a torn line behind it, then to the end."""
    run = folder / "broken"
    process = begin(folder, run, 1)
    os.killpg(process.pid, signal.SIGINT)  # a terminal sends Ctrl-C to the workers too
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "Traceback" not in err
    assert "of 10 poses are kept, and the same command continues the run" in err
    kept = pd.read_csv(run / "errors.csv")
    assert 2 <= len(kept) < 20
    assert len(pd.read_parquet(run / "errors.parquet")) == len(kept)

    finished = (run / "journal.jsonl").read_bytes().count(b"\n")
    process = begin(folder, run, finished + 1)
    process.kill()
    process.communicate(timeout=30)
    with (run / "journal.jsonl").open("ab") as journal:
        journal.write(b'{"unit":"ab')

    done = campaign("run", "c.yaml", "--workers", 2, "--out", "broken", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert "of 10 poses are finished, continuing" in done.stderr
    assert (run / "errors.csv").read_bytes() == (straight[0] / "errors.csv").read_bytes()
    assert (run / "errors.parquet").read_bytes() == (straight[0] / "errors.parquet").read_bytes()
    assert f"broken/journal.jsonl:{finished + 2}: was torn before its end" in done.stderr
    assert (run / "journal.jsonl").read_bytes().count(b"\n") == 10 + 1  # nothing is deleted, not the torn line either


@pytest.fixture
def here(folder, monkeypatch, capsys):
    """Runs a command in this process and the runs' folder: its exit code, and what it said on stdout and stderr."""
    monkeypatch.chdir(folder)
    return lambda *arguments: (main(arguments), *capsys.readouterr())


def test_a_finished_run_does_nothing_again(here, straight):
    before = (straight[0] / "journal.jsonl").stat().st_mtime_ns
    code, _, err = here("run", "c.yaml", "--out", "straight")
    assert code == 0
    assert "10 of 10 poses are finished" in err
    assert (straight[0] / "journal.jsonl").stat().st_mtime_ns == before


def test_other_settings_do_not_overwrite_a_run(here, straight):
    before = (straight[0] / "errors.csv").read_bytes()
    code, _, err = here("run", "c.yaml", "--seed", "2", "--out", "straight")
    assert code == 2
    assert err == "campaign: straight: holds the run of another campaign or other settings; choose another --out\n"
    assert (straight[0] / "errors.csv").read_bytes() == before


def test_report_makes_everything_again_from_the_journal(here, straight):
    run, first = straight
    rows = (run / "errors.csv").read_bytes()
    for name in ("errors.csv", "errors.parquet", "report.html"):
        (run / name).unlink()
    code, out, err = here("report", "straight")
    assert code == 0, err
    assert (run / "errors.csv").read_bytes() == rows
    assert (run / "report.html").exists()
    assert out == first.stdout


@pytest.mark.slow
def test_one_pose_alone_gives_the_runs_own_row_and_pictures_of_what_was_seen(straight, capsys):
    run = straight[0]
    rows = pd.read_csv(run / "errors.csv")
    case = rows["case"].unique()[1]
    assert main(["debug", str(run), case[:8], "3"]) == 0
    first, true, said, files = capsys.readouterr().out.splitlines()
    (row,) = rows[(rows["case"] == case) & (rows["pose"] == 3)].to_dict("records")
    assert f"case {case}, pose 3: random, single, {row['power_w']:g} W" in first
    assert f"{row['true_x_mm']:.4f} {row['true_y_mm']:.4f} {row['true_z_mm']:.4f} mm" in true
    assert said.endswith("; the same as the run's row")
    assert (f"{1e3 * row['position_error_mm']:.1f} um off" if row["status"] == "ok" else row["reason"]) in said
    assert files.endswith("frame.png, paper.png")
    rendered = cv2.imread(str(run / "debug" / f"{case}-3" / "frame.png"), cv2.IMREAD_UNCHANGED)
    assert rendered.shape == (300, 300)
    assert rendered.max() > 200


@pytest.mark.parametrize(
    ("case", "pose", "says"),
    [
        ("2", "10", "pose 10: the case has poses 0 to 9"),
        ("xyz", "0", "xyz: is no case; "),
        ("", "0", "is the beginning of several cases"),
    ],
)
def test_one_pose_of_no_case_is_refused(straight, capsys, case, pose, says):
    assert main(["debug", str(straight[0]), case, pose]) == 2
    assert says in capsys.readouterr().err


@pytest.mark.slow
def test_frames_are_kept_when_asked_for(folder):
    options = ["--poses", 1, "--set", "frames=true", "--set", "sweep={}", "--resolution", 100, "--out", "kept"]
    done = campaign("run", "c.yaml", "--workers", 1, *options, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert sorted(p.suffix for p in (folder / "kept" / "frames").iterdir()) == [".exr", ".png"]


def test_theory_alone_renders_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "theory"]) == 0
    assert os.listdir(tmp_path / "runs") == ["theory"]
    table = pd.read_csv(tmp_path / "runs" / "theory" / "theory.csv")
    published = [0.08, 0.23, 0.49, 0.91, 1.51, 2.34]
    assert table["in_plane_um"].tolist() == pytest.approx(published, abs=0.02)
    assert "Table I" in capsys.readouterr().out
