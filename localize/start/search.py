"""A robust start: round regions of light, each explained by the cones through the RCM, in the order of how well.

What the retina reflects multiplies all light, so its vessels and its disc are steps of the log light whatever falls on
them. Gradients of the log light of natural images follow Laplace's distribution (J. Huang, D. Mumford, Statistics of
natural images and models, CVPR 1999), which makes the sum of their absolute values the log-likelihood of an albedo:
the right cones are those without whose light this sum is least.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.image import Frame, Reference
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import moved
from conespot.localize.model.outline import distances
from conespot.localize.model.prior import on_rcm
from conespot.localize.model.residual import spread
from conespot.localize.outcome import Localization, LocalizationFailure, Outcome
from conespot.localize.start.rays import rays_across, support
from conespot.localize.start.rig import poses_on
from conespot.localize.start.rings import Overview, Ring, find_rings, find_spots
from conespot.localize.start.settings import START
from conespot.scene.pose import Pose, tangents
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
NOTHING = "no spotlight stands out from its surroundings"
ELSEWHERE = "the light is not where the fit puts the patch"
TWO_PLACES = "two places in the frame look like the patch"


@dataclass(frozen=True)
class Start:
    """A first pose through the RCM."""

    pose: Pose
    explained: float  #: share of the log light's gradients across the outlines that the cones explain, 0 to 1
    clearest: float  #: share that a quarter of the rays across the outlines exceed
    evidence: float  #: their sum along a ray, what it adds to the log-likelihood
    grain: float = 0.0  #: pixel of what was looked at, below which nothing is said of where outlines are [px]

    @property
    def stands_out(self) -> bool:
        """Whether it may be a spotlight's light at all."""
        return self.clearest > START.clear and self.explained > START.least_share and self.evidence > START.faintest

    def near(self, pose: Pose, scene: Scene, share: float, seen: Scene | None = None) -> bool:
        """Whether the outlines of `pose` are within a `share` of their radius, or a grain, of where the start is.

        The pose may be of a scene of its own, `seen` through another camera.
        """
        return all(
            float(np.linalg.norm(mine[0] - other[0])) + abs(mine[1] - other[1]) < max(share * mine[1], self.grain)
            for mine, other in zip(_circles(self.pose, scene), _circles(pose, seen or scene), strict=True)
        )

    def touches(self, other: Start, scene: Scene) -> bool:
        """Whether a patch of this start touches one of another's."""
        return any(
            float(np.linalg.norm(mine[0] - its[0])) < mine[1] + its[1]
            for mine in _circles(self.pose, scene)
            for its in _circles(other.pose, scene)
        )


def _circles(pose: Pose, scene: Scene) -> list[tuple[Array, float]]:
    """Middle `[2]` and mean radius of each outline [px]."""
    outlines = (scene.camera.project(scene.outline(pose, k, 24)) for k in range(len(scene.spotlights)))
    middles = ((outline, outline.mean(axis=0)) for outline in outlines)
    return [(middle, float(np.mean(np.linalg.norm(outline - middle, axis=1)))) for outline, middle in middles]


def find_start(frame: Frame, scene: Scene, reference: Reference | None = None) -> Start | LocalizationFailure:
    """The best first pose from a frame, or the reason why there is none."""
    return next(find_starts(frame, scene, reference), LocalizationFailure(NOTHING))


def find_starts(frame: Frame, scene: Scene, reference: Reference | None = None) -> Iterator[Start]:
    """Distinct first poses from a frame, the one that explains it best first."""
    overview = Overview.of(frame, reference)
    several = len(scene.spotlights) > 1
    most = START.most_rings + several * START.rings_per_spotlight * len(scene.spotlights)
    rings = find_rings(overview, scene, most)
    first = rings if several else [ring for ring in rings if _rivals(ring, rings[0])]
    found = _settled(overview, scene, first, [])
    if not found or found[0].explained <= START.convincing:
        # a patch that touches something brighter: what was found is taken out of the vote
        hidden = [rings[0].curve(), *(_outlines(start.pose, scene) for start in found[:1])]
        more = [ring for curve in hidden for ring in find_rings(overview, scene, most, [curve])]
        more += find_rings(overview, scene, most, small=True)
        found = _settled(overview, scene, [*rings, *more], found, thorough=True)
    if found:
        found = _merged([*found, *_turned(overview, scene, found[0])])
    given = []
    for start in found[: START.most_starts]:
        unsure = START.touching if start.touches(found[0], scene) else START.apart
        share = START.as_good if found[0].explained > START.convincing else unsure
        if start.evidence >= share * found[0].evidence and start.stands_out:
            given.append(start)
            yield start
    if several:
        return
    if given:
        yield from _instruments(overview, scene, rings, given)
    else:
        yield from _near_the_wall(Overview.of(frame, reference, whole=True), scene)


