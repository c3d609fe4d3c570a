"""`conespot` itself: light to open, and every name behind it is there."""

import importlib
import subprocess
import sys

import numpy as np
import pytest

import conespot

HEAVY = ("mitsuba", "drjit", "pandas", "scipy", "numpy", "cv2", "matplotlib", "pydantic")


def test_it_opens_within_a_tenth_of_a_second_and_loads_nothing_heavy():
    """The time of a core to import conespot in a process of its own, the least of five [s]."""
    code = (
        "import sys, time; before = time.process_time(); import conespot; print(time.process_time() - before); "
        f"assert not set(sys.modules) & set({HEAVY})"
    )
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True) for _ in range(5)]
    assert [ran.stderr for ran in runs] == [""] * 5
    assert min(float(ran.stdout) for ran in runs) < 0.1


@pytest.mark.parametrize("name", conespot.__all__)
def test_every_name_is_there_and_is_that_of_its_room(name):
    value = getattr(conespot, name)
    assert value.__name__ == name
    assert getattr(importlib.import_module(value.__module__), name) is value
    assert name in dir(conespot)


def test_another_name_is_refused():
    with pytest.raises(AttributeError, match="module 'conespot' has no attribute 'locat'"):
        _ = conespot.locat


def test_a_scene_is_loaded_and_a_frame_located_as_the_readme_says():
    scene = conespot.load_scene("paper-code")
    side = scene.camera.resolution
    found = conespot.locate(np.zeros((side, side), np.uint8), scene, localizer="paper-code")
    assert not found
    assert isinstance(found, conespot.LocalizationFailure)
    assert found.reason


def test_a_campaign_is_run_and_read_from_python(tmp_path):
    settings = {"poses": "1", "scene.camera.resolution": "100", "samples": "1", "sweep": "{}", "localizers": "[paper]"}
    folder = conespot.run_campaign("power_sweep", str(tmp_path / "run"), settings=settings)
    assert folder == tmp_path / "run"
    for where in (folder, str(folder)):
        assert len(conespot.load_run(where).rows) == 1
