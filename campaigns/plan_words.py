"""What a plan would do, in words: cases, frames, renderings, power in both conventions, and the work."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.campaigns.plan import Group, Plan
from conespot.campaigns.variation import variation, wrapped
from conespot.render.rim import rim_pixels
from conespot.scene import Pose, Scene
from conespot.scene.exposure_limits import RetinalExposure, scene_exposure
from conespot.scene.words import assumed


@dataclass(frozen=True)
class Pace:
    """What one core does, as `python benchmarks/pace.py` measures it: good enough to tell minutes from hours."""

    rays_per_second: float = 83e6  #: samples traced
    seconds_per_pixel: float = 0.73e-9  #: to expose a frame and localize it once
    seconds_per_scene: float = 1.7  #: to load a scene and compile its kernels
    background_rays: float = 4.0  #: samples a pixel of the view without spotlights, as `render.renderer` takes them
    # what follows is from a background and two tiles of `theatre-ideal` at 640 x 360 px, still and with spread alone,
    # and from those of `theatre-4k` in docs/reality.md: good to a factor of two or three
    varied_background_rays: float = 16.0  #: those of a living fundus, or through an aperture
    spread_sample: float = 0.9e-6  #: more for a sample of a background with light under the retina [s]
    optics_sample: float = 0.6e-6  #: more for one through the eye's optics [s]
    glow_pixel: float = 3.8e-6  #: deep light of a tile, a pixel [s]
    glow_margin: float = 0.65  #: how far around a patch that is looked at [mm]
    framed_pixel: float = 2e-6  #: the same through the eye's optics, where it is looked at in all of the frame [s]
    fit: float = 1.0  #: a localization by a fit where the scene has such effects: 0.5 to 2 s in `theatre`


PACE = Pace()


@dataclass(frozen=True)
class Size:
    """What a run takes [bytes], as its processes and folder were measured, see docs/performance.md, Memory."""

    session: float = 0.4e9  #: the command itself, with the figures
    worker: float = 0.7e9  #: a process that renders a grey retina
    spectral_worker: float = 1.2e9  #: one that renders a living fundus
    pixel: float = (
        9.0  #: of a frame, in each process that renders, beside 0.25 GB: more than that from 7000 px a side on
    )
    glowing_pixel: float = 34.0  #: more where light spreads under the retina: what is kept of t for the next tiles
    row: float = 1.2e3  #: in journal, CSV and parquet together
    report: float = 5e6


SIZE = Size()


def describe(plan: Plan, workers: int) -> Iterator[str]:
    """Lines that say what a run of the plan does with that many workers."""
    campaign = plan.campaign
    yield f"{campaign.name}: {campaign.description}".rstrip(": ")
    if campaign.theory:
        yield f"theory: {', '.join(campaign.theory)}"
    if not plan.cases:
        return
    yield f"{len(plan.cases)} cases, {plan.frames} frames, {plan.rows} localizations (one row each)"
    yield from variation(plan)
    yield (
        f"{plan.tiles} tiles and {plan.scenes} backgrounds are rendered; powers, knowledge and localizers share them "
        f"({len(plan.groups)} groups of cases)"
    )
    yield f"about {_duration(_seconds(plan) / workers)} on {workers} workers (on cores like those it was tuned on)"
    yield from _effects(plan)
    yield from _exposures(plan)
    yield f"about {_memory(plan, workers) / 1e9:.1f} GB of memory, and {_disk(plan) / 1e6:.0f} MB of disk"


def _effects(plan: Plan) -> Iterator[str]:
    """Lens, motion and optics, in the words of a run's tables, where a case has any."""
    for name, part in (("sensor", "transfer"), ("eye", "radius")):
        having = [c.scene for c in plan.cases if c.scene.camera.lens or c.scene.motion or c.scene.camera.optics]
        for said in dict.fromkeys(assumed(scene)[part] for scene in having):
            yield from wrapped(name, said)


def _memory(plan: Plan, workers: int) -> float:
    """Memory [bytes] of the processes of a run."""
    return SIZE.session + workers * max(_worker(case.scene) for case in plan.cases)


def _worker(scene: Scene) -> float:
    """Memory [bytes] of a process that renders and localizes frames of a scene."""
    pixels = math.prod(scene.camera.shape)
    least = SIZE.spectral_worker if scene.retina.is_spectral else SIZE.worker
    glowing = SIZE.glowing_pixel * pixels if scene.spread is not None else 0.0
    return max(least, 0.25e9 + SIZE.pixel * pixels) + glowing


