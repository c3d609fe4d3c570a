"""The plan of a campaign: content-addressed cases, and the groups of them that share their renderings.

Light is linear in power, so a group is everything that differs in power or localizer alone: each of its poses is
rendered once, then exposed at every power and handed to every localizer.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from campaigns.schema import Campaign, base, combinations, makes_frames, sweep_products
from scene import InputError, Pose, Scene
from scene.document import Document
from scene.model import identity
from scene.spotlights import rig_name
from scene.surface import surface_name

#: frames times localizers; no more than the results read back
MAX_ROWS = 1_000_000

#: swept keys that a column of every row already tells apart: the column and its short name
_LABELS: dict[str, tuple[str, Callable[[Campaign], str | float]]] = {
    "trajectory": ("trajectory", lambda c: c.trajectory.kind),
    "scene.spotlights": ("spotlights", lambda c: rig_name(c.scene.spotlights)),
    "scene.power.value": ("power_w", lambda c: c.scene.power.value),
    "scene.illumination": ("illumination", lambda c: c.scene.illumination.name),
    "scene.surface": ("surface", lambda c: surface_name(c.scene.surface)),
    "scene.sensor": ("sensor", lambda c: c.scene.sensor.kind),
    "scene.camera.resolution": ("resolution_px", lambda c: c.scene.camera.resolution),
}


@dataclass(frozen=True)
class Case:
    """A scene with its power, a trajectory and what localizes its frames.

    `labels` are the columns of its rows that say what it is, `swept` those of other keys that are swept.
    """

    key: str
    scene: Scene
    localizers: tuple[str, ...]
    labels: dict[str, str | float]
    swept: dict[str, str | float]


@dataclass(frozen=True)
class Group:
    """Cases that share every rendering. `scene` is theirs at 1 W, `positions` `[N, 3]` [mm] the tips of its poses.

    Groups with the same `scene_key` share what is loaded and the background.
    """

    key: str
    scene_key: str
    scene: Scene
    samples: int
    positions: NDArray[np.float64]
    cases: tuple[Case, ...]

    def pose(self, index: int) -> Pose:
        """The pose of that number."""
        return Pose.through(self.positions[index], self.scene.instrument.rcm)

    def unit(self, index: int) -> str:
        """The key of the unit of work that is that pose."""
        return f"{self.key}-{index}"

    @property
    def rows(self) -> int:
        """Rows that one pose gives."""
        return sum(len(case.localizers) for case in self.cases)

    @property
    def work(self) -> float:
        """What one pose costs, roughly, in renderings of a tile: an exposure with its localizations costs as much."""
        return len(self.scene.spotlights) + self.rows


@dataclass(frozen=True)
class Unit:
    """One pose of one group: rendered, exposed and localized together, and finished or not as a whole."""

    group: int
    pose: int
    key: str


@dataclass(frozen=True)
class Plan:
    """What a campaign will do. Two campaigns with the same `identity` give the same rows."""

    campaign: Campaign
    cases: tuple[Case, ...]
    groups: tuple[Group, ...]
    identity: str

    def units(self) -> Iterator[Unit]:
        """The units of work, in the order of the cases."""
        for g, group in enumerate(self.groups):
            for i in range(len(group.positions)):
                yield Unit(g, i, group.unit(i))

    def says(self, unit: Unit) -> str:
        """The unit in words."""
        labels = self.groups[unit.group].cases[0].labels
        return f"pose {unit.pose} of {labels['trajectory']}, {labels['spotlights']}, {labels['surface']}"

    @property
    def scenes(self) -> int:
        """How many scenes are loaded, and backgrounds rendered."""
        return len({group.scene_key for group in self.groups})

    @property
    def frames(self) -> int:
        """Images that are exposed."""
        return sum(len(group.positions) * len(group.cases) for group in self.groups)

    @property
    def tiles(self) -> int:
        """Radiance tiles that are rendered."""
        return sum(len(group.positions) * len(group.scene.spotlights) for group in self.groups)

    @property
    def rows(self) -> int:
        """Rows of errors: frames times localizers."""
        return sum(len(group.positions) * group.rows for group in self.groups)


def tile_seed(plan: Plan, unit: Unit, spotlight: int) -> int:
    """The Monte Carlo seed of a tile, from the campaign's seed and what is rendered alone."""
    return _seed(plan, plan.groups[unit.group].key, unit.pose, spotlight)


def frame_seed(plan: Plan, unit: Unit, case: Case) -> int:
    """The seed of the sensor's noise in a case's frame, the same for every localizer."""
    return _seed(plan, case.key, unit.pose)


def _seed(plan: Plan, key: str, *numbers: int) -> int:
    return int(np.random.SeedSequence([plan.campaign.seed, int(key, 16), *numbers]).generate_state(1)[0])


