"""How long each localizer takes on a full frame, detection included, on one core.

Run with `python -m pytest benchmarks --benchmark-columns=min,median,max,rounds`. The frames are cast from the scene's
geometry: 9000 electrons where the patch is brightest, 200 of ambient light and 15 of read noise, in 12 bits, over an
albedo that varies smoothly by 8 %. They are good enough for speed, not for accuracy: an edge pixel is 8 x 8 rays, and
the ambient light is even.
"""

from itertools import cycle

import cv2
import numpy as np
import pytest

from conespot.localize import SensorNoise, locate
from conespot.localize.model.sight import look
from conespot.localize.theory.bounds import patch_pixels
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.camera import Camera
from conespot.scene.scene import Scene
from conespot.scene.sensor import Linear
from conespot.scene.spotlights import spotlight_axes

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
    fine = 8 if edge == "hard" else 2  # rays a pixel's side: a hard edge covers pixels in part
    offsets = (np.arange(fine) + 0.5) / fine - 0.5
    light = np.mean([lit(scene, pose, pixels + (dx, dy)) for dx in offsets for dy in offsets], axis=0)
    electrons = np.full((resolution, resolution), AMBIENT)
    column, row = np.floor(pixels).astype(int).T
    electrons[row, column] += PEAK * light / np.quantile(light, 0.998)
    rng = np.random.default_rng(1)
    electrons = rng.poisson(electrons) + READ * rng.standard_normal(electrons.shape)
    return scene, pose, np.clip(np.round(electrons / WHITE * 4095.0), 0, 4095).astype(np.uint16)


def lit(scene, pose, pixels):
    """What the spotlight sends back from where pixels `[N, 2]` look, in units of its own `[N]`."""
    sight = look(scene, pixels)
    to = sight.points - pose.apex
    d = np.linalg.norm(to, axis=1)
    profile = scene.beam.intensity(to @ spotlight_axes(pose, scene.spotlights)[0] / d)
    albedo = 1.0 + 0.08 * np.sin(1.3 * sight.points[:, 0] + 0.5) * np.cos(0.9 * sight.points[:, 1])
    return albedo * profile * -np.sum(sight.normals * to, axis=1) / d**3


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
