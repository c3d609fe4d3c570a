"""What each tuned number of the fits is worth: halved, doubled, and what then becomes of the tips.

`python benchmarks/tuned_numbers.py` goes through all of them (half an hour on one core), with names like `edge.level
field.near` through some. The frames are of the image model itself over three procedural eyes (`render.fundus_maps`), in
green and at 850 nm, with a camera's noise. Printed for each group of frames: rms error of the tip [um] of the frames
answered before and after, refusals, and the share of tips inside the stated 95 % ellipsoid. Groups in which no answer
changes by a single bit are left out.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass

import cv2
import numpy as np

from conespot.localize import Knowns, Localization, Reference, SensorNoise, doubt, locate
from conespot.localize.edge.settings import EDGE
from conespot.localize.field.settings import FIELD
from conespot.localize.image import Frame
from conespot.localize.model.forward import ambient_irradiance, light
from conespot.localize.model.profile import Profile
from conespot.localize.model.residual import RESIDUAL
from conespot.localize.model.sight import look, window
from conespot.localize.model.solve import STEP
from conespot.localize.model.view import VIEW
from conespot.localize.outcome import Outcome
from conespot.localize.start.search import Start, find_starts
from conespot.localize.theory.bounds import patch_pixels
from conespot.localize.verdict import VERDICT
from conespot.render.fundus_maps import fundus_maps
from conespot.scene import Pose, Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.camera import Camera
from conespot.scene.retina import Fundus
from conespot.scene.sensor import Linear, Srgb8
from conespot.scene.spotlights import RIGS

SETTINGS = {"edge": EDGE, "field": FIELD, "residual": RESIDUAL, "step": STEP, "view": VIEW, "verdict": VERDICT}
#: the frames a stage has to do with; all if it is not named here
GROUPS = {
    "edge": ("hard", "hard, colour", "hard, rig", "hard, clipped", "soft, clipped", "soft, cone"),
    "field": ("soft", "soft, free", "soft, reference", "soft, colour", "soft, rig"),
}
PEAK, AMBIENT, READ = 9000.0, 200.0, 15.0
NOISE = SensorNoise(levels=4095, electrons=1.25 * PEAK, read=READ)
TEXEL, REACH = 0.01, 8.0  # of the albedo's map, and half its side [mm]
CHI_95 = 7.815  # of three degrees of freedom


@dataclass(frozen=True)
class Case:
    """A frame, what a localizer is told, and the truth."""

    group: str
    image: np.ndarray
    scene: Scene
    pose: Pose
    localizer: str
    more: dict

    def answer(self) -> Outcome:
        """What the localizer says."""
        return locate(self.image, self.scene, self.localizer, **self.more)


def albedo(seed: int, wavelength: float, scene: Scene) -> np.ndarray:
    """What every pixel of the frame sees of a procedural eye `[H, W]`."""
    retina = Fundus(source="procedural", seed=seed)
    plane = fundus_maps(retina).reflectance(wavelength, retina, TEXEL)
    side = scene.camera.resolution
    points = look(scene, window(0, 0, side, side)).points
    off = np.hypot(points[:, 0], points[:, 1])
    arc = scene.eye.radius * np.arctan2(off, scene.eye.radius - points[:, 2]) / np.maximum(off, 1e-9)
    at = [((sign * points[:, k] * arc + REACH) / TEXEL - 0.5).astype(np.float32) for k, sign in ((0, 1.0), (1, -1.0))]
    seen = cv2.remap(plane, *(a.reshape(side, side) for a in at), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(seen / np.median(seen), float)


def taken(scene: Scene, pose: Pose, colour: np.ndarray, rng: np.random.Generator, contrast: float) -> np.ndarray:
    """Electrons of a frame `[H, W]`, the spotlights `contrast` times as bright as the ambient light."""
    side = scene.camera.resolution
    whole = window(0, 0, side, side)
    lit = np.zeros((side, side))
    pixels = patch_pixels(scene, pose)
    column, row = np.floor(pixels).astype(int).T
    lit[row, column] = light(look(scene, pixels), pose, scene, Profile.of(scene.beam)).value
    lit *= contrast / max(np.quantile(lit[row, column], 0.998), 1e-12)
    ambient = ambient_irradiance(look(scene, whole), scene).reshape(side, side)
    electrons = rng.poisson(AMBIENT * colour * (ambient + lit)) + READ * rng.standard_normal((side, side))
    return np.asarray(electrons)


def twelve_bits(electrons: np.ndarray) -> np.ndarray:
    """As the linear sensor has them."""
    return np.clip(np.round(electrons / (1.25 * PEAK) * 4095.0), 0, 4095).astype(np.uint16)


def eight_bits(electrons: np.ndarray) -> np.ndarray:
    """As an sRGB sensor has them that shows ambient light at grey 37."""
    lit = np.clip(0.0191 * electrons / AMBIENT, 0.0, 1.0)
    curve = np.where(lit <= 0.0031308, 12.92 * lit, 1.055 * np.maximum(lit, 1e-9) ** (1.0 / 2.4) - 0.055)
    return np.round(255.0 * curve).astype(np.uint8)


def cases() -> Iterator[Case]:
    """All frames: eyes and lights, edges, sensors, with a reference and without."""
    rng = np.random.default_rng(1)
    camera = Camera(resolution=1000)
    told = {"noise": NOISE}
    for seed in (100, 101, 102):
        colours = {wavelength: albedo(seed, wavelength, Scene(camera=camera)) for wavelength in (640.0, 532.0, 850.0)}
        for edge, beam in (("hard", HardBeam()), ("soft", CyclesBeam())):
            linear = Scene(beam=beam, camera=camera, sensor=Linear(bits=12))
            clipping = linear.model_copy(update={"sensor": Srgb8()})
            for wavelength in (532.0, 532.0, 850.0, 850.0):
                colour = colours[wavelength]
                pose = linear.pose(rng.uniform([-3.0, -3.0, 2.5], [3.0, 3.0, 5.5]))
                image = twelve_bits(taken(linear, pose, colour, rng, PEAK / AMBIENT))
                yield Case(edge, image, linear, pose, "photometric", told)
                if edge == "soft":
                    dark = taken(linear, pose, colour, rng, 0.0)
                    unlit = Reference((dark / (1.25 * PEAK)).astype(np.float32))
                    yield Case("soft, free", image, linear, pose, "photometric", {**told, "knowns": Knowns(None)})
                    yield Case("soft, cone", image, linear, pose, "cone", told)
                    yield Case("soft, reference", image, linear, pose, "photometric", {**told, "reference": unlit})
                image = eight_bits(taken(clipping, pose, colour, rng, 2000.0))
                yield Case(f"{edge}, clipped", image, clipping, pose, "photometric", {})
            planes = [twelve_bits(taken(linear, pose, plane, rng, PEAK / AMBIENT)) for plane in colours.values()]
            yield Case(f"{edge}, colour", np.stack(planes, axis=-1), linear, pose, "photometric", told)
            rig = linear.model_copy(update={"spotlights": RIGS["triple"]})
            bare = rig.pose(rng.uniform([-1.0, -1.0, 3.5], [1.0, 1.0, 5.0]))
            pose = Pose(bare.apex, bare.axis, float(rng.uniform(-1.0, 1.0)))
            image = twelve_bits(taken(rig, pose, colours[532.0], rng, PEAK / AMBIENT))
            yield Case(f"{edge}, rig", image, rig, pose, "photometric", told)


_starts: dict[tuple[int, bool], list[Start]] = {}


def remembered(frame: Frame, scene: Scene, reference: Reference | None = None) -> Iterator[Start]:
    """The starts of a frame, which none of these numbers changes: searched for once."""
    key = id(frame.pixels), reference is None
    if key not in _starts:
        _starts[key] = list(find_starts(frame, scene, reference))
    return iter(_starts[key])


def leaves(value: object, name: str) -> Iterator[tuple[str, float | int, Callable[[float | int], object]]]:
    """Every number within a setting: its name, its value, and the setting with another in its place."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        yield name, value, lambda new: new
    elif isinstance(value, tuple) and all(isinstance(part, int | float) for part in value):
        yield name, 1.0, lambda new: tuple(type(part)(math.ceil(new * part)) if isinstance(part, int) else new * part
                                           for part in value)  # fmt: skip
    elif isinstance(value, tuple):
        for k, part in enumerate(value):
            for inner, number, put in leaves(part, f"{name}[{k}]"):
                yield inner, number, lambda new, k=k, put=put: (*value[:k], put(new), *value[k + 1 :])
    elif is_dataclass(value):
        own = {field.name: getattr(value, field.name) for field in fields(value)}
        for key, part in own.items():
            for inner, number, put in leaves(part, f"{name}.{key}"):
                yield inner, number, lambda new, key=key, put=put: type(value)(**{**own, key: put(new)})


