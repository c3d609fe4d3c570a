"""What spread, lens and optics together cost at equal noise, beside the same patch in an ideal world.

`python benchmarks/real_eye.py` prints the table of docs/reality.md, in the frames and lights of `campaign run reality`,
and exits 1 where a narrow band takes more than three times the ideal tile's time at equal noise. Noise is the error of
single pixels against a tile of many samples in which t is the mean of 8 x 8 rays a pixel, so that what few rays leave
of t is in it, though it is the same for every seed: rms in percent of the patch, inside and across its rim. Processor
seconds of one thread, medians.
"""

from __future__ import annotations

import os
import sys
import time

os.environ["CONESPOT_CACHE"] = "off"

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.campaigns.plan import make_plan
from conespot.campaigns.schema import override, read_campaign
from conespot.render import Renderer, Tile, glow, kernel
from conespot.scene import Pose, Scene

LENS = "{numerical_aperture: 0.045, focus: 0 mm, blur: 5.7 um, glare: 0.02}"
OPTICS = "{eye: navarro, lens: phakic, contact: flat, pupil: 8 mm}"
#: as `theatre` has them
EFFECTS = {
    "ideal": "{}",
    "lens": f"{{scene.camera.lens: {LENS}}}",
    "optics": f"{{scene.camera.optics: {OPTICS}}}",
    "spread": "{scene.retina.spread: {scattering: 1}}",
    "together": f"{{scene.camera: {{optics: {OPTICS}, lens: {LENS}}}, scene.retina.spread: {{scattering: 1}}}}",
}
#: of the campaign's helix
POSE = 3
SAMPLES = 16
SEEDS = 5
REFERENCE = 256
REFERENCE_ACROSS = 8
#: what lies so close to the outline counts as the rim [px], and what lies further inside as the patch
RIM = 8
MOST = 3.0


def tiles(scene: Scene, pose: Pose) -> tuple[list[NDArray[np.float64]], float, float]:
    """Frames `[H, W]` of the patch, one a seed, and processor seconds of a tile: of the first, and of later ones."""
    renderer = Renderer(scene, samples=SAMPLES, noise=0.0)
    renderer.tile(scene.pose(pose.apex + (0.0, 0.0, 0.5)), 0, seed=0)  # compiles
    found, taken = [], []
    for seed in range(1, SEEDS + 1):
        start = time.process_time()
        tile = renderer.tile(pose, 0, seed=seed)
        taken.append(time.process_time() - start)
        found.append(whole(tile, scene))
    return found, taken[0], float(np.median(taken[1:]))


def reference(scene: Scene, pose: Pose) -> NDArray[np.float64]:
    """The frame `[H, W]` as it would be without noise, nearly."""
    most, between = glow._MOST, glow._BETWEEN
    glow._MOST, glow._BETWEEN = REFERENCE_ACROSS, scene.camera.pixel_pitch / REFERENCE_ACROSS
    try:
        return whole(Renderer(scene, samples=REFERENCE, noise=0.0).tile(pose, 0, seed=99), scene)
    finally:
        glow._MOST, glow._BETWEEN = most, between


def whole(tile: Tile, scene: Scene) -> NDArray[np.float64]:
    """A frame with nothing but the tile in it."""
    frame = np.zeros(scene.camera.shape)
    frame[tile.crop.slices] = tile.radiance[..., 0]
    return frame


def noise(scene: Scene, pose: Pose, frames: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Errors of the patch's inside and of its rim `[2]` [% of the patch]."""
    truth = reference(scene, pose)
    outline = np.round(16.0 * (scene.camera.project(scene.outline(pose, 0)) - 0.5)).astype(np.int32)
    filled = np.zeros(truth.shape, np.uint8)
    cv2.fillPoly(filled, [outline], 1, shift=4)
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * RIM + 1, 2 * RIM + 1))
    inside = cv2.erode(filled, disc) > 0
    rim = (cv2.dilate(filled, disc) > 0) & ~inside
    square = np.mean([np.square(frame - truth) for frame in frames], axis=0)
    return np.array([100.0 * np.sqrt(square[part].mean()) / truth[inside].mean() for part in (inside, rim)])


def main() -> int:
    """Print the table."""
    kernel.use_threads(1)
    effects = ", ".join(f"{name}: {settings}" for name, settings in EFFECTS.items())
    document = override(read_campaign("reality"), "sweep.effect", f"{{{effects}}}", "here")
    kept = True
    ideal: dict[str, tuple[float, NDArray[np.float64]]] = {}
    print("light     effect    first s   later s   noise inside, rim %   time at equal noise: inside, rim")
    for group in make_plan(document).groups:
        swept, pose = group.cases[0].swept, group.pose(POSE)
        light, effect = str(swept["light"]), str(swept["effect"])
        frames, first, later = tiles(group.scene, pose)
        left = noise(group.scene, pose, frames)
        if effect == "ideal":
            ideal[light] = later, left
        before, noisy = ideal[light]
        cost = later / before * np.square(left / noisy)
        print(
            f"{light:9} {effect:9} {first:7.3f} {later:9.3f}   {left[0]:10.3f} {left[1]:7.3f}"
            f"   {cost[0]:20.2f} {cost[1]:8.2f}",
            flush=True,
        )
        kept &= effect != "together" or light == "white" or bool(np.all(cost <= MOST))
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
