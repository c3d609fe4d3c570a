"""Blender's Cycles on a scene of ours, by a Python that has bpy."""

import json
import subprocess
from pathlib import Path

import numpy as np

from conespot.scene import Pose, Scene
from conespot.scene.beam import CyclesBeam, HardBeam

SCRIPT = Path(__file__).with_name("blender_scene.py")


def cycles_frame(
    python: str,
    scene: Scene,
    pose: Pose,
    folder: Path,
    *,
    albedo: float,
    samples: int,
    window: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0),
) -> np.ndarray:
    """A square frame `[H, W]` of one spotlight at 1 W over an even retina, in Blender's unit of length.

    Only the `window` is traced: left, top, right and bottom, as shares of the frame's side. Raises RuntimeError with
    what Blender says if it fails.
    """
    beam, lens = scene.beam, scene.camera.lens
    assert isinstance(beam, HardBeam | CyclesBeam)
    setting = {
        "window": window,
        "radius": scene.eye.radius,
        "albedo": albedo,
        "power_w": 1.0,
        "half_angle": beam.half_angle,
        "blend": 0.0 if isinstance(beam, HardBeam) else beam.blend,
        "apex": pose.apex.tolist(),
        "axis": pose.axis.tolist(),
        "sensor_width": scene.camera.sensor_width,
        "focal_length": scene.camera.focal_length,
        "height": scene.camera.height,
        "aperture": scene.camera.pupil,
        "focus": 0.0 if lens is None else lens.focus,
        "resolution": scene.camera.shape[0],
        "samples": samples,
    }
    (folder / "scene.json").write_text(json.dumps(setting))
    command = [python, str(SCRIPT), str(folder / "scene.json"), str(folder / "cycles.npy")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=3600, check=False)
    if done.returncode:
        raise RuntimeError(f"Blender failed: {done.stdout[-2000:]}{done.stderr[-2000:]}")
    return np.load(folder / "cycles.npy")
