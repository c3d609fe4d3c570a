"""What each tuned number of the start is worth: halved, doubled, and how many frames then start in the right place.

`python benchmarks/tuned_start.py` goes through all of them (ten minutes on one quiet core), with names through some.
The frames are cast like those of `tuned_numbers.py`: patches as bright as usual, faint, clipped, cut by the frame and
over the optic disc, rigs, and frames without any light. A start is right where its outlines lie within 0.3 of their
radius of the true ones. For each group of frames whose starts change at all: how many have the right one first, how
many have it, and how many wrong ones are put to the fit, before and after.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, fields

import cv2
import numpy as np
from tuned_numbers import PEAK, albedo, eight_bits, leaves, taken, twelve_bits

from conespot.localize.image import Frame, Reference
from conespot.localize.start import rays, rings
from conespot.localize.start.search import Start, find_starts
from conespot.localize.start.settings import START
from conespot.scene import Pose, Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.camera import Camera
from conespot.scene.sensor import Linear, Srgb8
from conespot.scene.spotlights import RIGS

RIGHT = 0.3  # of an outline's radius
USUAL, FAINT = 45.0, 1.5  # light of the spotlights over the ambient light
COUNTED = ("first", "found", "wrong")
CAMERA = Camera(resolution=1000)
EYES = ((100, 532.0), (101, 850.0), (102, 532.0))  # seeds of procedural eyes, and what they are seen in [nm]


@dataclass(frozen=True)
class Case:
    """A frame and the truth, None where no spotlight shines."""

    group: str
    image: np.ndarray
    scene: Scene
    pose: Pose | None
    reference: Reference | None = None

    def starts(self) -> list[Start]:
        """What the search finds."""
        return list(find_starts(Frame(self.image, self.scene.sensor), self.scene, self.reference))

    def right(self, start: Start) -> bool:
        """Whether it is the true one."""
        return self.pose is not None and start.near(self.pose, self.scene, RIGHT)


def disc_of(colour: np.ndarray, scene: Scene) -> np.ndarray:
    """Where the eye's optic disc lies on the wall `[3]` [mm]: the brightest millimetre of its albedo `[H, W]`."""
    smooth = cv2.GaussianBlur(colour, (0, 0), 0.5 / scene.camera.pixel_pitch)
    row, column = np.unravel_index(int(np.argmax(smooth)), smooth.shape)
    sight = scene.camera.rays(np.array([column + 0.5, row + 0.5])).directions
    return np.asarray(scene.surface.intersect(scene.eye, scene.camera.centre, sight))


def cases() -> Iterator[Case]:
    """All frames."""
    rng = np.random.default_rng(2)
    for seed, wavelength in EYES:
        colour = albedo(seed, wavelength, Scene(camera=CAMERA))
        for beam in (HardBeam(), CyclesBeam()):
            scene = Scene(beam=beam, camera=CAMERA, sensor=Linear(bits=12))
            tip = rng.uniform([-3.0, -3.0, 2.5], [3.0, 3.0, 5.5])
            pose = scene.pose(tip)
            dark = taken(scene, pose, colour, rng, 0.0)
            yield Case("no light", twelve_bits(dark), scene, None)
            yield Case("usual", twelve_bits(taken(scene, pose, colour, rng, USUAL)), scene, pose)
            faint = twelve_bits(taken(scene, pose, colour, rng, FAINT))
            yield Case("faint", faint, scene, pose)
            unlit = Reference((dark / (1.25 * PEAK)).astype(np.float32))
            yield Case("faint, reference", faint, scene, pose, unlit)
            eight = scene.model_copy(update={"sensor": Srgb8()})
            yield Case("clipped", eight_bits(taken(scene, pose, colour, rng, 2000.0)), eight, pose)
            side = scene.pose(np.array([6.2, 0.5 * tip[1], 5.0]))
            yield Case("cut by the frame", twelve_bits(taken(scene, side, colour, rng, USUAL)), scene, side)
            disc, rcm = disc_of(colour, scene), np.asarray(scene.instrument.rcm)
            over = Pose.through(disc + 3.5 * (rcm - disc) / np.linalg.norm(rcm - disc), rcm)
            yield Case("over the disc", twelve_bits(taken(scene, over, colour, rng, 5.0)), scene, over)
            rig = scene.model_copy(update={"spotlights": RIGS["triple"]})
            bare = rig.pose(rng.uniform([-1.0, -1.0, 3.5], [1.0, 1.0, 5.0]))
            turned = Pose(bare.apex, bare.axis, float(rng.uniform(-1.0, 1.0)))
            yield Case("rig", twelve_bits(taken(rig, turned, colour, rng, USUAL)), rig, turned)
            yield Case("rig, faint", twelve_bits(taken(rig, turned, colour, rng, FAINT)), rig, turned)


def bits(starts: list[Start]) -> bytes:
    """What tells starts from others."""
    return b"".join(
        np.array([*s.pose.apex, *s.pose.axis, s.pose.roll, s.explained, s.clearest, s.evidence]).tobytes()
        for s in starts
    )


def counted(which: list[Case], found: list[list[Start]]) -> tuple[int, int, int]:
    """Frames with the right start first, with it at all, and wrong starts."""
    right = [[case.right(start) for start in starts] for case, starts in zip(which, found, strict=True)]
    return sum(r[:1] == [True] for r in right), sum(any(r) for r in right), sum(r.count(False) for r in right)


def main(wanted: list[str]) -> None:
    """Go through the numbers."""
    cv2.setNumThreads(1)
    every = list(cases())
    groups = {group: [case for case in every if case.group == group] for group in dict.fromkeys(c.group for c in every)}
    usual = {group: [case.starts() for case in members] for group, members in groups.items()}
    for group, members in groups.items():
        first, found, wrong = counted(members, usual[group])
        sys.stdout.write(f"{group}: first {first}, found {found} of {len(members)}, wrong {wrong}\n")
    for field in fields(START):
        whole = getattr(START, field.name)
        if wanted and field.name not in wanted:
            continue
        for name, number, put in leaves(whole, field.name):
            for factor in (0.5, 2.0):
                new = factor * number if isinstance(number, float) else math.ceil(factor * number)
                sys.stdout.write(f"{name} {number:g} -> {new:g}\n")
                object.__setattr__(START, field.name, put(new))
                rays.rim.cache_clear()
                rings.ring_kernels.cache_clear()
                try:
                    for group, members in groups.items():
                        after = [case.starts() for case in members]
                        if [bits(s) for s in after] != [bits(s) for s in usual[group]]:
                            counts = zip(counted(members, usual[group]), counted(members, after), strict=True)
                            words = [f"{what} {a} -> {b}" for what, (a, b) in zip(COUNTED, counts, strict=True)]
                            sys.stdout.write(f"    {group}: {', '.join(words)}\n")
                except (ValueError, IndexError, ZeroDivisionError, cv2.error) as error:
                    sys.stdout.write(f"    impossible: {error}\n")
                finally:
                    object.__setattr__(START, field.name, whole)
                sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
