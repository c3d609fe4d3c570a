"""What is installed: one package, in environments of their own."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]
WHEEL = ("-m", "pip", "wheel", "-q", "--no-deps", "--no-build-isolation", "-w")
NEIGHBOUR = {
    "scene.py": "WHOSE = 'the neighbour'\n",
    "render/__init__.py": "WHOSE = 'the neighbour'\n",
    "results.py": "WHOSE = 'the neighbour'\n",
}
BOTH_WORK = """
import scene, render, results
assert {scene.WHOSE, render.WHOSE, results.WHOSE} == {"the neighbour"}
import conespot.scene, conespot.render, conespot.results
from conespot import load_scene
assert load_scene("paper-code").eye.radius == 12.5
print(conespot.__file__)
"""


def run(*command, cwd):
    done = subprocess.run(
        list(map(str, command)),
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    assert done.returncode == 0, f"{command}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
    return done.stdout


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    """The project as git has it, or as it stands where there is no git."""
    copy = tmp_path_factory.mktemp("sources") / "conespot"
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=PROJECT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a git checkout")
    for name in listed.stdout.split("\0"):
        if name and (PROJECT / name).exists():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(PROJECT / name, copy / name, follow_symlinks=False)
    return copy


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """The Python of a fresh environment that has what conespot depends on, but not conespot, and can build."""
    folder = tmp_path_factory.mktemp("environment")
    run(sys.executable, "-m", "venv", folder, cwd=folder)
    python = folder / "bin" / "python"
    run(python, "-m", "pip", "install", "-q", "setuptools>=77", cwd=folder)
    packages = Path(run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))", cwd=folder).strip())
    # behind the environment's own; a folder added this way has its own .pth files ignored, so no editable conespot
    beyond = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "dependencies.pth").write_text("\n".join(beyond))
    return python


@pytest.fixture(scope="module")
def wheel(sources, environment, tmp_path_factory):
    out = tmp_path_factory.mktemp("wheel")
    run(environment, *WHEEL, out, sources, cwd=out)
    (found,) = out.glob("*.whl")
    return found


def contents(wheel):
    with zipfile.ZipFile(wheel) as archive:
        return {name for name in archive.namelist() if ".dist-info/" not in name}


@pytest.mark.slow
def test_a_wheel_holds_conespot_alone_and_all_of_it(wheel, sources):
    names = contents(wheel)
    assert {name.split("/")[0] for name in names} == {"conespot"}
    rooms = ("scene", "render", "localize", "campaigns", "results")
    expected = {f"conespot/{path.relative_to(sources)}" for room in rooms for path in (sources / room).rglob("*.*")}
    assert names == expected | {f"conespot/{name}" for name in ("__init__.py", "__main__.py", "py.typed")}


@pytest.mark.slow
def test_a_source_distribution_builds_the_same_wheel(sources, environment, wheel, tmp_path):
    build = "import setuptools.build_meta as b, sys; b.build_sdist(sys.argv[1])"
    run(environment, "-c", build, tmp_path, cwd=sources)
    (archive,) = tmp_path.glob("*.tar.gz")
    run(
        environment,
        "-m",
        "pip",
        "wheel",
        "-q",
        "--no-deps",
        "--no-build-isolation",
        "-w",
        tmp_path,
        archive,
        cwd=tmp_path,
    )
    (again,) = tmp_path.glob("*.whl")
    assert contents(again) == contents(wheel)


@pytest.mark.slow
def test_conespot_works_beside_a_package_with_modules_of_its_rooms_names(wheel, environment, tmp_path):
    neighbour = tmp_path / "neighbour"
    for name, text in NEIGHBOUR.items():
        (neighbour / name).parent.mkdir(parents=True, exist_ok=True)
        (neighbour / name).write_text(text)
    (neighbour / "pyproject.toml").write_text(
        '[build-system]\nrequires = ["setuptools"]\nbuild-backend = "setuptools.build_meta"\n'
        '[project]\nname = "neighbour"\nversion = "1"\n'
        '[tool.setuptools]\npy-modules = ["scene", "results"]\npackages = ["render"]\n'
    )
    install = (environment, "-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation")
    run(*install, wheel, cwd=tmp_path)
    run(*install, neighbour, cwd=tmp_path)
    where = run(environment, "-c", BOTH_WORK, cwd=tmp_path).strip()
    assert Path(where).is_relative_to(environment.parents[1])
    assert "reproduce_ci" in run(environment.with_name("campaign"), "list", cwd=tmp_path)
    assert "reproduce_ci" in run(environment, "-m", "conespot", "list", cwd=tmp_path)
    assert os.fspath(tmp_path) not in where
