"""The command in odd places: names that shadow, paths that are no text, folders that moved or cannot be written."""

import os
import subprocess
import sys

import pandas as pd
import pytest
from truth import true_record

from conespot.campaigns import streams
from conespot.campaigns.command import main
from conespot.campaigns.session import run_campaign
from conespot.results import writing

TEXT = """\
scene: {preset: paper-code, camera: {resolution: 100}}
trajectory: helix
poses: 2
samples: 1
localizers: [paper]
"""


class AtOnce:
    """An executor without workers, which answers the truth."""

    def execute(self, plan, units, *, frames, note):
        for unit in units:
            yield true_record(plan, unit)


@pytest.fixture
def undrawn(monkeypatch):
    monkeypatch.setattr(writing, "plan_figures", lambda run, boxes: ([], 0))


@pytest.fixture
def script(tmp_path):
    """The command as it is installed: `python -m` would look into the working folder first."""
    path = tmp_path / "bin" / "campaign"
    path.parent.mkdir()
    path.write_text(
        "import sys\nfrom conespot.__main__ import main\nif __name__ == '__main__':\n    sys.exit(main())\n"
    )
    return path


@pytest.fixture
def shadowed(tmp_path):
    """A working folder whose files and folders are called as our modules, others' and Python's; to import one ends."""
    folder = tmp_path / "work"
    for name in ("conespot", "campaigns", "scene", "results", "cv2"):
        (folder / name).mkdir(parents=True)
        (folder / name / "__init__.py").write_text("import os\nos._exit(77)\n")
    for name in ("numpy", "random", "signal", "pandas", "pyarrow", "mitsuba", "distributed", "sitecustomize"):
        (folder / f"{name}.py").write_text("import os\nos._exit(77)\n")
    for name in ("power_sweep", "paper-code", "helix"):
        (folder / name).mkdir()
    (folder / "c.yaml").write_text(TEXT)
    (folder / "here.yaml").write_text("kind: local\nworkers: 1\n")
    return folder


