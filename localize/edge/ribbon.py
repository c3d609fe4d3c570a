"""Bins along the outlines of the patches, sorted into strips across them, with what the image shows there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.settings import EDGE
from conespot.localize.edge.strips import WIDTH, Strips
from conespot.localize.image import Frame, Reference
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.occlusion import covered
from conespot.localize.model.outline import Off
from conespot.localize.model.sight import Sight, look
from conespot.localize.model.view import Shown, Window, log_albedo
from conespot.scene.scene import Scene
from conespot.scene.spotlights import spotlight_axes
from conespot.scene.vignetting import seen_whole

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ribbon:
    """Bins of an image along the outlines of an estimate."""

    pixels: Array  #: centres of the bins `[N, 2]` [px]
    sight: Sight  #: what they see
    spots: NDArray[np.intp]  #: the spotlight whose outline is nearest `[N]`
    shown: tuple[Shown, ...]  #: what the bins show, `[N]` each
    strips: Strips
    covered: float  #: share of the outlines that the frame shows
    at: Window  #: that the bins are in
    cells: tuple[NDArray[np.intp], NDArray[np.intp]]  #: their rows and columns there

    @classmethod
    def along(cls, frame: Frame, estimate: Estimate, *, side: int, inner: float, outer: float) -> Ribbon | None:
        """Bins of `side` x `side` px up to `inner` bins inside the outlines and `outer` outside.

        None if too few are in the frame.
        """
        scene = estimate.scene
        edge = np.array(scene.camera.shape[::-1]) // side
        curves, seen = [], []
        for k in range(len(scene.spotlights)):
            outline = scene.camera.project(scene.outline(estimate.pose, k, 180))
            points = outline / side - 0.5
            finite = np.all(np.isfinite(points), axis=1)
            inside = finite & np.all((points > 1.0) & (points < edge - 2.0), axis=1)
            inside &= ~covered(outline, estimate.pose, scene, side=side) & seen_whole(scene.camera, outline)
            seen.append(float(np.mean(inside)))
            if inside.sum() >= EDGE.fewest_points:
                curves.append(points[finite])
        if not curves:
            return None
        reach = math.ceil(max(inner, outer)) + 1
        every = np.concatenate(curves)
        low = np.clip(np.floor(every.min(axis=0)).astype(int) - reach, 0, edge - 1)
        high = np.clip(np.ceil(every.max(axis=0)).astype(int) + reach + 1, 1, edge)
        if np.any(high - low < 4):
            return None
        mask = np.zeros((high[1] - low[1], high[0] - low[0]), np.uint8)
        for points in curves:
            cv2.polylines(mask, [np.round(points - low).astype(np.int32)], True, 1, 2 * reach + 1)
        row, column = np.nonzero(mask)
        pixels = (np.stack([column + low[0], row + low[1]], axis=1) + 0.5) * side
        sight = look(scene, pixels, side)
        spots, alone = _nearest_outline(sight, estimate)
        distance = Off.of(sight, spots, estimate).distance
        keep = np.isfinite(distance) & alone & (distance > -inner) & (distance < outer)
        keep &= ~covered(pixels, estimate.pose, scene, side=side) & seen_whole(scene.camera, pixels)
        if np.count_nonzero(keep) < EDGE.fewest_bins:
            return None
        row, column, pixels, spots, distance = row[keep], column[keep], pixels[keep], spots[keep], distance[keep]
        at = Window(int(low[1]) * side, int(low[0]) * side, mask.shape[0], mask.shape[1], side)
        index = _strip_of(pixels, spots, curves, side, len(scene.spotlights))
        order = np.argsort(index, kind="stable")
        _, first, compact = np.unique(index[order], return_index=True, return_inverse=True)
        spot = spots[order][first]
        turns = tuple(slice(*np.searchsorted(spot, [k, k + 1])) for k in np.unique(spot))
        strips = Strips(compact, distance[order], first, turns)
        cells = row[order], column[order]
        shown = tuple(Shown.in_cells(frame, at, *cells))
        seen_there = sight.part(np.flatnonzero(keep)[order])
        return cls(pixels[order], seen_there, spots[order], shown, strips, float(np.mean(seen)), at, cells)

    def told(self, reference: Reference, scene: Scene, noise: NoiseModel) -> Ribbon:
        """The same with the albedo that a reference shows."""
        told = zip(self.shown, *log_albedo(reference, scene, self.at, noise), strict=True)
        shown = tuple(plane.told(albedo[self.cells], variance[self.cells]) for plane, albedo, variance in told)
        return replace(self, shown=shown)


def _strip_of(
    pixels: Array, spots: NDArray[np.intp], curves: list[Array], side: int, spotlights: int
) -> NDArray[np.intp]:
    """Strips of equal angle about each patch's middle, about `WIDTH` wide on the outline."""
    perimeter = max(float(np.sum(np.linalg.norm(np.diff(c, axis=0, append=c[:1]), axis=1))) for c in curves)
    per_spot = max(8, int(perimeter / WIDTH))
    result = np.zeros(len(pixels), np.intp)
    for k in range(spotlights):
        mine = spots == k
        if not mine.any():
            continue
        middle = 0.5 * (pixels[mine].min(axis=0) + pixels[mine].max(axis=0))
        angle = np.arctan2(pixels[mine, 1] - middle[1], pixels[mine, 0] - middle[0]) + math.pi
        result[mine] = k * per_spot + np.minimum((angle * per_spot / (2.0 * math.pi)).astype(np.intp), per_spot - 1)
    return result


def _nearest_outline(sight: Sight, estimate: Estimate) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Which cone's outline each pixel `[N]` lies nearest to, and whether no other cone covers it."""
    if len(estimate.scene.spotlights) == 1:
        return np.zeros(len(sight.points), np.intp), np.ones(len(sight.points), bool)
    to = sight.points - estimate.pose.apex
    to /= np.linalg.norm(to, axis=1, keepdims=True)
    axes = spotlight_axes(estimate.pose, estimate.scene.spotlights)
    off = np.arccos(np.clip(to @ axes.T, -1.0, 1.0)) - estimate.scene.beam.half_angle
    nearest = np.argmin(np.abs(off), axis=1)
    others = off.copy()
    others[np.arange(len(off)), nearest] = math.inf
    return nearest, others.min(axis=1) > 0.0
