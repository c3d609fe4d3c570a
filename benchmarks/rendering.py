"""Where the processor's time goes: rays against a bare Mitsuba loop, a pose and a power more, and how they scale.

`python benchmarks/rendering.py` prints the tables of docs/performance.md. One thread; processor seconds, the least of
several rounds, so that what else the machine does counts little.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable

os.environ["CONESPOT_CACHE"] = "off"

import cv2
import numpy as np

from conespot.localize import locate
from conespot.render import Exposure, Renderer, Tile, kernel
from conespot.render.reflectance import Reflectance
from conespot.render.retina_mesh import retina_mesh
from conespot.scene import Camera, Scene
from conespot.scene.spotlights import RIGS

TIP = np.array([1.2, -0.7, 5.0])
ROUNDS = 5
SAMPLES = 16


def seconds(work: Callable[[int], object]) -> float:
    """Processor seconds of one call: the least of several, after one that may compile."""
    work(0)
    taken = []
    for seed in range(1, ROUNDS + 1):
        start = time.process_time()
        work(seed)
        taken.append(time.process_time() - start)
    return min(taken)


def throughput(scene: Scene) -> None:
    """Camera rays a second: ours with all samples, and Mitsuba's own loop over as many, there and with a mesh."""
    mi = kernel.load()[0]
    pose = scene.pose(TIP)
    renderer = Renderer(scene, samples=SAMPLES, noise=0.0)
    tile = renderer.tile(pose, 0, seed=0)
    rays = SAMPLES * tile.crop.width * tile.crop.height
    stage = renderer._lit
    loaded, parameters = stage._scenes[0], stage._parameters[0]

    def bare(where: object) -> Callable[[int], object]:
        return lambda seed: np.asarray(mi.render(where, spp=SAMPLES, seed=seed))

    ours = seconds(lambda seed: renderer.tile(pose, 0, seed=seed))
    crop = {"crop_offset": [tile.crop.column, tile.crop.row], "crop_size": [tile.crop.width, tile.crop.height]}
    for key, value in crop.items():
        parameters[f"sensor.film.{key}"] = value
    parameters.update()
    own = seconds(bare(loaded))
    look = Reflectance(scene.retina)
    mesh = retina_mesh(mi, scene, mi.load_dict(look.bsdf(mi, look.texture(mi, None))))
    meshed = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
            "sensor": loaded.sensors()[0],
            "light": loaded.emitters()[0],
            "retina": mesh,
        }
    )
    for name, taken in (
        ("ours", ours),
        ("bare, same sphere", own),
        ("bare, mesh", seconds(bare(meshed))),
    ):
        print(f"| {name} | {rays / taken / 1e6:.1f} | {own / taken:.2f} |")


def costs(resolution: int, rig: str) -> tuple[float, float, float, float]:
    """Processor seconds of a background, a pose's tiles, an exposure, and one localization by `paper-code`."""
    scene = Scene(camera=Camera(resolution=resolution), spotlights=RIGS[rig])
    pose = scene.pose(TIP)
    renderer = Renderer(scene, samples=SAMPLES)
    start = time.process_time()
    background = renderer.background()
    first = time.process_time() - start
    exposure = Exposure(background, scene.sensor)

    def tiles(seed: int) -> list[Tile]:
        return [renderer.tile(pose, k, seed=seed + k) for k in range(len(scene.spotlights))]

    made = tiles(0)

    def expose(power: float) -> None:
        with exposure.shown(made, power):
            pass

    with exposure.shown(made, 0.3) as image:
        found = seconds(lambda seed: locate(image, scene, "paper-code"))
    return first, seconds(tiles), seconds(lambda seed: expose(0.1 + 0.1 * seed)), found


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--resolution", type=int, nargs="+", default=[1000, 2500, 5000])
    options = parser.parse_args()
    cv2.setNumThreads(1)
    kernel.use_threads(1)
    print("| loop | Mray/s | over the bare one |\n| --- | --- | --- |")
    throughput(Scene(camera=Camera(resolution=max(options.resolution))))
    print(
        "\n| px | rig | background s | a pose s | a power more s | of a pose |\n| --- | --- | --- | --- | --- | --- |"
    )
    for resolution in options.resolution:
        for rig in ("single", "triple"):
            background, tiles, exposed, located = costs(resolution, rig)
            power = exposed + located
            pose = tiles + power
            print(f"| {resolution} | {rig} | {background:.2f} | {pose:.3f} | {power:.4f} | {power / pose:.1%} |")


if __name__ == "__main__":
    main()
