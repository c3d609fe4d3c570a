"""Do the stated ellipsoids hold what they state? Answers by the hundred, of every kind of frame an estimator is given.

`python benchmarks/coverage.py` goes through all kinds (a quarter of an hour on one core), with words like `soft` or
`reference` through those that have one in their name; `--answers N` asks N frames of each. Frames are of the image
model itself, so that nothing but the sensor's noise, the retina and what is told of the RCM and of the light under the
retina (off by their sigmas, anew in every frame) makes errors; the eyes are procedural, of seeds that nothing was set
on, in green and at 850 nm.

Printed for each kind: answers, refusals, rms error [um], the share of tips and of axes inside their 95 % ellipsoid with
the 99 % binomial interval that a true share of 95 % has, and the mean chi-squared a coordinate (1 if sigmas are right).
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from scipy.stats import binom, chi2

from conespot.localize import Knowns, Localization, Reference, SensorNoise, locate
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import ambient_irradiance
from conespot.localize.model.irradiance import Irradiance
from conespot.localize.model.knowns import DEEP_SIGMA
from conespot.localize.model.sight import look, window
from conespot.localize.outcome import Outcome
from conespot.localize.sequence import AmbientMap
from conespot.localize.theory.bounds import patch_pixels
from conespot.localize.together import locate_together
from conespot.render.fundus_maps import fundus_maps
from conespot.scene import Pose, Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.camera import Camera
from conespot.scene.illumination import FlatBand
from conespot.scene.lens import Lens
from conespot.scene.pose import tangents
from conespot.scene.retina import Fundus, Spread
from conespot.scene.sensor import Linear
from conespot.scene.spotlights import RIGS

AMBIENT, READ, WHITE = 200.0, 15.0, 11250.0  # electrons
TEXEL, REACH = 0.01, 8.0  # of the albedo's map, and half its side [mm]
EYES = range(200, 206)
SEQUENCE = 12  # frames that share a retina

BEAMS = {"hard": HardBeam(), "soft": CyclesBeam()}
PAIR = {
    name: Camera(resolution=500, height=180.0, focal_length=490.0, tilt=math.radians(3.7), azimuth=azimuth)
    for name, azimuth in (("left", math.pi), ("right", 0.0))
}


@dataclass(frozen=True)
class Kind:
    """A kind of frame, and what a localizer is told beside it."""

    name: str
    beam: str
    light: float | None = None  #: wavelength [nm] of a procedural eye; None: an even retina
    rcm: float | None = 0.05  #: sigma of what is told of it [mm]
    clipped: tuple[float, float] | None = None  #: share of the patch that is, drawn between these
    beside: str = ""  #: "reference", "sequence", "pair" or "deep"
    blur: float = 0.0  #: of the lens [mm]
    told_blur: float | None = None  #: in place of it
    rig: str = "single"
    localizer: str = "photometric"
    resolution: int = 1000

    @property
    def scene(self) -> Scene:
        """The scene of its frames, but for what a localizer is told amiss."""
        lens = Lens(blur=self.blur) if self.blur else None
        camera = Camera(resolution=self.resolution, lens=lens)
        scene = Scene(beam=BEAMS[self.beam], camera=camera, sensor=Linear(bits=12), spotlights=RIGS[self.rig])
        if self.beside == "deep":
            band = FlatBand(name="infrared", low=845.0, high=855.0)
            scene = scene.model_copy(update={"retina": Fundus(spread=Spread()), "illumination": band})
        if self.beside == "pair":
            scene = scene.model_copy(update={"cameras": PAIR, "camera": PAIR["left"]})
        return scene


def kinds() -> Iterator[Kind]:
    """All kinds of frames."""
    for beam in BEAMS:
        yield Kind(f"{beam}, even, free", beam, rcm=None)
        yield Kind(f"{beam}, even", beam)
        yield Kind(f"{beam}, even, clipped in part", beam, clipped=(0.05, 0.95))
        yield Kind(f"{beam}, even, clipped throughout", beam, clipped=(1.0, 1.0))
        yield Kind(f"{beam}, even, blur told", beam, blur=0.01)
        yield Kind(f"{beam}, even, blur not told", beam, blur=0.02, told_blur=0.0)
        yield Kind(f"{beam}, even, deep light", beam, beside="deep", resolution=500)
        yield Kind(f"{beam}, even, three", beam, rig="triple")
        yield Kind(f"{beam}, even, two cameras", beam, beside="pair")
        for light, nm in (("green", 532.0), ("850 nm", 850.0)):
            yield Kind(f"{beam}, {light}", beam, nm)
            yield Kind(f"{beam}, {light}, reference", beam, nm, beside="reference")
            yield Kind(f"{beam}, {light}, sequence", beam, nm, beside="sequence")
            yield Kind(f"{beam}, {light}, RCM to 0.01 mm", beam, nm, rcm=0.01)
        yield Kind(f"{beam}, green, free", beam, 532.0, rcm=None)
        yield Kind(f"{beam}, green, three", beam, 532.0, rig="triple")
        yield Kind(f"{beam}, green, clipped in part", beam, 532.0, clipped=(0.05, 0.95))
        yield Kind(f"{beam}, green, clipped throughout", beam, 532.0, clipped=(1.0, 1.0))
    yield Kind("soft, even, cone", "soft", localizer="cone")
    yield Kind("soft, green, cone", "soft", 532.0, localizer="cone")


@lru_cache(maxsize=2 * len(EYES))
def albedo(seed: int, wavelength: float, camera: Camera) -> np.ndarray:
    """What every pixel of the frame sees of a procedural eye `[H, W]`, 1 in the median."""
    retina = Fundus(source="procedural", seed=seed)
    plane = fundus_maps(retina).reflectance(wavelength, retina, TEXEL)
    scene = Scene(camera=camera)
    height, width = scene.camera.shape
    points = look(scene, window(0, 0, height, width)).points
    off = np.hypot(points[:, 0], points[:, 1])
    arc = scene.eye.radius * np.arctan2(off, scene.eye.radius - points[:, 2]) / np.maximum(off, 1e-9)
    at = [((sign * points[:, k] * arc + REACH) / TEXEL - 0.5).astype(np.float32) for k, sign in ((0, 1.0), (1, -1.0))]
    seen = cv2.remap(plane, *(a.reshape(height, width) for a in at), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(seen / np.median(seen), float)


@lru_cache(maxsize=4)
def ambient(camera: Camera) -> np.ndarray:
    """Ambient irradiance on every pixel `[H, W]`."""
    scene = Scene(camera=camera)
    height, width = scene.camera.shape
    return ambient_irradiance(look(scene, window(0, 0, height, width)), scene).reshape(height, width)


def spotlights(scene: Scene, pose: Pose, *, whole: bool) -> np.ndarray:
    """Irradiance of the spotlights on every pixel `[H, W]`, 1 where a patch is brightest."""
    lit = np.zeros(scene.camera.shape)
    pixels = window(0, 0, *lit.shape) if whole else patch_pixels(scene, pose)
    there = Estimate(pose, scene)
    value = Irradiance(look(scene, pixels), pixels, 1, there, Knowns().within(scene), np.ones(len(pixels), bool))
    column, row = np.floor(pixels).astype(int).T
    lit[row, column] = value(there)[0][0]
    return lit / float(np.quantile(lit[lit > 0.0], 0.998))


def electrons(scene: Scene, pose: Pose, kind: Kind, colour: np.ndarray | float, rng: np.random.Generator) -> np.ndarray:
    """Electrons that a frame `[H, W]` collects, without noise."""
    lit = spotlights(scene, pose, whole=kind.beside == "deep")
    peak = 0.8 * WHITE
    if kind.clipped is not None:
        share = float(rng.uniform(*kind.clipped))
        patch = (colour * lit)[lit > 0.02]
        peak = 30.0 * WHITE if share == 1.0 else WHITE / max(float(np.quantile(patch, 1.0 - share)), 1e-3)
    return np.asarray(colour * (AMBIENT * ambient(scene.camera) + peak * lit))


def exposed(signal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A frame of 12 bits `[H, W]`."""
    noisy = rng.poisson(signal) + READ * rng.standard_normal(signal.shape)
    return np.clip(np.round(noisy / WHITE * 4095.0), 0, 4095).astype(np.uint16)


