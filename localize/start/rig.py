"""Poses that put a rig's patches on rings of light."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.sight import look
from conespot.localize.start.rays import rim
from conespot.localize.start.rings import Ring
from conespot.localize.start.settings import START
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.spotlights import spotlight_axes

Array = NDArray[np.float64]


def poses_on(rings: Sequence[Ring], scene: Scene) -> list[Pose]:
    """Poses through the RCM that explain the rings.

    With one spotlight each ring has one. Several spotlights have, for each roll that may be, the one that puts most
    patches on rings; a rig that nearly repeats when it turns leaves several.
    """
    middles, distances = _cones(rings, scene)
    rcm = np.asarray(scene.instrument.rcm)
    number = len(scene.spotlights)
    rolls = np.arange(START.rolls) * (2.0 * math.pi / START.rolls) if number > 1 else np.zeros(1)
    down = Pose(np.zeros(3), np.array([0.0, 0.0, -1.0]))
    rig = np.stack([spotlight_axes(Pose(down.apex, down.axis, float(roll)), scene.spotlights) for roll in rolls])
    # every ring, as the patch of every spotlight, at every roll
    ring, spot, roll = (i.ravel() for i in np.indices((len(rings), number, len(rolls))))
    axis = (middles - rcm) / np.linalg.norm(middles - rcm, axis=1, keepdims=True)
    axis, reach = axis[ring], distances[ring][:, None]
    for _ in range(START.rig_steps):
        apex = middles[ring] - reach * axis
        frame = _frames(apex - rcm)
        axis = np.einsum("hij,hj->hi", frame, rig[roll, spot])
    if number == 1:
        return [Pose.through(a, rcm) for a in apex if _in_eye(a, scene)]
    axes = np.einsum("hij,hkj->hki", frame, rig[roll])
    wall = apex[:, None] + scene.eye.intersect(apex[:, None], axes)[..., None] * axes
    centres, radii = np.array([r.centre for r in rings]), np.array([r.radius for r in rings])
    own = radii[ring][:, None, None]
    size = START.size_weight * np.abs(np.log(radii / own))
    off = np.linalg.norm(scene.camera.project(wall)[:, :, None] - centres, axis=3) / own + size
    far = np.minimum(np.nan_to_num(off.min(axis=2), nan=START.matched), START.matched)
    score = np.where(np.sum(far < START.matched, axis=1) > 1, far.sum(axis=1), math.inf)
    kept: list[Pose] = []
    for h in np.argsort(score):
        if not math.isfinite(score[h]) or len(kept) == number + 1:
            break
        turn = float(rolls[roll[h]])
        new = all(abs(math.remainder(turn - other.roll, 2.0 * math.pi)) > START.turned for other in kept)
        if new and _in_eye(apex[h], scene):
            kept.append(Pose(apex[h], Pose.through(apex[h], rcm).axis, turn))
    return kept


def _in_eye(apex: Array, scene: Scene) -> bool:
    return bool(np.all(np.isfinite(apex)) and scene.depth(apex) > 0.0)


def _cones(rings: Sequence[Ring], scene: Scene) -> tuple[Array, Array]:
    """Where the rings lie on the wall `[N, 3]`, and how far away the cones that show them have their apex `[N]`."""
    rcm = np.asarray(scene.instrument.rcm)
    edges = look(scene, np.concatenate([ring.curve() for ring in rings])).points.reshape(len(rings), -1, 3)
    middles = edges.mean(axis=1)
    line = (middles - rcm) / np.linalg.norm(middles - rcm, axis=1, keepdims=True)
    off = edges - middles[:, None]
    off = off - np.einsum("nij,nj->ni", off, line)[..., None] * line[:, None]
    away = np.linalg.norm(off, axis=2).mean(axis=1) / math.tan(scene.beam.half_angle * rim(scene.beam))
    return middles, np.minimum(away, START.farthest * np.linalg.norm(middles - rcm, axis=1))


def _frames(directions: Array) -> Array:
    """`Pose.rotation` without roll `[N, 3, 3]` for needles along `directions` `[N, 3]`, any length."""
    back = -directions / np.linalg.norm(directions, axis=1, keepdims=True)
    flat = np.hypot(back[:, 0], back[:, 1])
    safe = np.maximum(flat, 1e-12)
    c, s = np.where(flat > 0.0, back[:, 0] / safe, 1.0), back[:, 1] / safe
    ct, st = back[:, 2], flat
    zero = np.zeros_like(c)
    return np.stack(
        [np.stack([c * ct, -s, c * st], 1), np.stack([s * ct, c, s * st], 1), np.stack([-st, zero, ct], 1)], axis=1
    )
