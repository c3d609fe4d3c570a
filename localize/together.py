"""Several cameras' frames of one instant, a stereo pair's for example: one instrument, so one answer.

Each camera's frame is localized alone. The answers are then one Gaussian, in which the RCM, that each of them was told,
counts once. Cameras that contradict each other are refused: one of them is not where the scene says.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.localize.distance import with_distance
from conespot.localize.image import Reference
from conespot.localize.locate import find_localizer, locate
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.prior import prior_rows
from conespot.localize.outcome import Localization, LocalizationFailure, Outcome
from conespot.scene import InputError, Pose, Scene
from conespot.scene.pose import tangents

Array = NDArray[np.float64]
CONTRADICT = "the cameras contradict each other"
#: sigmas a coordinate by which answers may differ from the common one: by chance five do once in a million instants
_FARTHEST = 6.0


def locate_together(
    images: Mapping[str, ArrayLike],
    scene: Scene,
    localizer: str = "photometric",
    *,
    knowns: Knowns | None = None,
    references: Mapping[str, ArrayLike | Reference] | None = None,
    noise: NoiseModel | None = None,
) -> Outcome:
    """Where the instrument is, from one frame of each of the scene's `cameras`, by their names.

    A camera whose frame is refused takes no part; if all are, the answer is the first one's refusal. `references` are
    frames without spotlights, also by name; all else is as in `locate`.

    Raises InputError for a camera that the scene does not have, a localizer that states no covariance, quantities that
    are free for every camera anew though they belong to all, and what `locate` refuses.
    """
    entry, known = find_localizer(localizer), knowns or Knowns()
    if not entry.takes_knowledge:
        raise InputError(
            f"localizer '{localizer}' states no covariance to weigh the cameras by; take cone or photometric"
        )
    for name in [*images, *(references or {})]:
        if name not in scene.cameras:
            raise InputError(
                f"images: the scene has no camera '{name}'; its cameras: {', '.join(scene.cameras) or 'none'}"
            )
    common = [each.name for each in known.free if not each.name.startswith("camera_")]
    if common:
        raise InputError(f"knowns: {', '.join(common)} would be another one for each camera; hold it exactly")
    outcomes = [
        locate(image, scene.through(name), localizer, knowns=known, reference=(references or {}).get(name), noise=noise)
        for name, image in images.items()
    ]
    found = [outcome for outcome in outcomes if isinstance(outcome, Localization)]
    if len(found) < 2:
        return next(iter([*found, *outcomes]), LocalizationFailure("no frames"))
    return _common(found, scene, known)


def _common(found: list[Localization], scene: Scene, knowns: Knowns) -> Outcome:
    """The one answer that several agree on, or that they do not."""
    at = Estimate(Pose(found[0].apex_mm, found[0].axis, found[0].roll or 0.0), scene)
    size = at.pose_size
    told, rows = prior_rows(at, scene, Knowns(rcm_sigma_mm=knowns.rcm_sigma_mm))
    again = len(found) - 1  # times that the RCM was told too often
    information, pull = -again * rows.T @ rows, again * rows.T @ told
    answers = []
    for one in found:
        off, turned = _seen_from(at.pose, one)
        own = np.linalg.inv(turned @ np.asarray(one.covariance) @ turned.T)
        information, pull = information + own, pull + own @ off
        answers.append((off, own))
    covariance = np.asarray(np.linalg.inv(information), float)
    step = covariance @ pull
    for off, own in answers:
        if float((off - step) @ own @ (off - step)) > size * _FARTHEST**2:
            return LocalizationFailure(CONTRADICT)
    pose = at.pose
    u, v = tangents(pose.axis)
    axis = pose.axis + step[3] * u + step[4] * v
    joint = Localization(
        pose.apex + step[:3],
        axis / np.linalg.norm(axis),
        covariance,
        roll=None if size == 5 else pose.roll + float(step[5]),
    )
    return with_distance(joint, scene, knowns)


def _seen_from(pose: Pose, found: Localization) -> tuple[Array, Array]:
    """By how much an answer differs from a pose `[P]`, and what turns its covariance into the pose's basis `[P, P]`."""
    here, own = np.array(tangents(pose.axis)), np.array(tangents(found.axis))
    off = np.concatenate([found.apex_mm - pose.apex, here @ (found.axis - pose.axis)])
    if found.roll is not None:
        off = np.append(off, math.remainder(found.roll - pose.roll, 2.0 * math.pi))
    turned = np.eye(len(off))
    turned[3:5, 3:5] = here @ own.T
    return off, turned
