"""A simulated video at 120 Hz, tracked: time a frame on one core, error beside frame by frame, occlusion, gross ones.

    python benchmarks/tracking.py --exposure-ms 0              # 1000 px, 240 sharp frames: the ideal world
    python benchmarks/tracking.py --theatre                    # 5 ms of exposure, the theatre's core and blur
    python benchmarks/tracking.py --frames 10000 --compared 0  # gross errors; resume elsewhere with --seed

Frames come from the forward model, an exposure is five instants of it, and the tremor has 0.18 mm rms near 9 Hz. Every
frame has the shot and read noise that its camera states, one of eight planes shifted at random; with `--noise-untold`
it has 0.003 of white everywhere, and the scene says nothing of it. 0.5 s in the middle are dark.
"""

import argparse
import os
import sys
from collections import Counter
from pathlib import Path
from time import process_time

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
#: frames that are made before any of them is tracked: what makes one empties the processor's caches of the tracker, and
#: a camera's frames come from elsewhere
AT_A_TIME = 60
#: chi-squared of three degrees that 95 % stay below
WITHIN = 7.815


def main() -> None:
    """Cast, track, smooth and say."""
    given = _options()
    cv2.setNumThreads(1)
    exposure = given.exposure_ms / 1e3
    needle = MovingNeedle(
        given.resolution, seed=given.seed, exposure_s=exposure, like_theatre=given.theatre, emva=not given.noise_untold
    )
    tracker = Tracker(needle.scene, given.localizer)
    dark = range(given.frames // 2, given.frames // 2 + 60)  # 0.5 s without light
    tracked, truth, alone, worked = [], [], [], []
    for k in range(given.frames):
        time = k / needle.rate_hz
        if k % AT_A_TIME == 0:
            ahead = range(k, min(k + AT_A_TIME, given.frames))
            images = [needle.frame(later / needle.rate_hz, dark=later in dark) for later in ahead]
        image = images[k % AT_A_TIME]
        began = process_time()
        tracked.append(tracker.track(image, time))
        worked.append(1e3 * (process_time() - began))
        truth.append(needle.tip(time))
        if k < given.compared:
            found = locate(image, needle.scene, given.localizer)
            alone.append(np.linalg.norm(found.apex_mm - truth[-1]) if found else np.nan)
    lit = [k for k in range(given.frames) if k not in dark]
    latency = 1e3 * np.array([tracked[k].latency_s for k in lit])
    print(
        f"{given.localizer}, {given.resolution} px, {given.exposure_ms:g} ms, {len(lit)} lit frames:",
        dict(Counter(t.state.value for t in tracked)),
    )
    for said, ms in (("by the clock", latency), ("of the processor", np.array(worked)[lit])):
        print(f"ms a frame {said}: median {np.median(ms):.2f}, 99th percentile {np.percentile(ms, 99):.2f}")
    for rate in (60.0, 120.0):
        print(f"live at {rate:g} Hz, too late for: {_late(latency / 1e3, rate)} of {len(lit)}")
    answers = [k for k, t in enumerate(tracked) if t.outcome]
    off = np.array([tracked[k].outcome.apex_mm - truth[k] for k in answers])
    gross = np.count_nonzero(np.linalg.norm(off, axis=1) > GROSS_MM)
    print(f"tip error rms {1e3 * np.sqrt(np.mean(np.sum(off**2, axis=1))):.2f} um, largest"
          f" {1e3 * np.max(np.linalg.norm(off, axis=1)):.1f} um; gross: {gross} of {len(answers)}, in the dark:"
          f" {len(set(answers) & set(dark))}")  # fmt: skip
    inside = [
        float(e @ np.linalg.solve(tracked[k].outcome.covariance[:3, :3], e)) < WITHIN
        for k, e in zip(answers, off, strict=True)
    ]
    print(f"within their 95 % ellipsoid: {100.0 * np.mean(inside):.1f} %")
    if given.compared:
        both = [
            np.linalg.norm(t.outcome.apex_mm - at) if t.outcome else np.nan
            for t, at in zip(tracked, truth, strict=True)
        ]
        print(f"first {given.compared}: tracked {1e3 * np.sqrt(np.nanmean(np.square(both[: given.compared]))):.2f} um,"
              f" frame by frame {1e3 * np.sqrt(np.nanmean(np.square(alone))):.2f} um,"
              f" refused {np.count_nonzero(np.isnan(alone))}")  # fmt: skip
    back = next((k for k in answers if k > dark[-1]), None)
    print(f"answers again {'never' if back is None else back - dark[-1]} frames after the dark")
    times, outcomes = [t.time_s for t in tracked], [t.outcome for t in tracked]
    smooth = smoothed(times, outcomes, needle.scene, tracker.knowns)
    after = np.array([smooth[k].apex_mm - truth[k] for k in answers])
    # what changes from frame to frame: the error less its mean over a quarter of a second
    print(f"independent part: {_jitter(off):.2f} um before, {_jitter(after):.2f} um smoothed")


def _options() -> argparse.Namespace:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--frames", type=int, default=240)
    options.add_argument("--resolution", type=int, default=1000)
    options.add_argument("--localizer", default="cone", choices=("cone", "photometric"))
    options.add_argument("--exposure-ms", type=float, default=5.0)
    options.add_argument("--theatre", action="store_true", help="with a core of 0.1 mm and a blur of 5.7 um")
    options.add_argument("--noise-untold", action="store_true", help="a camera that does not say how noisy it is")
    options.add_argument("--seed", type=int, default=1, help="of the tremor and the noise")
    options.add_argument("--compared", type=int, default=20, help="frames that are searched one by one too")
    return options.parse_args()


def _late(latency_s, rate_hz):
    """How many frames another overtakes before the tracker is free, the newest waiting."""
    free, late, waiting = 0.0, 0, None
    for k, takes in enumerate(latency_s):
        arrives = k / rate_hz
        if waiting is not None and free <= arrives:
            free, waiting = max(free, waiting[0]) + waiting[1], None
        late += waiting is not None
        waiting = (arrives, takes)
    return late


def _jitter(off):
    window = np.ones(31) / 31.0
    slow = np.stack([np.convolve(off[:, c], window, mode="same") for c in range(3)], axis=1)
    return 1e3 * float(np.sqrt(np.mean(np.sum((off - slow)[15:-15] ** 2, axis=1))))


if __name__ == "__main__":
    main()
