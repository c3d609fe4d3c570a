"""What speaks against a frame itself, or against any one answer to it, whatever a fit says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from conespot.localize.compression import compressed
from conespot.localize.image import Frame, Reference
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.view import outlines
from conespot.localize.outcome import COMPRESSED, Localization, LocalizationFailure, Outcome
from conespot.localize.start.search import Start, believed, find_starts
from conespot.localize.verdict import MISFIT, WRONG_BEAM, WRONG_WALL
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.sensor import Recorded


def answered(frame: Frame, scene: Scene, reference: Reference | None, localized: Callable[[Start], Outcome]) -> Outcome:
    """The one answer of a frame's starts that may be believed, or what speaks against the frame."""
    tried: list[Start] = []

    def followed(start: Start) -> Outcome:
        tried.append(start)
        return localized(start)

    outcome = believed(find_starts(frame, scene, reference), scene, followed)
    if isinstance(scene.sensor, Recorded):
        return outcome
    if isinstance(outcome, Localization):
        pose = Pose(outcome.apex_mm, outcome.axis, outcome.roll or 0.0)
    elif tried and outcome.reason in (MISFIT, WRONG_BEAM, WRONG_WALL):
        pose = tried[0].pose
    else:
        return outcome
    points = outlines(Estimate(pose, scene))
    if len(points) and compressed(frame.pixels, *_around(points, scene)):
        return LocalizationFailure(COMPRESSED)
    return outcome


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
