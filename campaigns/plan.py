"""The plan of a campaign: content-addressed cases, and the groups of them that share their renderings.

Light is linear in power, so a group is everything that differs in power or localizer alone: each of its poses is
rendered once, then exposed at every power and handed to every localizer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from conespot.campaigns.address import Addresses, at_one_watt, campaign_address, course_seed, places_address
from conespot.campaigns.knowledge import Knowledge
from conespot.campaigns.labels import label_columns, swept_columns
from conespot.campaigns.schema import Campaign, Combination, base, combinations, makes_frames
from conespot.results.columns import MAX_ROWS
from conespot.scene import InputError, Pose, Scene
from conespot.scene.document import Document
from conespot.scene.motion import exposure_of
from conespot.scene.trajectory import Waypoints


@dataclass(frozen=True)
class Case:
    """A combination of the campaign, and the localizers of all combinations that differ in those alone.

    Cases with the same `frame` look at the same images. `labels` are the columns of its rows that say what it is,
    `swept` those of other keys that are swept.
    """

    key: str
    frame: str
    campaign: Campaign
    localizers: tuple[str, ...]
    labels: dict[str, str | float]
    swept: dict[str, str | float]

    @property
    def scene(self) -> Scene:
        """The true scene, with its power."""
        return self.campaign.scene

    @property
    def knowledge(self) -> Knowledge:
        """What its localizers are told beside the image."""
        return self.campaign.knowledge


@dataclass(frozen=True)
class Group:
    """Cases that share every rendering. `scene` is theirs at 1 W, `positions` `[N, 3]` [mm] the tips of its poses.

    Where something moves, `times` `[N]` [s] are those of mid-exposure and `course` is the seed of a tremor.
    Groups with the same `scene_key` share what is loaded and the background.
    """

    key: str
    scene_key: str
    scene: Scene
    samples: int
    edge_samples: int
    positions: NDArray[np.float64]
    cases: tuple[Case, ...]
    times: NDArray[np.float64] | None = None
    course: int = 0

    def pose(self, index: int) -> Pose:
        """The pose of that number."""
        sway = None if self.times is None else self.scene.sway(float(self.times[index]), self.course)
        return Pose.through(self.positions[index], self.scene.instrument.rcm, sway)

    def unit(self, index: int) -> str:
        """The key of the unit of work that is that pose."""
        return f"{self.key}-{index}"

    @property
    def frames(self) -> int:
        """Images that one pose gives: cases that differ in knowledge share theirs."""
        return len({case.frame for case in self.cases})

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
        return sum(len(group.positions) * group.frames for group in self.groups)

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
    group = plan.groups[unit.group]
    return _seed(group.cases[0], group.key, unit.pose, spotlight)


def frame_seed(unit: Unit, case: Case) -> int:
    """The seed of the sensor's noise in a case's frame, the same for every localizer and whatever it knows."""
    return _seed(case, case.frame, unit.pose)


def reference_seed(unit: Unit, case: Case, number: int) -> int:
    """The seed of the noise in one of a case's frames without spotlights."""
    return _seed(case, case.frame, unit.pose, 1, number)


def told(unit: Unit, case: Case) -> Scene:
    """The scene as the case's localizers are told it at a unit's pose."""
    return case.knowledge.told(case.scene, np.random.default_rng([case.campaign.seed, int(case.frame, 16), unit.pose]))


def _seed(case: Case, key: str, *numbers: int) -> int:
    return int(np.random.SeedSequence([case.campaign.seed, int(key, 16), *numbers]).generate_state(1)[0])


@dataclass
class _Draft:
    """A case while combinations are still being found that are the same one."""

    combination: Combination
    addresses: Addresses
    localizers: list[str] = field(default_factory=list)


