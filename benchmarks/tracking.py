"""A simulated video at 120 Hz, tracked: time a frame on one core, error beside frame by frame, occlusion, gross ones.

    python benchmarks/tracking.py                  # 1000 px, 240 frames, ideal: what docs/tracking.md states
    python benchmarks/tracking.py --frames 10000   # gross errors; about a second for each frame by frame search

Frames come from the forward model, 5 ms of exposure each, with a tremor of 0.18 mm rms near 9 Hz.
"""

import argparse
import os
import sys
from collections import Counter
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[name] = "1"
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "cast"))

import cv2  # noqa: E402
import numpy as np  # noqa: E402
from moving import MovingNeedle  # noqa: E402

from conespot import Tracker, locate  # noqa: E402
from conespot.localize.tracking.smoother import smoothed  # noqa: E402

#: an answer farther off than this is a gross error [mm]
GROSS_MM = 0.3


def main() -> None:
    """Cast, track, smooth and say."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--frames", type=int, default=240)
    options.add_argument("--resolution", type=int, default=1000)
    options.add_argument("--localizer", default="cone", choices=("cone", "photometric"))
    options.add_argument("--compared", type=int, default=40, help="frames that are searched one by one too")
    given = options.parse_args()
    cv2.setNumThreads(1)
    needle = MovingNeedle(given.resolution)
    tracker = Tracker(needle.scene, given.localizer)
    dark = range(given.frames // 2, given.frames // 2 + 60)  # 0.5 s without light
    tracked, truth, alone = [], [], []
    for k in range(given.frames):
        time = k / needle.rate_hz
        image = needle.frame(time, dark=k in dark)
        tracked.append(tracker.track(image, time))
        truth.append(needle.tip(time))
        if k < given.compared:
            found = locate(image, needle.scene, given.localizer)
            alone.append(np.linalg.norm(found.apex_mm - truth[-1]) if found else np.nan)
    lit = [k for k in range(given.frames) if k not in dark]
    latency = 1e3 * np.array([tracked[k].latency_s for k in lit])
    print(
        f"{given.localizer}, {given.resolution} px, {len(lit)} lit frames:",
        dict(Counter(t.state.value for t in tracked)),
    )
    print(f"ms a frame: median {np.median(latency):.2f}, 99th percentile {np.percentile(latency, 99):.2f}")
    answers = [k for k, t in enumerate(tracked) if t.outcome]
    off = np.array([tracked[k].outcome.apex_mm - truth[k] for k in answers])
    print(f"tip error rms {1e3 * np.sqrt(np.mean(np.sum(off**2, axis=1))):.2f} um; gross:"
          f" {np.count_nonzero(np.linalg.norm(off, axis=1) > GROSS_MM)} of {len(answers)}, in the dark:"
          f" {len(set(answers) & set(dark))}")  # fmt: skip
    both = [np.linalg.norm(tracked[k].outcome.apex_mm - truth[k]) for k in range(given.compared) if tracked[k].outcome]
    print(f"first {given.compared}: tracked {1e3 * np.sqrt(np.mean(np.square(both))):.2f} um,"
          f" frame by frame {1e3 * np.sqrt(np.nanmean(np.square(alone))):.2f} um")  # fmt: skip
    back = next((k for k in answers if k > dark[-1]), None)
    print(f"answers again {'never' if back is None else back - dark[-1]} frames after the dark")
    times, outcomes = [t.time_s for t in tracked], [t.outcome for t in tracked]
    smooth = smoothed(times, outcomes, needle.scene, tracker.knowns)
    after = np.array([smooth[k].apex_mm - truth[k] for k in answers])
    # what changes from frame to frame: the error less its mean over a quarter of a second
    print(f"independent part: {_jitter(off):.2f} um before, {_jitter(after):.2f} um smoothed")


def _jitter(off):
    window = np.ones(31) / 31.0
    slow = np.stack([np.convolve(off[:, c], window, mode="same") for c in range(3)], axis=1)
    return 1e3 * float(np.sqrt(np.mean(np.sum((off - slow)[15:-15] ** 2, axis=1))))


if __name__ == "__main__":
    main()
