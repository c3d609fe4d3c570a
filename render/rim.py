"""Where a patch's edge lies in the frame: pixels whose mean a few samples cannot tell."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.render.source import outermost
from conespot.render.tile import Crop
from conespot.scene import Pose, Scene
from conespot.scene.beam import HardBeam

#: a beam is steep where its intensity changes by more than this part of the axial one over a pixel; what 16 samples
#: make of a gentler slope scatters by less than 0.2 % of it
STEEP = 0.1
#: of a pixel; the edge is followed in steps of this, around the cone and across it
_STEP = 0.25


def rim_pixels(scene: Scene, pose: Pose, spotlight: int, blur: int = 0) -> NDArray[np.uint32]:
    """The pixels `[N]` of the frame (row * width + column, ascending) within half a pixel of a steep beam.

    Of a source that has a core or moves, the whole penumbra, and of what the lens does not have in focus all within the
    circle of confusion, and `blur` [px] more. None where the beam is soft. Edges of shadows that bumps or the shaft
    cast are not among them.
    """
    pixels = _steep(scene, pose, spotlight)
    radius = blur + float(np.nanmax(scene.camera.confusion(scene.outline(pose, spotlight)), initial=0.0))
    return _within(radius, pixels, scene.camera.shape) if radius > 0.0 else pixels


def _steep(scene: Scene, pose: Pose, spotlight: int) -> NDArray[np.uint32]:
    """`rim_pixels` where all is in focus."""
    (height, width), b = scene.camera.shape, scene.beam.half_angle
    rim = scene.camera.project(scene.outline(pose, spotlight))
    diameters = np.linalg.norm(rim - np.roll(rim, len(rim) // 2, axis=0), axis=-1)
    if not np.any(np.isfinite(diameters)):  # through the eye's optics no ray may meet it
        return np.zeros(0, np.uint32)
    across = float(np.nanmin(diameters))
    pixel = 2.0 * b / across  # the angle that a pixel sees where the patch is foreshortened most
    angles = np.arange(b + (1.0 - _STEP / 2.0) * pixel, 0.0, -_STEP * pixel)
    ahead, behind = (scene.beam.intensity(np.cos(angles + k * pixel / 2.0)) for k in (1.0, -1.0))
    steep = angles[np.abs(ahead - behind) > STEEP]
    poses = outermost(scene, pose, spotlight)
    if len(poses) > 1:
        return _penumbra(scene, poses, spotlight, steep)
    around = int(np.nansum(np.linalg.norm(rim - np.roll(rim, 1, axis=0), axis=-1))) + 4
    found = []
    for angle in steep:
        cone = scene.model_copy(update={"beam": HardBeam(half_angle=float(angle))})
        points = scene.camera.project(cone.outline(pose, spotlight, points=around))
        steps = np.arange(0.0, 1.0, _STEP)[:, None, None]
        places = (points + steps * (np.roll(points, -1, axis=0) - points)).reshape(-1, 2)
        column, row = np.floor(places[np.isfinite(places[:, 0])]).astype(int).T
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        found.append(np.unique(row[inside] * width + column[inside]))
    return np.unique(np.concatenate([np.zeros(0, int), *found])).astype(np.uint32)


def _penumbra(scene: Scene, poses: list[Pose], spotlight: int, steep: NDArray[np.float64]) -> NDArray[np.uint32]:
    """The pixels that some of the poses' cones reach with their `steep` angles [rad], or some and not all of them."""
    if not len(steep):
        return np.zeros(0, np.uint32)
    shape = scene.camera.shape
    outer, inner = ([_outline(scene, pose, spotlight, angle) for pose in poses] for angle in (steep.max(), steep.min()))
    crop = Crop.around(np.concatenate(outer), shape, 2.0)
    if not crop.height or not crop.width:
        return np.zeros(0, np.uint32)
    some = np.any([_filled(crop, outline) for outline in outer], axis=0).astype(np.uint8)
    every = np.all([_filled(crop, outline) for outline in inner], axis=0).astype(np.uint8)
    near = np.ones((3, 3), np.uint8)
    # beyond the crop is more of the patch where the frame cuts it
    band = (cv2.dilate(some, near) > 0) & (cv2.erode(every, near) == 0)
    return crop.pixels(shape[1])[band.ravel()]


def _outline(scene: Scene, pose: Pose, spotlight: int, angle: float) -> NDArray[np.float64]:
    """Where the camera sees a cone of that half angle [rad] end `[N, 2]` [px]."""
    cone = scene.model_copy(update={"beam": HardBeam(half_angle=angle)})
    points = scene.camera.project(cone.outline(pose, spotlight))
    return np.asarray(points[np.isfinite(points[:, 0])])


def _filled(crop: Crop, outline: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of the crop's pixels lie within an outline `[N, 2]` [px]; none where that is unknown."""
    filled = np.zeros((crop.height, crop.width), np.uint8)
    if len(outline):
        corners = np.round(16.0 * (outline - (crop.column + 0.5, crop.row + 0.5))).astype(np.int32)
        cv2.fillPoly(filled, [corners], 1, shift=4)
    return filled > 0


def _within(radius: float, pixels: NDArray[np.uint32], shape: tuple[int, int]) -> NDArray[np.uint32]:
    """The pixels of a frame within `radius` [px] of some of them."""
    if not len(pixels):
        return pixels
    width, reach = shape[1], math.ceil(radius)
    row, column = np.divmod(pixels.astype(int), width)
    low, high = np.array([row.min(), column.min()]) - reach, np.array([row.max(), column.max()]) + reach + 1
    (top, left), (bottom, right) = np.maximum(low, 0), np.minimum(high, shape)
    off = np.ones((bottom - top, right - left), np.uint8)
    off[row - top, column - left] = 0
    near = cv2.distanceTransform(off, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) <= radius
    rows, columns = np.nonzero(near)
    return ((rows + top) * width + columns + left).astype(np.uint32)
