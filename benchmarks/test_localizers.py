"""How long each localizer takes on a full frame, detection included, on one core.

Run with `python -m pytest benchmarks --benchmark-columns=min,median,max,rounds`; on a machine that does other things
too, `--benchmark-timer=time.process_time` counts processor time. The frames are of the image model itself: 9000
electrons where the patch is brightest, 200 of ambient light and 15 of read noise, in 12 bits, over an albedo that
varies smoothly by 8 %. A hard edge of 8 x 8 rays a pixel errs by up to seven times this noise, and is refused.
"""

from itertools import cycle

import cv2
import numpy as np
import pytest

from conespot.localize import Knowns, SensorNoise, locate
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import ambient_irradiance
from conespot.localize.model.irradiance import Irradiance
from conespot.localize.model.sight import look, window
from conespot.localize.theory.bounds import patch_pixels
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.camera import Camera
from conespot.scene.scene import Scene
from conespot.scene.sensor import Linear

PEAK, AMBIENT, READ = 9000.0, 200.0, 15.0
WHITE = 1.25 * PEAK
NOISE = SensorNoise(levels=4095, electrons=WHITE, read=READ)
#: where all of them answer; at (1, 0.5, 4) mm `cone` refuses the soft frame of 5000 px, as its fit does not settle
TIP = np.array([-1.5, -1.0, 3.0])
BEAMS = {"hard": HardBeam(), "soft": CyclesBeam()}


@pytest.fixture(autouse=True)
def one_core():
    """OpenCV on one thread, and on as many as before afterwards."""
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    yield
    cv2.setNumThreads(threads)


@pytest.fixture(scope="module")
def photograph():
    """Scene, pose and 12-bit frame `[H, W]` of an edge and a resolution, each cast once."""
    taken = {}

    def take(edge, resolution):
        if (edge, resolution) not in taken:
            taken[edge, resolution] = cast(edge, resolution)
        return taken[edge, resolution]

    return take


def cast(edge, resolution):
    """Scene, pose and noisy 12-bit frame `[H, W]`."""
    scene = Scene(beam=BEAMS[edge], camera=Camera(resolution=resolution), sensor=Linear(bits=12))
    pose = scene.pose(TIP)
    pixels = patch_pixels(scene, pose)
    light = lit(scene, pose, pixels)
    electrons = ground(resolution)
    column, row = np.floor(pixels).astype(int).T
    electrons[row, column] += PEAK * albedo(look(scene, pixels).points) * light / np.quantile(light, 0.998)
    rng = np.random.default_rng(1)
    electrons = rng.poisson(electrons) + READ * rng.standard_normal(electrons.shape)
    return scene, pose, np.clip(np.round(electrons / WHITE * 4095.0), 0, 4095).astype(np.uint16)


def lit(scene, pose, pixels):
    """Irradiance of the spotlight on `pixels` `[N, 2]`, in units of its own `[N]`."""
    there, every = Estimate(pose, scene), np.ones(len(pixels), bool)
    return Irradiance(look(scene, pixels), pixels, 1, there, Knowns().within(scene), every)(there)[0][0]


def ground(resolution):
    """Electrons of the ambient light `[H, W]`: seen by a coarser camera, since it varies slowly."""
    coarse = Scene(camera=Camera(resolution=500))
    sight = look(coarse, window(0, 0, 500, 500))
    seen = albedo(sight.points) * ambient_irradiance(sight, coarse)
    return cv2.resize(AMBIENT * (seen / np.median(seen)).reshape(500, 500), (resolution, resolution))


def albedo(points):
    """Of the retina at `points` `[N, 3]` [mm], 1 in the mean `[N]`."""
    return 1.0 + 0.08 * np.sin(1.3 * points[:, 0] + 0.5) * np.cos(0.9 * points[:, 1])


@pytest.mark.parametrize("localizer", ["cone", "photometric", "paper", "paper-code"])
@pytest.mark.parametrize("resolution", [1000, 5000])
@pytest.mark.parametrize("edge", ["hard", "soft"])
def test_a_frame_is_localized(benchmark, photograph, edge, resolution, localizer):
    """One full frame, from pixels to answer."""
    scene, pose, image = photograph(edge, resolution)
    more = {"noise": NOISE} if localizer in {"cone", "photometric"} else {}
    # `paper` remembers what it has filtered; another frame of a noisy camera differs everywhere
    noisy = cycle([image, image ^ 1])
    found = benchmark.pedantic(
        locate,
        setup=lambda: ((next(noisy), scene, localizer), more),
        rounds=10 if resolution == 1000 else 6,
        warmup_rounds=2,
    )
    assert found, found.reason
    benchmark.extra_info["position_error_um"] = 1e3 * float(np.linalg.norm(found.apex_mm - pose.apex))


@pytest.mark.parametrize("localizer", ["paper", "paper-code"])
@pytest.mark.parametrize("resolution", [2000, 5000])
def test_frames_without_noise_over_one_ground_are_localized(benchmark, resolution, localizer):
    """One full 8-bit frame of a sequence in which only the patch moves, as in the paper's sweeps."""
    scene = Scene(beam=CyclesBeam(), camera=Camera(resolution=resolution))
    y, x = np.mgrid[:resolution, :resolution] * (20.0 / resolution)
    ground = (33.0 + 8.0 * np.sin(x) * np.cos(1.7 * y)).astype(np.float32)
    frames = []
    for tip in (TIP, TIP + (0.4, 0.2, 0.5)):
        frame, pixels = ground.copy(), patch_pixels(scene, scene.pose(tip))
        light = lit(scene, scene.pose(tip), pixels)
        column, row = np.floor(pixels).astype(int).T
        frame[row, column] += 300.0 * light / np.quantile(light, 0.998)
        frames.append(np.clip(np.round(frame), 0, 255).astype(np.uint8))
    shown = cycle(frames)
    setup = {"setup": lambda: ((next(shown), scene, localizer), {})}
    assert benchmark.pedantic(locate, **setup, rounds=10, warmup_rounds=4)
