"""The small commands: help, list, show, validate, plan, dry runs, doctor."""

import resource
import subprocess
import sys

import pytest

from conespot.campaigns.command import main
from conespot.scene.document import shipped

CAMPAIGN = [sys.executable, "-m", "conespot"]


def campaign(*arguments, cwd):
    return subprocess.run([*CAMPAIGN, *map(str, arguments)], cwd=cwd, capture_output=True, text=True, timeout=60)


def spent():
    """Time of a core that ended children took [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def test_help_is_instant_because_it_imports_nothing_heavy(tmp_path):
    """Time of a core, the least of three [s]; and no module that takes time is loaded."""
    times = []
    for _ in range(3):
        start = spent()
        done = campaign("--help", cwd=tmp_path)
        times.append(spent() - start)
        assert done.returncode == 0
    assert min(times) < 0.5
    code = (
        "import sys, conespot.campaigns.command as command\n"
        "try: command.main(['--help'])\n"
        "except SystemExit: pass\n"
        "print(*{'numpy', 'pydantic', 'ruamel', 'cv2', 'pandas', 'mitsuba'} & set(sys.modules), file=sys.stderr)"
    )
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert loaded.stderr == "\n"


def test_list_names_every_shipped_campaign(capsys):
    assert main(["list"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == sorted(shipped("campaigns", ""))


@pytest.mark.parametrize("name", sorted(shipped("campaigns", "")))
def test_every_shipped_campaign_is_valid_and_shows_itself(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    assert main(["validate", name]) == main(["show", name]) == 0
    _, _, shown = capsys.readouterr().out.partition("\n")
    (tmp_path / "copy.yaml").write_text(shown)
    assert main(["validate", "copy.yaml"]) == 0
    assert capsys.readouterr().out.startswith("copy.yaml: valid")


def test_plan_and_dry_run_say_the_same_and_write_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ["power_sweep", "--poses", "10", "--workers", "2"]
    assert main(["plan", *options]) == 0
    plan = capsys.readouterr().out
    assert main(["run", *options, "--dry-run"]) == 0
    assert capsys.readouterr().out == plan
    assert "28 cases, 280 frames, 560 localizations" in plan
    assert "0.25 W isotropic = 0.7695 mW flux" in plan
    assert list(tmp_path.iterdir()) == []


def test_doctor_proves_that_this_machine_renders(tmp_path):
    done = campaign("doctor", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "variant " in done.stdout
    assert "agrees" in done.stdout


def test_a_closed_pipe_is_no_traceback(tmp_path):
    command = f"{sys.executable} -m conespot plan power_sweep | head -1"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, cwd=tmp_path)
    assert done.stderr == ""
    assert done.stdout.startswith("power_sweep: ")