def _near_the_wall(whole: Overview, scene: Scene) -> Iterator[Start]:
    """The start on the one spot that is too small for rings: the patch of a tip close to the wall."""
    spots = find_spots(whole, scene, 2)
    if (
        not spots
        or spots[0].votes < START.spot
        or any(other.votes > START.only * spots[0].votes for other in spots[1:])
    ):
        return
    for pose in poses_on(spots[:1], scene):
        seen = rays_across(whole, scene, pose, thorough=True)
        if seen:
            # a ring of a few pixels is as good as its rays
            yield Start(pose, *support(seen), grain=max(1.0, (START.spot_ratio - 1.0) * spots[0].radius))


def _instruments(overview: Overview, scene: Scene, rings: Sequence[Ring], given: Sequence[Start]) -> Iterator[Start]:
    """Starts on rings elsewhere, convincing by themselves and not faint as a disc: another instrument's spotlight."""
    taken = [circle for start in given for circle in _circles(start.pose, scene)]
    for ring in rings:
        if any(float(np.linalg.norm(ring.centre - middle)) < max(ring.radius, radius) for middle, radius in taken):
            continue
        for pose in poses_on([ring], scene):
            seen = rays_across(overview, scene, pose)
            if not seen or support(seen)[1] < START.elsewhere:
                continue
            start = _settle(overview, scene, pose, thorough=False)
            if start is None or not start.stands_out or start.explained <= START.convincing:
                continue
            bright = start.evidence >= START.touching * given[0].evidence
            if bright and all(_differ(start.pose, other.pose) for other in given):
                yield start
                return


def believed(starts: Iterable[Start], scene: Scene, localized: Callable[[Start], Outcome]) -> Outcome:
    """The one outcome of the starts that is not refused; if all are, the first refusal."""
    refusal: LocalizationFailure | None = None
    found: tuple[Start, Localization] | None = None
    for start in starts:
        outcome = localized(start)
        if isinstance(outcome, Localization):
            pose = Pose(outcome.apex_mm, outcome.axis, outcome.roll or 0.0)
            if start.near(pose, scene, START.near, outcome.seen_in(scene)):
                if found is None:
                    found = start, outcome
                elif _contradict(found, (start, outcome), scene):
                    return LocalizationFailure(TWO_PLACES)
                continue
            outcome = LocalizationFailure(ELSEWHERE)
        if found is None and refusal is None and start.explained > START.convincing:
            return outcome
        refusal = outcome if refusal is None else refusal
    if found is not None:
        return found[1]
    return LocalizationFailure(NOTHING) if refusal is None else refusal


def _contradict(best: tuple[Start, Localization], other: tuple[Start, Localization], scene: Scene) -> bool:
    """Whether two answers may both be right and are not the same.

    A rig turned into its neighbours' places fits them too, but badly: its residuals leave the tip far less sure, or
    make what the edges' bins show far less likely.
    """
    if float(np.linalg.norm(best[1].apex_mm - other[1].apex_mm)) <= START.apart_mm:
        return False
    if len(scene.spotlights) == 1 or not other[0].touches(best[0], scene):
        return True
    likely, unlikely = best[1].likelihood, other[1].likelihood
    if likely is not None and unlikely is not None and unlikely < likely - START.less_likely:
        return False
    sure, unsure = (math.sqrt(float(np.trace(np.asarray(found.covariance)[:3, :3]))) for _, found in (best, other))
    return unsure <= START.less_sure * sure


def _rivals(ring: Ring, best: Ring) -> bool:
    """Whether a ring may be the patch as well as the best one, and is not the same once more."""
    apart = float(np.linalg.norm(ring.centre - best.centre))
    elsewhere = apart > START.rival_distance * max(ring.radius, best.radius)
    return ring is best or (ring.votes > START.rival_votes * best.votes and elsewhere)


def _outlines(pose: Pose, scene: Scene) -> Array:
    return np.concatenate([scene.camera.project(scene.outline(pose, k, 96)) for k in range(len(scene.spotlights))])


def _settled(
    overview: Overview, scene: Scene, rings: Sequence[Ring], before: Sequence[Start], *, thorough: bool = False
) -> list[Start]:
    """The poses that rings lead to, and those found before, without repetition, the best first."""
    found = list(before)
    for pose in poses_on(rings, scene):
        # another ring on the outline of a start that is all but convincing leads there again
        if any(start.explained > START.solid and start.near(pose, scene, START.same) for start in found):
            continue
        start = _settle(overview, scene, pose, thorough=thorough)
        if start is not None:
            found.append(start)
    return _merged(found)


