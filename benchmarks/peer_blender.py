"""Times Cycles, Blender's renderer, on one frame of a campaign's scene, and the campaign itself, in the same run.

`python benchmarks/peer_blender.py --python PYTHON`, where PYTHON has bpy (`pip install 'bpy==4.5.*'` in a Python 3.11).
Prints (frames x seconds of one Cycles frame) / wall time of the campaign. Cycles gets as many samples a pixel and two
threads, an even retina in place of the photograph, and no denoising; starting Blender and building its scene are not
counted. The campaign has two workers and no cache, and its time is all of it, from the command line to the report.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from conespot.campaigns.plan import Group, make_plan
from conespot.campaigns.schema import override, read_campaign
from conespot.scene.beam import CyclesBeam

SCRIPT = Path(__file__).parents[1] / "tests" / "system" / "blender_scene.py"


def main() -> None:
    """Time both, one after the other."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", default=sys.executable, help="a Python that has bpy")
    parser.add_argument("--campaign", default="power_sweep")
    parser.add_argument("--resolution", default="5000", help="of both, px a side")
    options = parser.parse_args()
    document = override(read_campaign(options.campaign), "scene.camera.resolution", options.resolution, "--resolution")
    plan = make_plan(document)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        frame = cycles(plan.groups[0], options.python, folder)
        print(f"Cycles: {frame:.1f} s a frame of {options.resolution} px", flush=True)
        command = [sys.executable, "-m", "conespot.campaigns.command", "run", options.campaign]
        command += ["--resolution", options.resolution, "--workers", "2", "--out", str(folder / "run")]
        start = time.perf_counter()
        subprocess.run(command, check=True, env={**os.environ, "CONESPOT_CACHE": "off"}, stdout=subprocess.DEVNULL)
        wall = time.perf_counter() - start
    print(f"{options.campaign}: {wall:.1f} s for {plan.frames} frames of it")
    print(f"{plan.frames} x {frame:.1f} s / {wall:.1f} s = {plan.frames * frame / wall:.0f}")


def cycles(group: Group, python: str, folder: Path) -> float:
    """Seconds of one frame: of the whole one, less those of a single pixel of it."""
    scene, pose = group.scene, group.pose(0)
    setting = {
        "radius": scene.eye.radius,
        "albedo": 0.1,
        "power_w": 1.0,
        "half_angle": scene.beam.half_angle,
        "blend": scene.beam.blend if isinstance(scene.beam, CyclesBeam) else 0.0,
        "apex": pose.apex.tolist(),
        "axis": pose.axis.tolist(),
        "sensor_width": scene.camera.sensor_width,
        "focal_length": scene.camera.focal_length,
        "height": scene.camera.height,
        "resolution": scene.camera.resolution,
        "samples": group.samples,
    }
    taken = []
    for side in (1.0, 1.0 / scene.camera.resolution):
        (folder / "scene.json").write_text(json.dumps({**setting, "window": [0.0, 0.0, side, side]}))
        start = time.perf_counter()
        done = subprocess.run(
            [python, str(SCRIPT), str(folder / "scene.json"), str(folder / "cycles.npy")],
            capture_output=True,
            text=True,
            check=False,
        )
        taken.append(time.perf_counter() - start)
        if done.returncode:
            raise SystemExit(f"Blender failed: {done.stdout[-1000:]}{done.stderr[-1000:]}")
        assert np.load(folder / "cycles.npy").size
    return taken[0] - taken[1]


if __name__ == "__main__":
    main()
