"""A lamp of another installed distribution: named in YAML, kept in the run, and one sentence when it breaks."""

import json
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
#: what a fresh Python says of every scene in its folder: its light, that at 590 nm, and its file; or a sentence
READ = """\
import json, pathlib
from conespot.scene import InputError, load_scene
from conespot.scene.document import dump

said = {}
for path in pathlib.Path().glob("*.yaml"):
    try:
        scene = load_scene(path.name)
        said[path.stem] = [repr(scene.illumination), float(scene.illumination.spectrum(590)), dump(scene)]
    except InputError as error:
        said[path.stem] = str(error)
print(json.dumps(said))
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


def read(folder, texts, path=""):
    for name, text in texts.items():
        (folder / f"{name}.yaml").write_text(text)
    environment = {**os.environ, "PYTHONPATH": str(path)}
    command = [sys.executable, "-c", READ]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


#: names of no lamp, with what is said of them
NO_LAMP = {
    "gone": "light 'gone' (no_such_module:x of lamps 1.0) cannot be loaded: ModuleNotFoundError",
    "none": "light 'none' (lamps:none of lamps 1.0) is none: TypeError: its spectrum is no conespot.scene",
    "fickle": "light 'fickle' (lamps:fickle of lamps 1.0) is none: RuntimeError: no such luck; mend or uninstall",
    "negative": "must not be negative",
    "ultraviolet": "wavelengths must lie in 300 to 1100 nm",
    "ambre": "unknown light 'ambre'; did you mean 'amber'?",
}


@pytest.fixture(scope="module")
def found(site, tmp_path_factory):
    """What is said of every light by its name."""
    texts = {name: f"illumination: {name}\n" for name in ("amber", "white", *NO_LAMP)}
    return read(tmp_path_factory.mktemp("scenes"), texts, site)


def test_a_scene_names_it_and_its_spectrum_is_in_the_scene(found, tmp_path):
    """A triangle of 20 nm: at its peak 1/10 per nm; the resolved scene reads the same without the package."""
    light, at_peak, resolved = found["amber"]
    assert "name='amber', package='lamps 1.0'" in light
    assert at_peak == pytest.approx(0.1)
    assert read(tmp_path, {"resolved": resolved})["resolved"] == found["amber"]


def test_nobody_takes_the_name_of_a_light_of_this_package(found):
    assert found["white"][0].startswith("FlatBand(")


@pytest.mark.parametrize(("name", "says"), NO_LAMP.items())
def test_what_is_no_lamp_is_one_sentence_that_names_the_package(found, name, says):
    assert says in found[name]
    assert found[name].startswith(f"{name}.yaml:1: illumination: ")
    assert "\n" not in found[name]