def _turned(overview: Overview, scene: Scene, best: Start) -> Iterator[Start]:
    """The starts with each spotlight in the next one's place, and so on: a rig may nearly repeat when it turns.

    Turned by half as much, all patches but one may still fall on one another.
    """
    parts = len(scene.spotlights) * (1 if best.explained > START.convincing else 2)
    for k in range(1, parts if len(scene.spotlights) > 1 else 1):
        pose = Pose(best.pose.apex, best.pose.axis, best.pose.roll + 2.0 * math.pi * k / parts)
        start = _settle(overview, scene, pose, thorough=False)
        if start is not None:
            yield start


def _merged(found: Sequence[Start]) -> list[Start]:
    """The starts without repetition, the best first."""
    distinct: list[Start] = []
    for start in sorted(found, key=lambda s: -s.evidence):
        if all(_differ(start.pose, other.pose) for other in distinct):
            distinct.append(start)
    return distinct


def _differ(a: Pose, b: Pose) -> bool:
    turned = abs(math.remainder(a.roll - b.roll, 2.0 * math.pi))
    return float(np.linalg.norm(a.apex - b.apex)) > START.apart_mm or turned > START.apart_rad


def _settle(overview: Overview, scene: Scene, pose: Pose, *, thorough: bool) -> Start | None:
    """The pose near `pose` whose outlines the rays see; None where there is none."""
    estimate = Estimate(pose, scene)
    for turn in range(START.turns + 1):
        seen = rays_across(overview, scene, estimate.pose, thorough=thorough)
        if not seen:
            return None
        if turn == START.turns:
            break
        points, worth = (np.concatenate(parts) for parts in zip(*(rays.found() for rays in seen), strict=True))
        spots = np.concatenate([np.full(len(r.total), r.spotlight, np.intp) for r in seen])
        sizes = np.concatenate([np.linalg.norm(r.ends - r.middle, axis=1) for r in seen])
        keep = worth > START.ray_worth
        moved_to = _towards(estimate, points[keep], spots[keep], worth[keep], sizes[keep])
        if moved_to is None:
            return None
        shift = float(np.linalg.norm(moved_to.pose.apex - estimate.pose.apex))
        if shift < START.still_mm and abs(moved_to.pose.roll - estimate.pose.roll) < START.still_rad:
            break
        estimate = moved_to
    # a spotlight of which the frame shows nothing where it should be denies the whole pose
    lit = min(support([rays])[0] for rays in seen) > START.dark
    return Start(estimate.pose, *support(seen), grain=overview.step) if lit else None


def _towards(estimate: Estimate, pixels: Array, spots: NDArray[np.intp], worth: Array, sizes: Array) -> Estimate | None:
    """One step of Gauss and Newton towards outlines through `pixels` `[N, 2]` [px], with the axis on the RCM."""
    if len(pixels) < START.fewest_points:
        return None
    scene, pose = estimate.scene, estimate.pose
    roll = len(scene.spotlights) > 1
    r, jacobian, _ = distances(pixels, spots, estimate)
    # a ray may see its edge in pixels that look at the iris
    seen = np.isfinite(r)
    if np.count_nonzero(seen) < START.fewest_points:
        return None
    r, jacobian, worth, sizes = r[seen], jacobian[seen], worth[seen], sizes[seen]
    rcm = np.asarray(scene.instrument.rcm)
    tied = np.ascontiguousarray(on_rcm(jacobian.T, pose, scene).T)
    if roll:
        tied = np.column_stack([tied, jacobian[:, 5]])
    scale = np.maximum(START.outline_error * sizes, spread(r))
    weighted = tied * (worth / (4.0 + np.square(r / scale)) / scale**2)[:, None]
    try:
        step = -np.linalg.solve(weighted.T @ tied, weighted.T @ r)
    except np.linalg.LinAlgError:
        return None
    reach = START.longest_step * float(scene.eye.intersect(pose.apex, pose.axis))
    step *= min(1.0, reach / max(1e-9, float(np.linalg.norm(step[:3]))))
    tip = pose.apex + step[:3]
    if not np.all(np.isfinite(step)) or scene.depth(tip) <= 0.0:
        return None
    through = Pose.through(tip, rcm)
    if not roll:
        return Estimate(through, scene)
    length = float(np.linalg.norm(pose.apex - rcm))
    turned = moved(pose, np.array([*step[:3], *(unit @ step[:3] / length for unit in tangents(pose.axis)), step[3]]))
    return Estimate(Pose(tip, through.axis, turned.roll), scene)