def make_plan(document: Document) -> Plan:
    """Validate every combination, with every pose inside its eye, and plan the work. Raises InputError."""
    campaign = base(document)
    found: dict[str, tuple[Document, Campaign]] = {}
    localizers: dict[str, list[str]] = {}
    groups: dict[str, tuple[Campaign, NDArray[np.float64], list[str]]] = {}
    rows = 0
    for combination, case in combinations(document) if makes_frames(document) else ():
        key = _address(case.scene, case.trajectory, case.poses, case.samples, case.seed)
        found.setdefault(key, (combination, case))
        new = [name for name in case.localizers if name not in localizers.setdefault(key, [])]
        localizers[key] += new
        rows += case.poses * len(new)
        if rows > MAX_ROWS:
            raise InputError(
                f"{combination.place(['sweep'])}: more than {MAX_ROWS} rows; use fewer poses or sweep less"
            )
        group = _address(_at_one_watt(case.scene), case.trajectory, case.poses, case.samples, case.seed)
        if group not in groups:
            groups[group] = (case, _positions(combination, case), [])
        if key not in groups[group][2]:
            groups[group][2].append(key)
    labels, swept = _labels(document, list(found.values())), _swept(document, list(found.values()))
    cases = {
        key: Case(
            key,
            case.scene,
            tuple(localizers[key]),
            {name: values[i] for name, values in labels.items()},
            {name: values[i] for name, values in swept.items()},
        )
        for i, (key, (_, case)) in enumerate(found.items())
    }
    parts = [campaign.theory, campaign.frames, sorted((k, sorted(c.localizers)) for k, c in cases.items())]
    return Plan(
        campaign,
        tuple(cases.values()),
        tuple(_group(key, *parts, cases) for key, parts in groups.items()),
        identity(json.dumps(parts)),
    )


def _group(
    key: str, case: Campaign, positions: NDArray[np.float64], members: list[str], cases: Mapping[str, Case]
) -> Group:
    scene = _at_one_watt(case.scene)
    shared = tuple(cases[k] for k in members)
    return Group(key, _address(scene, case.samples), scene, case.samples, positions, shared)


def _at_one_watt(scene: Scene) -> Scene:
    return scene.model_copy(update={"power": scene.power.model_copy(update={"value": 1.0})})


def _address(*parts: BaseModel | int) -> str:
    """A content address that does not change with the place of the files some values came from."""
    plain = [_unfiled(part.model_dump(mode="json")) if isinstance(part, BaseModel) else part for part in parts]
    return identity(json.dumps(plain, sort_keys=True))


def _unfiled(data: Any) -> Any:
    if isinstance(data, dict):
        return {k: _unfiled(v) for k, v in data.items() if not (k == "file" and data.get("points"))}
    return [_unfiled(item) for item in data] if isinstance(data, list) else data


def _positions(document: Document, case: Campaign) -> NDArray[np.float64]:
    """The tips `[N, 3]` [mm] of a case's poses, all inside the eye. Raises InputError."""
    scene, place = case.scene, document.place(["trajectory"])
    # the same trajectory visits the same places in every scene, so that cases can be compared pose by pose
    key = int(_address(case.trajectory, case.poses), 16)
    try:
        positions = case.trajectory.positions(case.poses, np.random.default_rng([case.seed, key]))
    except ValueError as error:
        raise InputError(f"{place}: {error}") from None
    depth = scene.eye.radius - scene.surface.relief - np.linalg.norm(positions - scene.eye.centre, axis=-1)
    to_rcm = np.linalg.norm(positions - np.asarray(scene.instrument.rcm), axis=-1)
    for i in np.flatnonzero(~((depth > 0.0) & (to_rcm > 0.0))):  # the others need no closer look
        try:
            scene.pose(positions[i])
        except ValueError as error:
            raise InputError(f"{place}: pose {i} of the {case.trajectory.kind}: {error}") from None
    return positions


def _labels(document: Document, found: Sequence[tuple[Document, Campaign]]) -> dict[str, Sequence[str | float]]:
    """The standing columns that say what a case is, one value a case.

    Where a swept key gives two cases the same short name (two helices), it is the value as the file writes it.
    """
    swept = {axis.key for axes in sweep_products(document) for axis in axes}
    columns: dict[str, Sequence[str | float]] = {}
    for key, (name, short) in _LABELS.items():
        names = [short(case) for _, case in found]
        values = [json.dumps(_unfiled(_dumped(case, key)), sort_keys=True) for _, case in found]
        clash = key in swept and len(set(zip(names, values, strict=True))) > len(set(names))
        columns[name] = [_written(d, c, key) for d, c in found] if clash else names
    return columns


def _swept(document: Document, found: Sequence[tuple[Document, Campaign]]) -> dict[str, Sequence[str | float]]:
    """A column for every swept key that no standing one tells: its path, within the scene if that leaves a dot."""
    columns: dict[str, Sequence[str | float]] = {}
    for axis in (axis for axes in sweep_products(document) for axis in axes):
        if axis.key not in _LABELS and axis.key != "localizers":
            inner = axis.key.removeprefix("scene.")
            values = [_written(d, c, axis.key) for d, c in found]
            numbers = all(isinstance(v, (int, float)) for v in values)
            columns[inner if "." in inner else axis.key] = values if numbers else [str(v) for v in values]
    return columns


def _dumped(case: Campaign, key: str) -> Any:
    data: Any = case.model_dump(mode="json")
    for part in key.split("."):
        data = data.get(part) if isinstance(data, dict) else None
    return data


def _written(document: Document, case: Campaign, key: str) -> str | float:
    """The value of a key as the file writes it, or as it would be written where the file leaves it out."""
    value: Any = document.data
    for part in key.split("."):
        value = value.get(part) if isinstance(value, dict) else None
    value = _dumped(case, key) if value is None else value
    if isinstance(value, dict) and len(value) == 1:
        value = next(iter(value.values()))  # `scene: {preset: paper}` was written as a word
    if isinstance(value, str) or (isinstance(value, (int, float)) and not isinstance(value, bool)):
        return value
    text = json.dumps(value).replace('"', "")
    return text if len(text) <= 120 else f"{text[:100]}... {identity(text)}"