def bits(outcome: Outcome) -> bytes | str:
    """What tells an answer from another one."""
    if not isinstance(outcome, Localization):
        return outcome.reason
    return b"".join(np.asarray(a, float).tobytes() for a in (outcome.apex_mm, outcome.axis, outcome.covariance))


def told(which: list[Case], before: list[Outcome], after: list[Outcome]) -> str:
    """One group's line."""
    if [bits(o) for o in before] == [bits(o) for o in after]:
        return "-"
    both = [
        (case.pose.apex, a, b)
        for case, a, b in zip(which, before, after, strict=True)
        if isinstance(a, Localization) and isinstance(b, Localization)
    ]
    off = np.array([[np.sum(np.square(o.apex_mm - true)) for o in (a, b)] for true, a, b in both]).reshape(-1, 2)
    inside = [
        [float((o.apex_mm - true) @ np.linalg.solve(o.covariance[:3, :3], o.apex_mm - true)) < CHI_95 for o in (a, b)]
        for true, a, b in both
    ]
    rms = 1e3 * np.sqrt(np.mean(off, axis=0))
    refused = [sum(not isinstance(o, Localization) for o in outcomes) for outcomes in (before, after)]
    share = 100.0 * np.mean(inside, axis=0)
    return (
        f"{rms[0]:.3g} -> {rms[1]:.3g} um, refused {refused[0]} -> {refused[1]} of {len(which)},"
        f" inside {share[0]:.0f} -> {share[1]:.0f} %"
    )