@dataclass(eq=False)
class Asked:
    """A frame or two, what is told beside them, and the truth."""

    image: np.ndarray | dict[str, np.ndarray]
    told: Scene
    pose: Pose
    localizer: str
    more: dict[str, Any] = field(default_factory=dict)

    def answer(self) -> Outcome:
        """What the localizer says."""
        if isinstance(self.image, dict):
            return locate_together(self.image, self.told, self.localizer, **self.more)
        return locate(self.image, self.told, self.localizer, **self.more)


def asked(kind: Kind, answers: int, seed: int = 1) -> Iterator[Asked]:
    """Frames of a kind."""
    scene, rng = kind.scene, np.random.default_rng([seed, *kind.name.encode()])
    noise = SensorNoise(levels=4095, electrons=WHITE, read=READ)
    for number in range(answers):
        if kind.light is not None and number % -(-answers // len(EYES)) == 0:
            colour: np.ndarray | float = albedo(EYES[number // -(-answers // len(EYES))], kind.light, scene.camera)
        elif number == 0:
            colour = 1.0
        pose = drawn(scene, rng)
        told = amiss(scene, kind, rng)
        more: dict[str, Any] = {"noise": noise, "knowns": Knowns(rcm_sigma_mm=kind.rcm)}
        if kind.beside == "pair":
            pair = {name: exposed(electrons(scene.through(name), pose, kind, 1.0, rng), rng) for name in PAIR}
            yield Asked(pair, told, pose, kind.localizer, more)
            continue
        image = exposed(electrons(scene, pose, kind, colour, rng), rng)
        if kind.beside == "reference":
            unlit = exposed(AMBIENT * colour * ambient(scene.camera), rng)
            more["reference"] = Reference.of(unlit, scene)
        if kind.beside == "sequence":
            if number % SEQUENCE == 0:
                view = AmbientMap(scene)
                for _ in range(SEQUENCE):
                    view.add(exposed(electrons(scene, drawn(scene, rng), kind, colour, rng), rng))
            more["reference"] = view.reference()
        yield Asked(image, told, pose, kind.localizer, more)


def drawn(scene: Scene, rng: np.random.Generator) -> Pose:
    """A pose whose patches are in the frame."""
    wide = 1.0 if len(scene.spotlights) > 1 or scene.cameras else 2.5
    bare = scene.pose(rng.uniform([-wide, -wide, 2.5], [wide, wide, 5.0]))
    return Pose(bare.apex, bare.axis, float(rng.uniform(-1.0, 1.0))) if len(scene.spotlights) > 1 else bare


def amiss(scene: Scene, kind: Kind, rng: np.random.Generator) -> Scene:
    """The scene as a localizer is told it."""
    rcm = tuple(map(float, np.array(scene.instrument.rcm) + (kind.rcm or 0.0) * rng.standard_normal(3)))
    told = scene.model_copy(update={"instrument": scene.instrument.model_copy(update={"rcm": rcm})})
    if kind.beside == "deep":
        amount, length = np.exp(DEEP_SIGMA * rng.standard_normal(2)).tolist()
        told = told.model_copy(update={"retina": Fundus(spread=Spread(amount=amount, length=length))})
    if kind.told_blur is not None:
        lens = Lens(blur=kind.told_blur) if kind.told_blur else None
        told = told.model_copy(update={"camera": told.camera.model_copy(update={"lens": lens})})
    return told


def squares(found: Localization, pose: Pose) -> tuple[float, float]:
    """Chi-squared of the tip (three degrees) and of the axis (two)."""
    assert found.covariance is not None
    off = found.apex_mm - pose.apex
    turned = np.array(tangents(found.axis)) @ pose.axis
    covariance = np.asarray(found.covariance)
    return float(off @ np.linalg.solve(covariance[:3, :3], off)), float(
        turned @ np.linalg.solve(covariance[3:5, 3:5], turned)
    )


def line(kind: Kind, outcomes: list[tuple[Pose, Outcome]]) -> str:
    """One kind's line."""
    good = [(pose, found) for pose, found in outcomes if isinstance(found, Localization)]
    count = len(good)
    if not count:
        return f"{kind.name:40} {0:4d} answers, {len(outcomes)} refused"
    both = np.array([squares(found, pose) for pose, found in good])
    rms = 1e3 * math.sqrt(np.mean([np.sum(np.square(found.apex_mm - pose.apex)) for pose, found in good]))
    inside = [100.0 * np.mean(both[:, k] < chi2.ppf(0.95, 3 - k)) for k in (0, 1)]
    low, high = (100.0 * binom.ppf(p, count, 0.95) / count for p in (0.005, 0.995))
    mean = both.mean(axis=0) / [3.0, 2.0]
    return (
        f"{kind.name:40} {count:4d} answers, {len(outcomes) - count:3d} refused, {rms:8.3g} um,"
        f" tips {inside[0]:5.1f} % (chi2 {mean[0]:5.2f}), axes {inside[1]:5.1f} % ({mean[1]:5.2f}),"
        f" right {low:.1f} to {high:.1f} %"
    )


def main() -> None:
    """Go through the kinds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("words", nargs="*", help="kinds whose name has all of these words")
    parser.add_argument("--answers", type=int, default=200, help="frames of each kind")
    parser.add_argument("--resolution", type=int, default=1000, help="pixels a side, at most")
    told = parser.parse_args()
    cv2.setNumThreads(1)
    for kind in (replace(kind, resolution=min(kind.resolution, told.resolution)) for kind in kinds()):
        if all(word in kind.name for word in told.words):
            outcomes = [(each.pose, each.answer()) for each in asked(kind, told.answers)]
            sys.stdout.write(line(kind, outcomes) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
