"""The bench: where a unit of work is rendered, exposed and localized, in a worker of its own."""

from __future__ import annotations

import itertools
import math
from collections.abc import Container, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from conespot.campaigns.maker import made_with, maker
from conespot.campaigns.plan import Case, Group, Plan, Unit, frame_seed, reference_seed, tile_seed, told
from conespot.campaigns.row import FARTHEST, Finding, Record, Ways
from conespot.localize import Localization, LocalizationFailure, find_localizer, locate
from conespot.localize.image import AnyImage, Reference
from conespot.localize.outcome import Outcome
from conespot.scene import Pose

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from conespot.render import Exposure, Renderer, Tile
    from conespot.scene.sensor import Sensor

#: loading scenes leaks memory in Mitsuba, so a worker that has loaded this many is replaced
MAX_SCENES = 64


class Bench:
    """Measures units of a plan on one thread; holds one scene at a time. Frames go to `frames` if that is a folder."""

    def __init__(self, plan: Plan, frames: Path | None) -> None:
        from conespot.render import kernel

        cv2.setNumThreads(1)
        kernel.use_threads(1)
        self._by = maker(kernel.load()[2])
        self.variant = kernel.load()[2].variant
        self._plan = plan
        self._frames = frames
        self._loaded: tuple[str, Renderer, Exposure] | None = None
        self._scenes = 0
        self._learnt: tuple[str, Reference | None] | None = None

    @property
    def worn(self) -> bool:
        """True when the process should make room for a fresh one."""
        return self._scenes >= MAX_SCENES

    def measure(self, unit: Unit) -> Record:
        """Render the unit's pose once, expose it at every power, localize every frame with every localizer."""
        findings = [
            found for case, image, unlit in self.given(unit) for found in self.findings(unit, case, image, unlit)
        ]
        return Record(unit=unit.key, by=self._by, findings=tuple(findings))

    def given(
        self, unit: Unit, only: Container[str] | None = None
    ) -> Iterator[tuple[Case, AnyImage, Reference | None]]:
        """Of every case of a unit, what its localizers are given: the image, gone when the next case comes, and unlit.

        The pose is rendered once, and exposed at every power; with `only`, at those of the cases of these keys, and no
        frame is kept.
        """
        group = self._plan.groups[unit.group]
        pose = group.pose(unit.pose)
        exposure, background = self._exposure(group, pose)
        tiles = self._tiles(self._scene(group)[0], unit)
        wanted = [case for case in group.cases if only is None or case.key in only]
        for _, alike in itertools.groupby(wanted, key=lambda case: case.frame):
            cases = list(alike)
            power = cases[0].scene.power.value
            with exposure.shown(tiles, power, frame_seed(unit, cases[0])) as image:
                for case in cases:
                    yield case, image, self._unlit(unit, case, exposure, tiles)
                if self._frames is not None and only is None:
                    radiance = background.copy()
                    for tile in tiles:
                        radiance[tile.crop.slices] += np.float32(power) * tile.radiance
                    self._keep(f"{cases[0].frame}-{unit.pose:05d}", cases[0], pose, radiance, image)

    def look(self, unit: Unit, case: Case) -> tuple[AnyImage, dict[str, Outcome]]:
        """One case's frame of a unit, and what each of its localizers answers: what `measure` makes its findings of."""
        image, exposure, tiles = self._shown(unit, case)
        unlit = self._unlit(unit, case, exposure, tiles)
        return image, {name: self.located(unit, case, image, name, unlit) for name in case.localizers}

    def frame(self, unit: Unit, case: Case) -> AnyImage:
        """One case's frame of a unit."""
        return self._shown(unit, case)[0]

    def _shown(self, unit: Unit, case: Case) -> tuple[AnyImage, Exposure, list[Tile]]:
        """A case's frame, what exposed it, and the tiles in it."""
        group = self._plan.groups[unit.group]
        exposure, _ = self._exposure(group, group.pose(unit.pose))
        tiles = self._tiles(self._scene(group)[0], unit)
        return exposure.frame(tiles, case.scene.power.value, frame_seed(unit, case)), exposure, tiles

    def _exposure(self, group: Group, pose: Pose) -> tuple[Exposure, NDArray[np.float32]]:
        """What exposes a pose's frames, and the background: a shaft lies over it."""
        renderer, exposure = self._scene(group)
        background = renderer.background(pose)
        if group.scene.instrument.shaft is not None:
            from conespot.render import Exposure

            exposure = Exposure(background, exposure.sensor)
        return exposure, background

    def findings(self, unit: Unit, case: Case, image: AnyImage, unlit: Reference | None) -> list[Finding]:
        """What the case's localizers find in a frame."""
        bound = self._bound(case, self._plan.groups[unit.group].pose(unit.pose))
        found = []
        for localizer in case.localizers:
            outcome = self.located(unit, case, image, localizer, unlit)
            found.append(
                finding(case, localizer, outcome, bound if find_localizer(localizer).takes_knowledge else None)
            )
        return found

    def located(self, unit: Unit, case: Case, image: AnyImage, localizer: str, unlit: Reference | None) -> Outcome:
        """What a localizer answers with what the case lets it know."""
        entry = find_localizer(localizer)
        oracle = self._plan.groups[unit.group].pose(unit.pose) if entry.needs_truth else None
        knowns, reference = (case.knowledge.knowns, unlit) if entry.takes_knowledge else (None, None)
        scene = told(unit, case)
        return locate(image, scene, localizer, oracle=oracle, knowns=knowns, reference=reference)

    def _bound(self, case: Case, pose: Pose) -> float | None:
        """The root mean square error of the tip [mm] that no estimator with the case's knowledge beats."""
        if not self._plan.campaign.bounds:
            return None
        from conespot.localize.theory.assessment import electrons_of
        from conespot.localize.theory.bounds import cramer_rao

        try:
            return cramer_rao(case.scene, pose, electrons_of(case.scene), case.knowledge.knowns).position_mm
        except ValueError:
            return None

    def _unlit(self, unit: Unit, case: Case, exposure: Exposure, tiles: Sequence[Tile]) -> Reference | None:
        """The view without spotlights that the case's localizers are given: taken beside the frame, or learnt."""
        knowledge, power = case.knowledge, case.scene.power.value
        if knowledge.reference:
            seeds = [reference_seed(unit, case, i) for i in range(knowledge.reference)]
            return Reference.mean((exposure.dark(tiles, power, seed) for seed in seeds), case.scene)
        if not knowledge.sequence:
            return None
        key = f"{case.frame}-{knowledge.sequence}"
        if self._learnt is None or self._learnt[0] != key:
            self._learnt = key, self._learn(unit, case, exposure)
        return self._learnt[1]

    def _learn(self, unit: Unit, case: Case, exposure: Exposure) -> Reference | None:
        """What frames of the trajectory show outside their own patches, found without the truth."""
        from conespot.localize.sequence import AmbientMap

        group = self._plan.groups[unit.group]
        renderer = self._scene(group)[0]
        ambient = AmbientMap(case.scene)
        count = min(case.knowledge.sequence, len(group.positions))
        for pose in np.linspace(0, len(group.positions) - 1, count).astype(int):
            other = Unit(unit.group, int(pose), group.unit(int(pose)))
            tiles = self._tiles(renderer, other)
            ambient.add(exposure.frame(tiles, case.scene.power.value, frame_seed(other, case)))
        return ambient.reference()

    def _tiles(self, renderer: Renderer, unit: Unit) -> list[Tile]:
        """What all spotlights send back at 1 W: added up once for all powers, so one tile, or none."""
        from conespot.render import merged

        group = self._plan.groups[unit.group]
        pose = group.pose(unit.pose)
        seeds = [tile_seed(self._plan, unit, k) for k in range(len(group.scene.spotlights))]
        tiles = [renderer.tile(pose, k, seed) for k, seed in enumerate(seeds)]
        lit = [tile for tile in tiles if tile.radiance.size]
        return [merged(lit)] if lit else []

    def _scene(self, group: Group) -> tuple[Renderer, Exposure]:
        if self._loaded is None or self._loaded[0] != group.scene_key:
            from conespot.render import Exposure, Renderer

            # the old scene goes before the new one comes, but for its background, which may be the new one's too
            held = self._loaded and self._loaded[1].background()
            self._loaded = None
            renderer = Renderer(group.scene, samples=group.samples, edge_samples=group.edge_samples)
            exposure = Exposure(renderer.background(), group.scene.sensor)
            del held
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
        tiles = self._tiles(renderer, unit)
        brightest = max(case.scene.power.value for i in alike for case in self._plan.groups[i].cases)
        return exposure.metered(tiles, brightest)

    def _keep(
        self, name: str, case: Case, pose: Pose, radiance: NDArray[np.float32], image: NDArray[np.uint8 | np.uint16]
    ) -> None:
        from conespot.render.frame_file import frame_header, write_frame, write_preview

        assert self._frames is not None
        header = frame_header(case.scene, pose, case.scene.power.value, made_with(self._plan))
        write_frame(self._frames / f"{name}.exr", radiance, header)
        write_preview(self._frames / f"{name}.png", image, case.scene.sensor.full_scale)