def main(wanted: list[str]) -> None:
    """Go through the numbers."""
    cv2.setNumThreads(1)
    doubt.find_starts = remembered
    every = list(cases())
    groups = {group: [case for case in every if case.group == group] for group in dict.fromkeys(c.group for c in every)}
    usual = {group: [case.answer() for case in members] for group, members in groups.items()}
    for stage, settings in SETTINGS.items():
        for field in fields(settings):
            whole = getattr(settings, field.name)
            for name, number, put in leaves(whole, f"{stage}.{field.name}"):
                if wanted and not any(name.startswith(w) for w in wanted):
                    continue
                for factor in (0.5, 2.0):
                    new = factor * number if isinstance(number, float) else math.ceil(factor * number)
                    sys.stdout.write(f"{name} {number:g} -> {new:g}\n")
                    object.__setattr__(settings, field.name, put(new))
                    try:
                        for group in GROUPS.get(stage, tuple(groups)):
                            members = groups[group]
                            line = told(members, usual[group], [case.answer() for case in members])
                            if line != "-":
                                sys.stdout.write(f"    {group}: {line}\n")
                    except (ValueError, IndexError, ZeroDivisionError, cv2.error) as error:
                        sys.stdout.write(f"    impossible: {error}\n")
                    finally:
                        object.__setattr__(settings, field.name, whole)
                    sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
