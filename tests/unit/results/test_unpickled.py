"""Nothing that is read from a disk is unpickled, or run otherwise."""

import ast
import pickle
from pathlib import Path

import numpy as np
import pytest

import conespot
from conespot.campaigns.command import main
from conespot.campaigns.profile import read_profile
from conespot.render.frame_file import read_frame
from conespot.render.kept import SWITCH, kept
from conespot.scene import InputError, load_scene

HOUSE = Path(conespot.__file__).parent
#: what Dask's wire carries, which is loopback, TLS or a network that the user calls trusted
ON_THE_WIRE = {"campaigns/dask_cluster.py": {"dumps"}, "campaigns/dask_worker.py": {"loads"}}
#: modules that run what they read
UNSAFE = {"pickle", "_pickle", "cloudpickle", "dill", "joblib", "shelve", "marshal", "copyreg", "runpy", "code"}
#: functions that do, whatever they are called on
CALLS = {"eval", "exec", "compile", "read_pickle", "to_pickle", "read_hdf", "unsafe_load", "full_load", "__reduce__"}


def found(tree: ast.AST) -> tuple[set[str], set[str]]:
    """The modules that a file imports, and the unsafe functions it calls: of `pickle` all, of others those of CALLS."""
    modules, calls = set(), set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            modules.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.Call):
            match node.func:
                case ast.Name(id=name) if name in CALLS:
                    calls.add(name)
                case ast.Attribute(value=ast.Name(id="pickle"), attr=name):
                    calls.add(name)
                case ast.Attribute(value=ast.Name(id="np"), attr="load"):
                    calls.add("np.load")
            if any(word.arg == "allow_pickle" for word in node.keywords):
                calls.add("allow_pickle")
    return modules, calls


def test_nothing_unpickles_but_dasks_wire():
    sources = sorted(path for room in HOUSE.iterdir() if room.is_dir() for path in room.rglob("*.py"))
    assert len(sources) > 150
    for path in sources:
        modules, calls = found(ast.parse(path.read_text("utf-8")))
        allowed = ON_THE_WIRE.get(path.relative_to(HOUSE).as_posix(), set())
        assert modules & UNSAFE == ({"pickle"} if allowed else set()), path
        assert calls == allowed, path


def test_the_walk_finds_what_unpickles():
    text = "import pickle\nfrom joblib import load\npickle.load(f)\nnp.load(f, allow_pickle=True)\neval(f.read())\n"
    assert found(ast.parse(text)) == ({"pickle", "joblib"}, {"load", "np.load", "allow_pickle", "eval"})


class Trap:
    """What makes a file when it is unpickled."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return Path.touch, (self.path,)


@pytest.fixture(params=[0, 2, pickle.HIGHEST_PROTOCOL])
def trap(request, tmp_path):
    """A pickled trap, of protocols old and new; the first is text."""
    packed = pickle.dumps(Trap(tmp_path / "sprung"), protocol=request.param)
    pickle.loads(packed)
    (tmp_path / "sprung").unlink()
    yield packed
    assert not (tmp_path / "sprung").exists()


def test_a_pickle_that_is_called_like_a_file_of_ours_is_refused(trap, tmp_path, capsys):
    for name in ("x.yaml", "x.csv", "x.exr"):
        (tmp_path / name).write_bytes(trap)
    (tmp_path / "c.yaml").write_text(f"scene: paper\ntrajectory: {{kind: csv, file: {tmp_path / 'x.csv'}}}\n")
    for path in ("x.yaml", "c.yaml"):
        assert main(["validate", str(tmp_path / path)]) == 2
    for read in (load_scene, read_profile, read_frame):
        with pytest.raises(InputError):
            read(tmp_path / ("x.exr" if read is read_frame else "x.yaml"))
    capsys.readouterr()


@pytest.mark.parametrize("name", ["campaign.yaml", "cases.jsonl", "errors.parquet", "errors.csv", "theory.csv"])
def test_a_pickle_in_the_place_of_a_runs_file_is_refused(trap, tmp_path, make_run, make_rows, capsys, name):
    rows = make_rows(poses=2, powers=(1.0,), trajectories=("box",))
    run = make_run(tmp_path / "run", rows, kind="csv" if name == "errors.csv" else "parquet")
    (run / name).write_bytes(trap)
    assert main(["report", str(run)]) == 2
    assert capsys.readouterr().err.startswith("campaign: ")


def test_a_pickle_in_the_place_of_a_journal_is_no_pose(trap, tmp_path, capsys):
    run = tmp_path / "run"
    run.mkdir()
    (run / "campaign.yaml").write_text("scene: paper\nposes: 1\nlocalizers: [paper]\n")
    for name in ("journal.jsonl", "progress.json"):
        (run / name).write_bytes(trap)
    assert main(["status", str(run)]) == 0
    assert "0 of 1 poses" in capsys.readouterr().out


def test_a_pickle_in_the_place_of_a_kept_background_is_rendered_anew(trap, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv(SWITCH)
    (tmp_path / "conespot").mkdir()
    size = 4 * 6 * 5
    (tmp_path / "conespot" / "trapped.background").write_bytes(trap.ljust(64 + size, b"."))
    image = np.ones((6, 5, 1), np.float32)
    np.testing.assert_array_equal(kept("trapped", image.shape, lambda: image), image)
