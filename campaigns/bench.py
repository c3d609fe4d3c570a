"""The bench: where a unit of work is rendered, exposed and localized, in a worker of its own."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from campaigns.plan import Case, Group, Plan, Unit, frame_seed, tile_seed
from campaigns.row import Finding, Record
from campaigns.store import made_with
from localize import LocalizationFailure, locate
from localize.outcome import Outcome
from scene import Pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from render import Exposure, Renderer
    from scene.sensor import Sensor

#: loading scenes leaks memory in Mitsuba, so a worker that has loaded this many is replaced
MAX_SCENES = 64


class Bench:
    """Measures units of a plan on one thread; holds one scene at a time. Frames go to `frames` if that is a folder."""

    def __init__(self, plan: Plan, frames: Path | None) -> None:
        from render import kernel

        cv2.setNumThreads(1)
        kernel.use_threads(1)
        self._plan = plan
        self._frames = frames
        self._loaded: tuple[str, Renderer, Exposure] | None = None
        self._scenes = 0

    @property
    def worn(self) -> bool:
        """True when the process should make room for a fresh one."""
        return self._scenes >= MAX_SCENES

    def measure(self, unit: Unit) -> Record:
        """Render the unit's pose once, expose it at every power, localize every frame with every localizer."""
        group = self._plan.groups[unit.group]
        pose = group.pose(unit.pose)
        renderer, exposure = self._scene(group)
        background = renderer.background(pose)
        if group.scene.instrument.shaft is not None:
            from render import Exposure

            exposure = Exposure(background, exposure.sensor)
        tiles = [renderer.tile(pose, k, tile_seed(self._plan, unit, k)) for k in range(len(group.scene.spotlights))]
        findings = []
        for case in group.cases:
            image = exposure.frame(tiles, case.scene.power.value, frame_seed(self._plan, unit, case))
            for localizer in case.localizers:
                oracle = pose if localizer.endswith("-oracle") else None
                found = locate(image, case.scene, localizer, oracle=oracle)
                findings.append(_finding(case, localizer, found))
            if self._frames is not None:
                radiance = background.copy()
                for tile in tiles:
                    radiance[tile.crop.slices] += np.float32(case.scene.power.value) * tile.radiance
                self._keep(f"{case.key}-{unit.pose:05d}", case, pose, radiance, image)
        return Record(unit=unit.key, findings=tuple(findings))

    def _scene(self, group: Group) -> tuple[Renderer, Exposure]:
        if self._loaded is None or self._loaded[0] != group.scene_key:
            from render import Exposure, Renderer

            self._loaded = None  # the old scene goes before the new one comes
            renderer = Renderer(group.scene, samples=group.samples)
            exposure = Exposure(renderer.background(), group.scene.sensor)
            if exposure.meters_once:
                exposure = Exposure(renderer.background(), self._metered(group, renderer, exposure))
            self._loaded = group.scene_key, renderer, exposure
            self._scenes += 1
        return self._loaded[1:]

    def _metered(self, group: Group, renderer: Renderer, exposure: Exposure) -> Sensor:
        """The scene's sensor with the exposure time of the first pose at the brightest power.

        It is a function of the plan alone, so that every worker and every resumed run exposes alike.
        """
        alike = [i for i, g in enumerate(self._plan.groups) if g.scene_key == group.scene_key]
        first = self._plan.groups[alike[0]]
        unit = Unit(alike[0], 0, first.unit(0))
        tiles = [
            renderer.tile(first.pose(0), k, tile_seed(self._plan, unit, k)) for k in range(len(group.scene.spotlights))
        ]
        brightest = max(case.scene.power.value for i in alike for case in self._plan.groups[i].cases)
        return exposure.metered(tiles, brightest)

    def _keep(
        self, name: str, case: Case, pose: Pose, radiance: NDArray[np.float32], image: NDArray[np.uint8 | np.uint16]
    ) -> None:
        from render.frame_file import frame_header, write_frame, write_preview

        assert self._frames is not None
        header = frame_header(case.scene, pose, case.scene.power.value, made_with(self._plan))
        write_frame(self._frames / f"{name}.exr", radiance, header)
        write_preview(self._frames / f"{name}.png", image, case.scene.sensor.full_scale)


def _finding(case: Case, localizer: str, found: Outcome) -> Finding:
    if isinstance(found, LocalizationFailure):
        return Finding(case=case.key, localizer=localizer, reason=found.reason[:1000])
    covariance = None if found.covariance is None else tuple(map(tuple, found.covariance.tolist()))
    apex, axis = found.apex_mm.tolist(), found.axis.tolist()
    return Finding(case=case.key, localizer=localizer, apex=apex, axis=axis, covariance=covariance)
