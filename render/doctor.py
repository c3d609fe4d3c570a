"""The doctor: what this machine renders with, and a tile to prove it."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator

import numpy as np

from conespot.render import kept, kernel
from conespot.render.renderer import Renderer
from conespot.scene import Camera, Scene
from conespot.scene.beam import HardBeam
from conespot.scene.retina import UniformRetina
from conespot.scene.spotlights import spotlight_axes


def examine() -> Iterator[str]:
    """Lines of a report, as they are found. Raises KernelError if nothing can render.

    The proof is a tile whose centre must show albedo / pi * I0 * cos(incidence) / distance^2 within 0.5 %.
    """
    _, _, found = kernel.load()
    yield f"mitsuba {found.mitsuba}, drjit {found.drjit}"
    yield f"variant {found.variant} ({found.remark})"
    yield f"LLVM library {found.llvm}"
    yield said_of_kept()
    scene = Scene(camera=Camera(resolution=500), beam=HardBeam(), retina=UniformRetina(albedo=0.1))
    pose = scene.pose(np.array([1.0, 0.5, 4.0]))
    start = time.perf_counter()
    renderer = Renderer(scene, samples=4)
    tile = renderer.tile(pose, 0, seed=1)
    seconds = time.perf_counter() - start

    axis = spotlight_axes(pose, scene.spotlights)[0]
    distance = float(scene.eye.intersect(pose.apex, axis))
    point = pose.apex + distance * axis
    cosine = float((point - scene.eye.centre) @ axis) / scene.eye.radius
    expected = 0.1 / math.pi * cosine / (4.0 * math.pi * (distance * 1e-3) ** 2)
    x, y = np.floor(scene.camera.project(point)).astype(int)
    seen = float(tile.radiance[y - tile.crop.row, x - tile.crop.column, 0])
    yield f"rendered a tile of {tile.crop.width} x {tile.crop.height} px in {seconds:.2f} s with loading and compiling"
    error = seen / expected - 1.0
    verdict = "agrees" if abs(error) < 0.005 else "DISAGREES"
    yield f"radiance at the spot's centre {seen:.2f} W/m2/sr, closed form {expected:.2f}: {verdict} ({error:+.2%})"
    if verdict != "agrees":
        raise kernel.KernelError("the rendered tile is wrong: this installation of mitsuba cannot be trusted")


def said_of_kept() -> str:
    """Where backgrounds are kept between runs, and how much room they take."""
    place = kept.folder()
    if place is None:
        return f"backgrounds are not kept: {kept.SWITCH}=off is set, or the cache folder cannot be written"
    count, size = kept.occupied()
    return f"{count} backgrounds kept in {place}, {size / 1e6:.0f} MB of at most {kept.LIMIT / 1e6:.0f} MB"
