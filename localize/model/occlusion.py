"""What the needle's shaft hides: pixels it stands in front of, and retina it shades from the microscope's light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.sight import look
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.spotlights import Shaft

Array = NDArray[np.float64]


def covered(pixels: Array, pose: Pose, scene: Scene, *, side: float = 1.0, slack: float = 0.05) -> NDArray[np.bool_]:
    """Which pixels with centres `[N, 2]` [px] and `side` [px] the shaft covers or shades: `[N]`.

    The instrument is at `pose`. A pixel counts as soon as any of it may be touched, for a shaft thicker and longer by
    `slack` [mm], which is what the pose may still be wrong by. No pixel without a shaft, or where a pixel sees no
    retina. The spotlights stand in front of the shaft, which therefore takes none of their light.
    """
    shaft = scene.instrument.shaft
    if shaft is None:
        return np.zeros(len(pixels), bool)
    sight = look(scene, pixels, side)
    # half the pixel's diagonal on the retina; up at the shaft it is smaller
    pixel = (np.linalg.norm(sight.along_x, axis=1) + np.linalg.norm(sight.along_y, axis=1)) / 2.0
    margin = np.where(np.isfinite(pixel), pixel, 0.0) + slack
    to_camera = -scene.camera.rays(pixels).directions
    to_light = np.broadcast_to(scene.ambient.towards, sight.points.shape)
    hidden, shaded = (_meets(shaft, pose, sight.points, way, margin) for way in (to_camera, to_light))
    return hidden | shaded


def _meets(shaft: Shaft, pose: Pose, origins: Array, directions: Array, margin: Array) -> NDArray[np.bool_]:
    """Whether rays (origins, directions `[N, 3]`) meet the solid shaft, grown by `margin` `[N]` [mm] on all sides.

    The stretch of a ray between the planes of the two ends overlaps that within the endless cylinder or does not.
    """
    backwards = -pose.axis
    start = origins - (pose.apex + shaft.setback * backwards)
    height, climb = start @ backwards, directions @ backwards
    off = start - height[:, None] * backwards
    side = directions - climb[:, None] * backwards
    square = np.maximum(np.einsum("ij,ij->i", side, side), 1e-300)
    half = np.einsum("ij,ij->i", off, side) / square
    gap = np.einsum("ij,ij->i", off, off) - (shaft.diameter / 2.0 + margin) ** 2
    inside = half * half - gap / square
    reach = np.sqrt(np.where(inside >= 0.0, inside, np.nan))
    steep = np.where(np.abs(climb) > 1e-12, climb, 1e-12)
    ends = np.sort(np.stack([-margin - height, shaft.length + margin - height]) / steep, axis=0)
    first = np.maximum(np.maximum(-half - reach, ends[0]), 0.0)
    return np.asarray(first <= np.minimum(-half + reach, ends[1]))
