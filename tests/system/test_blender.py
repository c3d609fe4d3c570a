"""An independent renderer, Blender's Cycles, renders the same scene.

It needs bpy: the extra `blender` in this Python 3.11, or CONESPOT_BLENDER_PYTHON naming one that has it.
"""

from __future__ import annotations

import csv
import importlib.util
import os
import sys
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from cycles_frame import cycles_frame
from scipy.ndimage import map_coordinates

from conespot.campaigns.command import main
from conespot.render import Renderer
from conespot.scene import Camera, Pose, Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.lens import Lens
from conespot.scene.retina import UniformRetina
from conespot.scene.spotlights import Instrument


def blender_python() -> str | None:
    """A Python that has bpy: the one named in the environment, or this one."""
    return os.environ.get("CONESPOT_BLENDER_PYTHON") or (sys.executable if importlib.util.find_spec("bpy") else None)


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        blender_python() is None, reason="no bpy here: pip install 'conespot[blender]' in a Python 3.11"
    ),
]


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


def rendered(scene: Scene, pose: Pose, folder: Path, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """The radiance of a square frame by Cycles and by us, at 1 W."""
    renderer = Renderer(scene, samples=samples)
    crop, side = renderer.footprint(pose, 0), scene.camera.shape[0]
    assert isinstance(scene.retina, UniformRetina)
    left, top, right, bottom = (
        v / side for v in (crop.column, crop.row, crop.column + crop.width, crop.row + crop.height)
    )
    python, albedo, window = str(blender_python()), scene.retina.albedo, (left, top, right, bottom)
    seen = cycles_frame(python, scene, pose, folder, albedo=albedo, samples=samples, window=window)
    theirs = 1e6 * seen.astype(float)  # Blender's unit of length is taken as 1 mm
    ours = np.zeros((side, side))
    tile = renderer.tile(pose, 0, seed=1)
    ours[tile.crop.slices] = tile.radiance[..., 0]
    return theirs, ours


@pytest.mark.parametrize("beam", [HardBeam(), CyclesBeam(blend=1.0)], ids=["hard", "soft"])
def test_cycles_agrees_with_mitsuba(beam, tmp_path):
    """Radiance of a 500 px frame by Cycles and by us; median ratio within 0.5 %, patch edge within 0.1 px all round."""
    scene = Scene(camera=Camera(resolution=500), retina=UniformRetina(albedo=0.2), beam=beam)
    pose = scene.pose(np.array([1.0, -0.8, 6.0]))
    theirs, ours = rendered(scene, pose, tmp_path, samples=256)
    peak = ours.max()
    bright = ours > 0.3 * peak
    assert np.median(theirs[bright] / ours[bright]) == pytest.approx(1.0, abs=0.005)
    rows, columns = np.nonzero(bright)
    centre = np.array([columns.mean() + 0.5, rows.mean() + 0.5])
    level = 0.4 * peak
    moved = radius_at(theirs, centre, level) - radius_at(ours, centre, level)
    assert abs(np.mean(moved)) < 0.02
    assert np.max(np.abs(moved)) < 0.1


#: the frame's description by keys that docs/own-frames.md has, and nothing else
DESCRIBED = """\
preset: paper
camera: {{resolution: 500, sensor_width: 36 mm, focal_length: 300 mm, height: 110 mm}}
eye: {{radius: 12 mm}}
instrument: {{rcm: [6 mm, 0 mm, 22 mm]}}
beam: {{kind: hard, half_angle: 9 deg}}
sensor: {{kind: linear, bits: 12}}
storage: {{white: {white}}}
"""


def test_a_frame_of_cycles_described_by_documented_keys_alone_is_localized_as_well_as_our_own(tmp_path):
    """Both as EXR of linear light through `campaign localize`: tips within 6 um of the truth, and of each other."""
    scene = Scene(camera=Camera(resolution=500), retina=UniformRetina(albedo=0.2), beam=HardBeam())
    pose = scene.pose(np.array([1.0, -0.8, 4.0]))
    tips = []
    for name, frame in zip(("theirs", "ours"), rendered(scene, pose, tmp_path, samples=256), strict=True):
        with OpenEXR.File({}, {"Y": np.asarray(frame, np.float32)}) as file:
            file.write(str(tmp_path / f"{name}.exr"))
        (tmp_path / f"{name}.yaml").write_text(DESCRIBED.format(white=1.25 * frame.max()))
        files = ["--scene", str(tmp_path / f"{name}.yaml"), "--csv", str(tmp_path / f"{name}.csv")]
        assert main(["localize", str(tmp_path / f"{name}.exr"), *files]) == 0
        with open(tmp_path / f"{name}.csv") as table:
            row = next(csv.DictReader(table))
        tips.append(np.array([float(row[key]) for key in ("x_mm", "y_mm", "z_mm")]))
    off = [float(np.linalg.norm(tip - pose.apex)) for tip in tips]
    assert max(off) < 6e-3
    assert np.linalg.norm(tips[0] - tips[1]) < 6e-3


@pytest.mark.parametrize("focus", [0.0, 4.0])
def test_cycles_agrees_with_mitsuba_through_an_aperture(focus, tmp_path):
    """A hard patch, in focus and 4 mm out of it, by Cycles' thin lens of the same aperture and by ours.

    Radii at which the mean around the patch falls through 10, 30, 50, 70 and 90 % of its light, within 0.15 px. The rim
    is as wide as a disc's circle of confusion makes it: 0.69 of its diameter from 10 to 90 %.
    """
    lens = Lens(aperture=12.0, focus=focus)
    scene = Scene(camera=Camera(resolution=500, lens=lens), retina=UniformRetina(albedo=0.2), beam=HardBeam())
    scene = scene.model_copy(update={"instrument": Instrument(rcm=(0.0, 0.0, 22.0))})
    theirs, ours = rendered(scene, scene.pose(np.array([0.0, 0.0, 8.0])), tmp_path, samples=512)
    rows, columns = np.indices(ours.shape) + 0.5
    distance = np.hypot(columns - 250.0, rows - 250.0)
    rings = np.arange(0.0, 90.0, 1.0)
    places = np.digitize(distance.ravel(), rings)
    count = np.bincount(places, minlength=len(rings) + 1)[1 : len(rings)]
    radii = {}
    for name, image in (("theirs", theirs), ("ours", ours)):
        mean = np.bincount(places, image.ravel(), len(rings) + 1)[1 : len(rings)] / count
        inside = np.median(mean[:10])
        levels = inside * np.array([0.9, 0.7, 0.5, 0.3, 0.1])
        radii[name] = np.interp(-levels, -mean[20:], rings[20:-1] + 0.5)
    assert np.abs(radii["theirs"] - radii["ours"]).max() < 0.15
    assert theirs.sum() == pytest.approx(ours.sum(), rel=0.005)
    ramp = np.ptp(radii["ours"])
    confusion = 12.0 * focus / (110.0 - focus) / scene.camera.pixel_pitch
    assert ramp == pytest.approx(0.69 * confusion, rel=0.05) if focus else ramp < 2.5