def finding(case: Case, localizer: str, found: Outcome, bound: float | None) -> Finding:
    """An answer as a run keeps it."""
    if isinstance(found, LocalizationFailure):
        return Finding(case=case.key, localizer=localizer, reason=found.reason[:1000], bound=bound)
    if np.max(np.abs(found.apex_mm)) > FARTHEST:
        return Finding(case=case.key, localizer=localizer, reason="the tip is out of this world", bound=bound)
    ways, sigmas = _distances(found)
    return Finding(
        case=case.key,
        localizer=localizer,
        distance=ways,
        distance_sigma=sigmas,
        distance_source=0.0 if found.distance is None else found.distance.source_mm,
        apex=found.apex_mm.tolist(),
        axis=found.axis.tolist(),
        roll=found.roll,
        covariance=None if found.covariance is None else tuple(map(tuple, found.covariance.tolist())),
        bound=bound,
    )


def _distances(found: Localization) -> tuple[Ways | None, Ways | None]:
    """From the wall's nearest point and along the axis, and their standard deviations; None where there are none."""
    away = found.distance
    if away is None or not math.isfinite(away.along_mm):
        return None, None
    if away.sigma_nearest_mm is None or away.sigma_along_mm is None:
        return (away.nearest_mm, away.along_mm), None
    return (away.nearest_mm, away.along_mm), (away.sigma_nearest_mm, away.sigma_along_mm)
