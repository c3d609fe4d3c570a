"""What a plan would do, in words: cases, frames, renderings, power in both conventions, and the work."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.campaigns.plan import Case, Group, Plan
from conespot.render.rim import rim_pixels
from conespot.scene import Pose
from conespot.scene.exposure_limits import RetinalExposure, scene_exposure

_MOST_CASES = 60


@dataclass(frozen=True)
class Pace:
    """What one core does, as `python benchmarks/pace.py` measures it: good enough to tell minutes from hours."""

    rays_per_second: float = 83e6  #: samples traced
    seconds_per_pixel: float = 0.73e-9  #: to expose a frame and localize it once
    seconds_per_scene: float = 1.7  #: to load a scene and compile its kernels
    background_rays: float = 4.0  #: samples a pixel of the view without spotlights, as `render.renderer` takes them


PACE = Pace()


def describe(plan: Plan, workers: int) -> Iterator[str]:
    """Lines that say what a run of the plan does with that many workers."""
    campaign = plan.campaign
    yield f"{campaign.name}: {campaign.description}".rstrip(": ")
    if campaign.theory:
        yield f"theory: {', '.join(campaign.theory)}"
    if not plan.cases:
        return
    yield f"{len(plan.cases)} cases, {plan.frames} frames, {plan.rows} localizations (one row each)"
    for case in plan.cases[:_MOST_CASES]:
        labels = {k: v for k, v in case.labels.items() if k not in ("power_w", "resolution_px")} | case.swept
        words = " ".join(f"{v}" if k in case.labels else f"{k}={v}" for k, v in labels.items())
        px = case.scene.camera.size_words
        yield f"  {case.key}  {words} {px}, {_both(case)}, {', '.join(case.localizers)}"
    if len(plan.cases) > _MOST_CASES:
        yield f"  ... and {len(plan.cases) - _MOST_CASES} more"
    yield (
        f"{plan.tiles} tiles and {plan.scenes} backgrounds are rendered; powers, knowledge and localizers share them "
        f"({len(plan.groups)} groups of cases)"
    )
    yield f"about {_duration(_seconds(plan) / workers)} on {workers} workers (on cores like those it was tuned on)"
    yield from _exposures(plan)
    if campaign.frames:
        size = sum(len(g.positions) * g.frames * 4.0 * math.prod(g.scene.camera.shape) for g in plan.groups)
        yield f"frames take up to {size / 1e9:.1f} GB on the disk"


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
        yield f"{light}, brightest: {found.sentence}"


def _both(case: Case) -> str:
    """The power of one spotlight in both conventions."""
    both = case.scene.power.both(case.scene.beam)
    return f"{both.isotropic_w:.4g} W isotropic = {1e3 * both.flux_w:.4g} mW flux"


def _seconds(plan: Plan) -> float:
    """The work on one core [s], from the size of a few tiles and of the frames."""
    total = 0.0
    seen = set()
    for group in plan.groups:
        pixels = math.prod(group.scene.camera.shape)
        if group.scene_key not in seen:
            seen.add(group.scene_key)
            total += PACE.seconds_per_scene + PACE.background_rays * pixels / PACE.rays_per_second
        poses = len(group.positions)
        spotlights = range(len(group.scene.spotlights))
        rays = [sum(tile_rays(group, group.pose(int(i)), k) for k in spotlights) for i in _spread(poses, 5)]
        traced, found = float(np.mean(rays)) / PACE.rays_per_second, group.rows * pixels * PACE.seconds_per_pixel
        total += poses * (traced + found)
    return total


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
