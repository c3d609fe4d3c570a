"""What speaks against a frame itself, or against any one answer to it, whatever a fit says."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import replace

import cv2
import numpy as np

from conespot.localize.compression import compressed
from conespot.localize.decoding import DECODING, decoded_amiss
from conespot.localize.halo import glowing, glows
from conespot.localize.image import Frame, Reference
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.view import outline, outlines
from conespot.localize.outcome import (
    COMPRESSED,
    GLOWS,
    OTHER_LIGHT,
    OUTSHONE,
    Localization,
    LocalizationFailure,
    Outcome,
)
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
#: refusals of what the light of a patch looks like: what spoils all of a frame's values explains them better
_OF_LIGHT = (MISFIT, WRONG_BEAM, WRONG_WALL, GLOWS)
#: how far around a patch light may be its own, over its radius, and by what factor other light is far brighter: a
#: disc's albedo is a few times that of what surrounds it
_BESIDE = 1.5
_FAR_BRIGHTER = 8.0
#: two blocks of a JPEG [px]
_BLOCKS = 16.0


def answered(
    frame: Frame,
    scene: Scene,
    reference: Reference | None,
    knowns: Knowns,
    noise: NoiseModel,
    localized: Localizes,
) -> Outcome:
    """The one answer of a frame that may be believed, or what speaks against it, in words that say what was seen."""
    outcome, pose = _believable(frame, scene, reference, knowns, localized)
    if isinstance(outcome, LocalizationFailure) and outcome.reason == NOTHING:
        ring = find_rings(Overview.of(frame, reference), scene, 1)[0]
        return LocalizationFailure(OTHER_LIGHT) if ring.votes > START.round else outcome
    if pose is None or (isinstance(outcome, LocalizationFailure) and outcome.reason not in _OF_LIGHT):
        return outcome
    if isinstance(outcome, Localization) and _outshone(frame, Estimate(pose, outcome.seen_in(scene)), reference):
        return LocalizationFailure(OUTSHONE)
    against = _against(frame, Estimate(pose, scene), noise)
    return outcome if against is None else LocalizationFailure(against)


def _believable(
    frame: Frame, scene: Scene, reference: Reference | None, knowns: Knowns, localized: Localizes
) -> tuple[Outcome, Pose | None]:
    """The one answer of a frame's starts that may be believed, or why there is none; and where the patch should be.

    A scene may say nothing of light from under the retina. Where the frame shows some, the scene is taken to have what
    is usual: the answer is then that scene's, or none, unless the `knowns` say that there is exactly none.
    """
    spot = spot_start(frame, scene, reference)
    if spot is not None:
        return _answered(scene, (spot,), localized)
    starts = find_starts(frame, scene, reference)
    lit = None if knowns.deep_amount_sigma == 0.0 else glowing(scene)
    if lit is None:
        return _answered(scene, starts, localized)

    def fades(pose: Pose | None) -> bool:
        return pose is not None and glows(frame, Estimate(pose, scene), reference)

    first = next(starts, None)
    every = () if first is None else itertools.chain([first], starts)
    if first is not None and not fades(first.pose):
        return _answered(scene, every, localized)
    found, there = _answered(lit, find_starts(frame, lit, reference), localized)
    if isinstance(found, Localization) and fades(there):
        return found, there
    plain, pose = _answered(scene, every, localized)
    # a start is not yet a patch
    return (LocalizationFailure(GLOWS) if isinstance(plain, Localization) and fades(pose) else plain), pose


def _answered(scene: Scene, starts: Iterable[Start], localized: Localizes) -> tuple[Outcome, Pose | None]:
    """The same for a scene as it is."""
    tried: list[Start] = []

    def followed(start: Start) -> Outcome:
        tried.append(start)
        return localized(start, scene)

    outcome = believed(starts, scene, followed)
    if isinstance(outcome, Localization):
        return outcome, Pose(outcome.apex_mm, outcome.axis, outcome.roll or 0.0)
    return outcome, tried[0].pose if tried else None


def _outshone(frame: Frame, found: Estimate, reference: Reference | None) -> bool:
    """Whether a place as wide as half a patch, beside all of them, is far brighter than the brightest patch.

    A retina's disc in ambient light passes for a hard patch with a wide blur, where the spotlight itself was refused.
    """
    overview = Overview.of(frame, reference)
    own = overview.light if overview.reference is None else overview.light - overview.reference
    every = [outline(found, k) / overview.step for k in range(len(found.scene.spotlights))]
    middles = [(points.mean(axis=0), float(np.mean(np.ptp(points, axis=0))) / 2.0) for points in every if len(points)]
    if not middles:
        return False
    wide = min(radius for _, radius in middles)
    light = np.asarray(cv2.GaussianBlur(np.asarray(own, np.float32), (0, 0), max(wide / 4.0, 0.5)), np.float32)
    inside, beside = np.zeros(light.shape, np.uint8), np.ones(light.shape, np.uint8)
    for middle, radius in middles:
        at = tuple(int(v) for v in np.round(middle))
        cv2.circle(inside, at, math.ceil(radius), 1, cv2.FILLED)
        cv2.circle(beside, at, math.ceil(_BESIDE * radius), 0, cv2.FILLED)
    if not inside.any() or not beside.any():
        return False
    return float(light[beside > 0].max()) > _FAR_BRIGHTER * float(light[inside > 0].max())


def _against(frame: Frame, found: Estimate, noise: NoiseModel) -> str | None:
    """What speaks against how the values of a frame came about, around its patches; None if nothing does."""
    points = outlines(found)
    if not len(points):
        return None
    rows, columns = _around(points, found.scene, _BLOCKS)
    if not isinstance(found.scene.sensor, Recorded) and compressed(frame.pixels, rows, columns):
        return COMPRESSED
    wide = DECODING.reach * float(np.max(np.ptp(points, axis=0)))
    return decoded_amiss(frame, noise, *_around(points, found.scene, wide))


def noise_of(frame: Frame, told: NoiseModel | None) -> NoiseModel:
    """The noise `told`, or the sensor's with no more steps than the pixels have: fewer bits are rounded further."""
    own = frame.sensor.noise
    if told is not None or frame.steps is None or frame.steps >= own.levels:
        return told or own
    return replace(own, levels=frame.steps)


def _around(
    points: np.ndarray[tuple[int, int], np.dtype[np.float64]], scene: Scene, wide: float
) -> tuple[slice, slice]:
    """Rows and columns of the frame around outlines `[N, 2]` [px], and so many pixels beside."""
    sides = np.array(scene.camera.shape[::-1])
    low = np.clip(np.floor(points.min(axis=0)) - wide, 0, sides).astype(int)
    high = np.clip(np.ceil(points.max(axis=0)) + wide, 0, sides).astype(int)
    return slice(int(low[1]), int(high[1])), slice(int(low[0]), int(high[0]))