def make_plan(document: Document) -> Plan:
    """Validate every combination, with every pose inside its eye, and plan the work. Raises InputError."""
    campaign = base(document)
    drafts: dict[str, _Draft] = {}
    positions: dict[str, NDArray[np.float64]] = {}
    rows = 0
    for combination in combinations(document) if makes_frames(document) else ():
        case = combination.campaign
        addresses = Addresses.of(case)
        draft = drafts.setdefault(addresses.case, _Draft(combination, addresses))
        new = [name for name in case.localizers if name not in draft.localizers]
        draft.localizers += new
        rows += case.poses * len(new)
        if rows > MAX_ROWS:
            where = combination.document.place(["sweep"])
            raise InputError(f"{where}: more than {MAX_ROWS} rows; use fewer poses or sweep over less")
        if addresses.group not in positions:
            positions[addresses.group] = _positions(combination)
    found = [draft.combination for draft in drafts.values()]
    labels, swept = label_columns(found), swept_columns(found)
    cases: list[Case] = []
    members: dict[str, list[Case]] = {}
    for i, (key, draft) in enumerate(drafts.items()):
        columns = [{name: values[i] for name, values in table.items()} for table in (labels, swept)]
        cases.append(Case(key, draft.addresses.frame, draft.combination.campaign, tuple(draft.localizers), *columns))
        members.setdefault(draft.addresses.group, []).append(cases[-1])
    groups = []
    for key, shared in members.items():
        case = shared[0].campaign
        samples = case.samples, case.edge_samples
        # cases that look at the same image follow each other, so that it need not be exposed twice
        first = {c.frame: i for i, c in reversed(list(enumerate(shared)))}
        alike = tuple(sorted(shared, key=lambda c: first[c.frame]))
        loaded = drafts[shared[0].key].addresses.scene
        scene, times, course = at_one_watt(case.scene), _times(case), course_seed(case)
        groups.append(Group(key, loaded, scene, *samples, positions[key], alike, times, course))
    address = campaign_address(campaign, ((case.key, case.localizers) for case in cases))
    return Plan(campaign, tuple(cases), tuple(groups), address)


def _positions(combination: Combination) -> NDArray[np.float64]:
    """The tips `[N, 3]` [mm] of a case's poses, all inside the eye. Raises InputError."""
    case, place = combination.campaign, combination.document.place(["trajectory"])
    scene = case.scene
    # the same trajectory visits the same places in every scene, so that cases can be compared pose by pose
    key = int(places_address(case), 16)
    try:
        positions = case.trajectory.positions(case.poses, np.random.default_rng([case.seed, key]))
    except ValueError as error:
        raise InputError(f"{place}: {error}") from None
    depth = scene.depth(positions)
    to_rcm = np.linalg.norm(positions - np.asarray(scene.instrument.rcm), axis=-1)
    for i in np.flatnonzero(~((depth > 0.0) & (to_rcm > 0.0))):  # the others need no closer look
        try:
            scene.pose(positions[i])
        except ValueError as error:
            raise InputError(f"{place}: pose {i} of the {case.trajectory.kind}: {error}") from None
    _keep_inside(case, positions, depth, place)
    return positions


def _times(case: Campaign) -> NDArray[np.float64] | None:
    """When the poses of a case are at mid-exposure `[N]` [s]: as its trajectory says, or its motion; None if still."""
    if case.scene.motion is None:
        return None
    said = case.trajectory.times if isinstance(case.trajectory, Waypoints) else ()
    return np.array(said[: case.poses]) if said else case.scene.motion.times(case.poses)


def _keep_inside(case: Campaign, positions: NDArray[np.float64], depth: NDArray[np.float64], place: str) -> None:
    """Raises InputError, with the `place` of the trajectory, where a motion takes the tip out of the eye."""
    scene, times = case.scene, _times(case)
    if scene.motion is None or times is None:
        return
    near = depth <= scene.motion.reach(exposure_of(scene.motion, scene.sensor))
    for i in np.flatnonzero(near):
        sway = scene.sway(float(times[i]), course_seed(case))
        if sway is not None and not np.all(scene.depth(positions[i] + sway) > 0.0):
            raise InputError(
                f"{place}: pose {i} of the {case.trajectory.kind}: the tip moves into the eye's wall during the"
                " exposure; keep it further inside, or let scene.motion be less"
            )