def test_files_and_folders_of_the_working_folder_hide_no_module_preset_or_campaign(shadowed, script):
    command = [sys.executable, str(script), "plan", "power_sweep"]
    done = subprocess.run(command, cwd=shadowed, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("where", [("--workers", "1"), ("--profile", "here.yaml")], ids=["pool", "Dask"])
def test_workers_import_nothing_from_the_working_folder(shadowed, script, where):
    command = [sys.executable, str(script), "run", "c.yaml", *where, "--out", "r"]
    done = subprocess.run(command, cwd=shadowed, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert len(pd.read_csv(shadowed / "r" / "errors.csv")) == 2


@pytest.fixture
def no_text(tmp_path):
    """A folder, a campaign and a trajectory whose names are Latin-1, which is not UTF-8."""
    folder = tmp_path / os.fsdecode(b"d\xe9p\xf4t")
    try:
        folder.mkdir()
    except OSError:
        pytest.skip("names of this disk are UTF-8")
    path = folder / os.fsdecode(b"c\xe9.yaml")
    text = TEXT.replace("helix", "{kind: csv, file: t.csv}")
    path.write_text(f"name: c\nexpect: [{{metric: AE mm, at_most: 1}}]\n{text}")
    for name in (b"t.csv", b"t\xe9.csv"):
        (folder / os.fsdecode(name)).write_text("x_mm,y_mm,z_mm\n0,0,4\n0,1,4\n")
    return path


@pytest.mark.usefixtures("undrawn")
def test_a_run_in_a_folder_whose_name_is_no_text_is_made_and_read(no_text, capsys):
    streams.make_safe()  # as the command does for its own
    run = no_text.parent / os.fsdecode(b"r\xe9sultat")
    run_campaign(no_text, run, executor=AtOnce())
    assert len(pd.read_csv(run / "errors.csv")) == 2
    for name in ("status", "report", "check"):
        assert main([name, str(run)]) == 0
    (run / "errors.parquet").unlink()  # then the CSV is read
    verdicts = no_text.parent / os.fsdecode(b"v\xe9.xml")
    assert main(["check", str(run), "--junit", str(verdicts)]) == 0
    assert verdicts.exists()
    assert main(["merge", str(no_text.parent / os.fsdecode(b"\xe9")), str(run)]) == 0
    capsys.readouterr()


def test_a_file_whose_name_is_no_text_is_read_or_refused_in_a_sentence(no_text, capsys):
    streams.make_safe()
    assert main(["validate", str(no_text)]) == 0
    odd = no_text.parent / os.fsdecode(b"t\xe9.csv")
    assert main(["validate", str(no_text), "--set", f"trajectory.file={odd}"]) == 2
    assert main(["validate", str(odd.with_suffix(".yaml"))]) == 2
    said = capsys.readouterr().err.splitlines()
    assert [line.split(":")[0] for line in said] == ["campaign", "campaign"]
    assert "Error" not in said[0] + said[1]


@pytest.mark.slow
def test_frames_are_kept_in_a_folder_whose_name_is_no_text(no_text):
    command = [sys.executable, "-m", "conespot", "run", no_text.name, "--set", "frames=true", "--workers", "1"]
    done = subprocess.run([*command, "--out", b"r\xe9"], cwd=no_text.parent, capture_output=True, timeout=300)
    assert done.returncode == 0, done.stderr
    frames = no_text.parent / os.fsdecode(b"r\xe9") / "frames"
    assert sorted(path.suffix for path in frames.iterdir()) == [".exr", ".exr", ".png", ".png"]


@pytest.mark.usefixtures("undrawn")
def test_a_run_whose_swept_scenes_and_trajectory_are_gone_is_reported_wherever_it_lies(tmp_path, capsys):
    (tmp_path / "here").mkdir()
    for name in ("near", "far"):
        (tmp_path / "here" / f"{name}.yaml").write_text(f"eye: {{radius: 12.{len(name)} mm}}\n")
    (tmp_path / "here" / "t.csv").write_text("x_mm,y_mm,z_mm\n0,0,4\n0,1,4\n")
    (tmp_path / "here" / "c.yaml").write_text(
        "poses: 2\nlocalizers: [paper]\nexpect: [{metric: failed share, at_most: 0, where: {scene: any}}]\n"
        "trajectory: {kind: csv, file: t.csv}\nsweep: {scene: [near.yaml, far.yaml]}\n"
    )
    run_campaign(tmp_path / "here" / "c.yaml", tmp_path / "here" / "run", executor=AtOnce())
    rows = (tmp_path / "here" / "run" / "errors.csv").read_bytes()
    (tmp_path / "elsewhere").mkdir()
    moved = (tmp_path / "here" / "run").rename(tmp_path / "elsewhere" / "moved")
    for path in (tmp_path / "here").iterdir():
        path.unlink()
    (moved / "report.html").unlink()
    assert main(["report", str(moved)]) == main(["status", str(moved)]) == 0
    assert (moved / "errors.csv").read_bytes() == rows
    assert len(rows.splitlines()) == 1 + 2 * 2
    assert (moved / "report.html").exists()
    assert "campaign:" not in capsys.readouterr().err
    for name in ("errors.csv", "errors.parquet"):
        (moved / name).unlink()  # the journal alone does not say where the tips were
    assert main(["report", str(moved)]) == 2
    assert "t.csv: cannot be read as CSV: No such file or directory" in capsys.readouterr().err


@pytest.fixture
def powerless():
    """The beginning of a command that may write only where its user may; root's right to write anywhere is taken."""
    if os.geteuid() != 0:
        return []
    taken = ["setpriv", "--bounding-set=-dac_override,-dac_read_search", "--"]
    try:
        subprocess.run([*taken, "true"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("root may write anywhere")
    return taken


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (["run", "c.yaml", "--out", "closed"], 2, "closed: cannot be written: Permission denied; choose another --out"),
        pytest.param(["report", "closed"], 2, "cannot be written: Permission denied", marks=pytest.mark.slow),
        pytest.param(["status", "closed"], 0, "", marks=pytest.mark.slow),
        pytest.param(["check", "closed"], 0, "", marks=pytest.mark.slow),
        pytest.param(["check", "closed", "--junit", "closed/v"], 2, "closed/v: cannot be", marks=pytest.mark.slow),
        pytest.param(["debug", "closed", "1", "0"], 2, "cannot be made: Permission denied", marks=pytest.mark.slow),
        pytest.param(["merge", "closed/m", "closed"], 2, "closed/m: cannot be written", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_a_run_folder_that_may_only_be_read_is_read_and_else_refused(tmp_path, powerless, arguments, code, says):
    (tmp_path / "c.yaml").write_text(f"{TEXT}expect: [{{metric: AE mm, at_most: 1}}]\n")
    closed = run_campaign(tmp_path / "c.yaml", tmp_path / "closed", executor=AtOnce())
    places = [closed, *(path for path in closed.rglob("*"))]
    try:
        for path in places:
            path.chmod(0o500 if path.is_dir() else 0o400)
        command = [*powerless, sys.executable, "-m", "conespot", *arguments]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    finally:
        for path in places:
            path.chmod(0o700)
    assert done.returncode == code, done.stderr
    assert says in done.stderr
    assert done.stderr.count("\n") == (1 if says else 0)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("make", [os.mkfifo, lambda path: path.symlink_to("/dev/zero")], ids=["pipe", "device"])
def test_what_is_no_file_in_a_run_folder_is_not_read_for_ever(tmp_path, capsys, make):
    (tmp_path / "c.yaml").write_text(TEXT)
    run = run_campaign(tmp_path / "c.yaml", tmp_path / "run", executor=AtOnce())
    (run / "progress.json").unlink()
    make(run / "progress.json")
    assert main(["status", str(run)]) == 0
    (run / "journal.jsonl").unlink()
    make(run / "journal.jsonl")
    for arguments in (["status", str(run)], ["report", str(run)], ["run", str(tmp_path / "c.yaml"), "--out", str(run)]):
        assert main(arguments) == 2
        assert "Is a pipe or a device" in capsys.readouterr().err
