"""A lamp of another installed distribution: named in YAML, kept in the run, and one sentence when it breaks."""

import os
import subprocess
import sys

import pytest

LAMP = """\
import numpy as np
from conespot.scene.spectrum import Curve

class Lamp:
    def __init__(self, *points):
        self.spectrum = Curve(*np.array(points, float).T)

amber = Lamp((580, 0), (590, 7), (600, 0))
ultraviolet = Lamp((200, 0), (250, 1), (290, 0))
negative = Lamp((500, -1), (510, 1))

class Fickle:
    @property
    def spectrum(self):
        raise RuntimeError("no such luck")

fickle = Fickle()
none = 5
"""
READ = """\
from conespot.scene import InputError, load_scene
from conespot.scene.document import dump

try:
    scene = load_scene("s.yaml")
    print(repr(scene.illumination))
    print(scene.illumination.spectrum(590))
    open("resolved.yaml", "w").write(dump(scene))
except InputError as error:
    print(error)
"""
NAMES = ["amber", "ultraviolet", "negative", "fickle", "none"]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder on the path with a module, and the metadata that makes it an installed distribution."""
    site = tmp_path_factory.mktemp("site")
    (site / "lamps.py").write_text(LAMP)
    metadata = site / "lamps-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: lamps\nVersion: 1.0\n")
    entries = [f"{name} = lamps:{name}" for name in NAMES]
    entries += ["gone = no_such_module:x", "white = lamps:amber"]
    (metadata / "entry_points.txt").write_text("\n".join(["[conespot.illuminants]", *entries, ""]))
    return site


def read(folder, text, path=""):
    """What a fresh Python says of the scene in `text`, and the file that it writes of it."""
    (folder / "s.yaml").write_text(text)
    environment = {**os.environ, "PYTHONPATH": str(path)}
    command = [sys.executable, "-c", READ]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_scene_names_it_and_its_spectrum_is_in_the_scene(site, tmp_path):
    """A triangle of 20 nm: at its peak 1/10 per nm; the resolved scene reads the same without the package."""
    found = read(tmp_path, "illumination: amber\n", site)
    assert "name='amber', package='lamps 1.0'" in found
    assert float(found.splitlines()[1]) == pytest.approx(0.1)
    resolved = (tmp_path / "resolved.yaml").read_text()
    assert read(tmp_path, resolved) == found
    assert (tmp_path / "resolved.yaml").read_text() == resolved


def test_nobody_takes_the_name_of_a_light_of_this_package(site, tmp_path):
    assert read(tmp_path, "illumination: white\n", site).startswith("FlatBand(")


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("gone", "light 'gone' (no_such_module:x of lamps 1.0) cannot be loaded: ModuleNotFoundError"),
        ("none", "light 'none' (lamps:none of lamps 1.0) is none: TypeError: its spectrum is no conespot.scene"),
        ("fickle", "light 'fickle' (lamps:fickle of lamps 1.0) is none: RuntimeError: no such luck; mend or uninstall"),
        ("negative", "must not be negative"),
        ("ultraviolet", "wavelengths must lie in 300 to 1100 nm"),
        ("ambre", "unknown light 'ambre'; did you mean 'amber'?"),
    ],
)
def test_what_is_no_lamp_is_one_sentence_that_names_the_package(site, tmp_path, name, says):
    found = read(tmp_path, f"illumination: {name}\n", site)
    assert says in found
    assert found.startswith("s.yaml:1: illumination: ")
    assert found.count("\n") == 1
