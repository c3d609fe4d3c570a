"""What `campaign plan` promises from: rays a second, seconds a pixel and seconds a scene, on one core.

Run with `python benchmarks/pace.py`. It prints the numbers that stand in `campaigns.plan_words.PACE`, in processor
seconds of this process: poses of the preset `paper-code`, single spotlight, at 2000 px, with 16 and 256 samples a
pixel, and at one and eight powers, each with `paper-code` and `paper`.
"""

from __future__ import annotations

import math
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from conespot.campaigns.bench import Bench
from conespot.campaigns.plan import Plan, make_plan
from conespot.campaigns.plan_words import tile_rays
from conespot.campaigns.schema import read_campaign

TEXT = """\
scene: {{preset: paper-code, camera: {{resolution: 2000}}}}
poses: 8
samples: {samples}
localizers: [paper-code, paper]
sweep: {{scene.power.value: [{powers}]}}
"""


def plan_of(samples: int, powers: int) -> Plan:
    """A plan of one group: eight poses with so many samples a pixel, exposed at so many powers."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "pace.yaml"
        path.write_text(TEXT.format(samples=samples, powers=", ".join(f"{1 + i} W" for i in range(powers))))
        return make_plan(read_campaign(str(path)))


def measured(plan: Plan) -> tuple[float, float]:
    """Processor seconds of the first pose, which loads the scene, and the median of the others."""
    bench, seconds = Bench(plan, None), []
    for unit in plan.units():
        before = time.process_time()
        bench.measure(unit)
        seconds.append(time.process_time() - before)
    return seconds[0], float(np.median(seconds[1:]))


def main() -> None:
    """Print the numbers."""
    (first, few), (_, many), (_, powers) = (measured(plan_of(*args)) for args in ((16, 1), (256, 1), (16, 8)))
    group = plan_of(256, 1).groups[0]
    rays = float(np.mean([tile_rays(group, group.pose(i), 0) for i in range(1, len(group.positions))])) / group.samples
    pixels = math.prod(group.scene.camera.shape)
    a_ray, a_pixel = (many - few) / (240.0 * rays), (powers - few) / (7 * 2 * pixels)
    say = sys.stdout.write
    say(f"rays_per_second   {1.0 / a_ray:.3g}\n")
    say(f"seconds_per_pixel {a_pixel:.3g}\n")
    say(f"seconds_per_scene {first - few:.3g}\n")


if __name__ == "__main__":
    main()
