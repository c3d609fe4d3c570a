"""An independent renderer, Blender's Cycles, renders the same scene.

It needs bpy: the extra `blender` in this Python 3.11, or CONESPOT_BLENDER_PYTHON naming one that has it.
"""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from conespot.render import Renderer
from conespot.scene import Camera, Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.retina import UniformRetina

SCRIPT = Path(__file__).with_name("blender_scene.py")


def blender_python() -> str | None:
    """A Python that has bpy: the one named in the environment, or this one."""
    return os.environ.get("CONESPOT_BLENDER_PYTHON") or (sys.executable if importlib.util.find_spec("bpy") else None)


def radius_at(image: np.ndarray, centre: np.ndarray, level: float, directions: int = 72) -> np.ndarray:
    """Distance [px] from `centre` (x, y) at which the image falls through `level`, in each direction."""
    steps = np.arange(0.0, 120.0, 0.05)
    found = []
    for phi in np.arange(directions) * 2.0 * np.pi / directions:
        x, y = centre[0] - 0.5 + steps * np.cos(phi), centre[1] - 0.5 + steps * np.sin(phi)
        values = map_coordinates(image, [y, x], order=1, mode="nearest")
        last = np.flatnonzero(values >= level).max()
        found.append(steps[last] + 0.05 * (values[last] - level) / (values[last] - values[last + 1]))
    return np.array(found)


@pytest.mark.skipif(blender_python() is None, reason="no bpy here: pip install 'conespot[blender]' in a Python 3.11")
@pytest.mark.parametrize("beam", [HardBeam(), CyclesBeam(blend=1.0)], ids=["hard", "soft"])
def test_cycles_agrees_with_mitsuba(beam, tmp_path):
    """Radiance of a 500 px frame by Cycles and by us; median ratio within 0.5 %, patch edge within 0.1 px all round."""
    scene = Scene(camera=Camera(resolution=500), retina=UniformRetina(albedo=0.2), beam=beam)
    pose = scene.pose(np.array([1.0, -0.8, 6.0]))
    renderer = Renderer(scene, samples=256)
    crop = renderer.footprint(pose, 0)
    setting = {
        "window": [v / 500 for v in (crop.column, crop.row, crop.column + crop.width, crop.row + crop.height)],
        "radius": scene.eye.radius,
        "albedo": 0.2,
        "power_w": 1.0,
        "half_angle": beam.half_angle,
        "blend": 0.0 if isinstance(beam, HardBeam) else beam.blend,
        "apex": pose.apex.tolist(),
        "axis": pose.axis.tolist(),
        "sensor_width": scene.camera.sensor_width,
        "focal_length": scene.camera.focal_length,
        "height": scene.camera.height,
        "resolution": 500,
        "samples": 256,
    }
    (tmp_path / "scene.json").write_text(json.dumps(setting))
    command = [str(blender_python()), str(SCRIPT), str(tmp_path / "scene.json"), str(tmp_path / "cycles.npy")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    theirs = 1e6 * np.load(tmp_path / "cycles.npy").astype(float)  # Blender's unit of length is taken as 1 mm
    ours = np.zeros((500, 500))
    tile = renderer.tile(pose, 0, seed=1)
    ours[tile.crop.slices] = tile.radiance[..., 0]
    peak = ours.max()
    bright = ours > 0.3 * peak
    assert np.median(theirs[bright] / ours[bright]) == pytest.approx(1.0, abs=0.005)
    rows, columns = np.nonzero(bright)
    centre = np.array([columns.mean() + 0.5, rows.mean() + 0.5])
    level = 0.4 * peak
    moved = radius_at(theirs, centre, level) - radius_at(ours, centre, level)
    assert abs(np.mean(moved)) < 0.02
    assert np.max(np.abs(moved)) < 0.1
