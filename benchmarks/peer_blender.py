"""Times Cycles, Blender's renderer, on one frame of a campaign's scene, and the campaign itself, in the same run.

`python benchmarks/peer_blender.py --python PYTHON`, where PYTHON has bpy (`pip install 'bpy==4.5.*'` in a Python 3.11).
Prints (frames x seconds of one Cycles frame) / wall time of the campaign. Cycles gets as many samples a pixel and two
threads, an even retina in place of the photograph, and no denoising; starting Blender and building its scene are not
counted. The campaign has two workers and no cache, and its time is all of it, from the command line to the report.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from conespot.campaigns.plan import Group, make_plan
from conespot.campaigns.schema import override, read_campaign

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "cast"))

from cycles_frame import cycles_frame


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
        frame = seconds_of(plan.groups[0], options.python, folder)
        print(f"Cycles: {frame:.1f} s a frame of {options.resolution} px", flush=True)
        command = [sys.executable, "-m", "conespot.campaigns.command", "run", options.campaign]
        command += ["--resolution", options.resolution, "--workers", "2", "--out", str(folder / "run")]
        start = time.perf_counter()
        subprocess.run(command, check=True, env={**os.environ, "CONESPOT_CACHE": "off"}, stdout=subprocess.DEVNULL)
        wall = time.perf_counter() - start
    print(f"{options.campaign}: {wall:.1f} s for {plan.frames} frames of it")
    print(f"{plan.frames} x {frame:.1f} s / {wall:.1f} s = {plan.frames * frame / wall:.0f}")


def seconds_of(group: Group, python: str, folder: Path) -> float:
    """Seconds of one frame: of the whole one, less those of a single pixel of it."""
    taken = []
    for side in (1.0, 1.0 / group.scene.camera.shape[0]):
        start = time.perf_counter()
        window = (0.0, 0.0, side, side)
        image = cycles_frame(
            python, group.scene, group.pose(0), folder, albedo=0.1, samples=group.samples, window=window
        )
        taken.append(time.perf_counter() - start)
        assert image.size
    return taken[0] - taken[1]


if __name__ == "__main__":
    main()