def _disk(plan: Plan) -> float:
    """Disk [bytes] that the run folder takes."""
    frames = sum(len(g.positions) * g.frames * 4.0 * math.prod(g.scene.camera.shape) for g in plan.groups)
    return SIZE.report + SIZE.row * plan.rows + (frames if plan.campaign.frames else 0.0)


def _exposures(plan: Plan) -> Iterator[str]:
    """The retinal exposure of every light at its brightest, over up to 100 poses."""
    worst: dict[str, RetinalExposure] = {}
    for group in plan.groups:
        case = max(group.cases, key=lambda c: c.scene.power.value)
        poses = [group.pose(int(i)) for i in _spread(len(group.positions), 100)]
        found = scene_exposure(case.scene, poses, case.scene.power.value)
        light = str(case.labels["illumination"])
        if light not in worst or found.irradiance > worst[light].irradiance:
            worst[light] = found
    for light, found in worst.items():
        yield from wrapped("exposure", f"{light}, brightest: {found.sentence}")


def _seconds(plan: Plan) -> float:
    """The work on one core [s], from the size of a few tiles and of the frames."""
    total = 0.0
    seen = set()
    for group in plan.groups:
        pixels = math.prod(group.scene.camera.shape)
        if group.scene_key not in seen:
            seen.add(group.scene_key)
            total += PACE.seconds_per_scene + _background(group.scene)
        poses = len(group.positions)
        spotlights = range(len(group.scene.spotlights))
        rays = [sum(tile_rays(group, group.pose(int(i)), k) for k in spotlights) for i in _spread(poses, 5)]
        traced, found = float(np.mean(rays)) / PACE.rays_per_second, group.rows * pixels * PACE.seconds_per_pixel
        total += poses * (traced + found + len(spotlights) * _glow(group) + _fits(group))
    return total


def _background(scene: Scene) -> float:
    """What a background takes [s]."""
    varied = scene.retina.is_spectral or scene.camera.pupil > 0.0
    samples = PACE.varied_background_rays if varied else PACE.background_rays
    each = 1.0 / PACE.rays_per_second
    each += PACE.spread_sample if scene.spread is not None else 0.0
    each += PACE.optics_sample if scene.camera.optics is not None else 0.0
    return samples * math.prod(scene.camera.shape) * each


def _glow(group: Group) -> float:
    """What the deep light of a tile takes [s]; that of its middle pose stands for all."""
    scene = group.scene
    if scene.spread is None:
        return 0.0
    if scene.camera.optics is not None:
        return math.prod(scene.camera.shape) * PACE.framed_pixel
    edge = scene.camera.project(scene.outline(group.pose(len(group.positions) // 2), 0, points=32))
    sides = np.ptp(edge, axis=0) + 2.0 * PACE.glow_margin / scene.camera.pixel_pitch
    return float(np.prod(np.minimum(sides, scene.camera.shape[::-1]))) * PACE.glow_pixel


def _fits(group: Group) -> float:
    """What the fits of a pose take beyond a localization by pixels alone [s], where an effect is in their model."""
    scene = group.scene
    effects = scene.camera.optics, scene.camera.lens, scene.motion, scene.beam.source_diameter, scene.spread is not None
    fits = sum(not name.startswith("paper") for case in group.cases for name in case.localizers)
    return PACE.fit * fits if any(effects) else 0.0


def _spread(count: int, most: int) -> NDArray[np.int_]:
    """Up to `most` numbers evenly spread over range(count)."""
    return np.unique(np.linspace(0, count - 1, most).astype(int))


def tile_rays(group: Group, pose: Pose, spotlight: int) -> float:
    """Samples traced for the rectangle that holds a spotlight's patch, and for its edge."""
    scene = group.scene
    edge = scene.camera.project(scene.outline(pose, spotlight, points=32))
    # through the eye's optics all that the pupil shows may lie within an outline that no ray meets
    edge = edge if np.isfinite(edge).all() else np.array([[0.0, 0.0], scene.camera.shape[::-1]])
    inside = np.clip(edge, 0.0, scene.camera.shape[::-1])
    rays = float(np.prod(np.ptp(inside, axis=0))) * group.samples
    if group.edge_samples > group.samples:
        rays += len(rim_pixels(scene, pose, spotlight)) * group.edge_samples
    return rays


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100.0 else f"{seconds / 60.0:.0f} min"
