"""What speaks against a frame itself, or against any one answer to it, whatever a fit says."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from conespot.localize.compression import compressed
from conespot.localize.halo import glowing, glows
from conespot.localize.image import Frame, Reference
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.view import outlines
from conespot.localize.outcome import COMPRESSED, GLOWS, OTHER_LIGHT, Localization, LocalizationFailure, Outcome
from conespot.localize.spot.start import spot_start
from conespot.localize.start.rings import Overview, find_rings
from conespot.localize.start.search import NOTHING, Start, believed, find_starts
from conespot.localize.start.settings import START
from conespot.localize.verdict import MISFIT, WRONG_BEAM, WRONG_WALL
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.sensor import Recorded

#: localizes from a start in a scene
Localizes = Callable[[Start, Scene], Outcome]


def answered(frame: Frame, scene: Scene, reference: Reference | None, knowns: Knowns, localized: Localizes) -> Outcome:
    """The one answer of a frame that may be believed, or what speaks against it, in words that say what was seen."""
    outcome = _believable(frame, scene, reference, knowns, localized)
    if isinstance(outcome, LocalizationFailure) and outcome.reason == NOTHING:
        ring = find_rings(Overview.of(frame, reference), scene, 1)[0]
        return LocalizationFailure(OTHER_LIGHT) if ring.votes > START.round else outcome
    return outcome


def _believable(
    frame: Frame, scene: Scene, reference: Reference | None, knowns: Knowns, localized: Localizes
) -> Outcome:
    """The one answer of a frame's starts that may be believed, or what speaks against the frame.

    A scene may say nothing of light from under the retina. Where the frame shows some, the scene is taken to have what
    is usual: the answer is then that scene's, or none, unless the `knowns` say that there is exactly none.
    """
    spot = spot_start(frame, scene, reference)
    if spot is not None:
        return _answered(frame, scene, (spot,), localized)[0]
    starts = find_starts(frame, scene, reference)
    lit = None if knowns.deep_amount_sigma == 0.0 else glowing(scene)
    if lit is None:
        return _answered(frame, scene, starts, localized)[0]

    def fades(pose: Pose | None) -> bool:
        return pose is not None and glows(frame, Estimate(pose, scene), reference)

    first = next(starts, None)
    every = () if first is None else itertools.chain([first], starts)
    if first is not None and not fades(first.pose):
        return _answered(frame, scene, every, localized)[0]
    found, there = _answered(frame, lit, find_starts(frame, lit, reference), localized)
    if isinstance(found, Localization) and fades(there):
        return found
    plain, pose = _answered(frame, scene, every, localized)
    # a start is not yet a patch
    return LocalizationFailure(GLOWS) if isinstance(plain, Localization) and fades(pose) else plain


def _answered(frame: Frame, scene: Scene, starts: Iterable[Start], localized: Localizes) -> tuple[Outcome, Pose | None]:
    """The same for a scene as it is, and where the patch is taken to be."""
    tried: list[Start] = []

    def followed(start: Start) -> Outcome:
        tried.append(start)
        return localized(start, scene)

    outcome = believed(starts, scene, followed)
    pose = tried[0].pose if tried else None
    if isinstance(outcome, Localization):
        pose = Pose(outcome.apex_mm, outcome.axis, outcome.roll or 0.0)
    elif outcome.reason not in (MISFIT, WRONG_BEAM, WRONG_WALL):
        return outcome, pose
    if pose is None or isinstance(scene.sensor, Recorded):
        return outcome, pose
    points = outlines(Estimate(pose, scene))
    if len(points) and compressed(frame.pixels, *_around(points, scene)):
        return LocalizationFailure(COMPRESSED), pose
    return outcome, pose


def noise_of(frame: Frame, told: NoiseModel | None) -> NoiseModel:
    """The noise `told`, or the sensor's with no more steps than the pixels have: fewer bits are rounded further."""
    own = frame.sensor.noise
    if told is not None or frame.steps is None or frame.steps >= own.levels:
        return told or own
    return replace(own, levels=frame.steps)


def _around(points: np.ndarray[tuple[int, int], np.dtype[np.float64]], scene: Scene) -> tuple[slice, slice]:
    """Rows and columns of the frame around outlines `[N, 2]` [px], with two blocks of a JPEG beside."""
    sides = np.array(scene.camera.shape[::-1])
    low = np.clip(np.floor(points.min(axis=0)) - 16, 0, sides).astype(int)
    high = np.clip(np.ceil(points.max(axis=0)) + 16, 0, sides).astype(int)
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))
