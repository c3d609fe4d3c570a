"""Where the patches of light are: the two published segmentations and the outlines they leave."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.localize.outcome import CUT_BY_BORDER, FEWER_PATCHES, NOTHING_FOUND, LocalizationFailure
from conespot.localize.published.settings import PUBLISHED
from conespot.localize.published.smoothing import Counts, smoothed
from conespot.scene import Scene

Grey = NDArray[np.uint8]
Contour = NDArray[np.int32]

#: a class of no larger share is none to cv2.threshold: the step of float32 at 1
_NOBODY = float(np.finfo(np.float32).eps)


@dataclass(frozen=True, eq=False)
class Mask:
    """Where patches are: `bright` `[h, w]` of 0 and 1 is cut out of a frame; nothing beside it is bright."""

    bright: NDArray[np.uint8]
    left: int  #: column of the frame where `bright` begins
    top: int  #: row
    frame: tuple[int, int]  #: rows and columns of the frame

    @classmethod
    def above(cls, grey: Grey, level: int, highest: Grey | None = None) -> Mask:
        """Where grey values `[H, W]`, with `highest` `[H]` in their rows, exceed a level."""
        rows = _span((grey.max(axis=1) if highest is None else highest) > level)
        columns = _span(grey[rows].max(axis=0) > level)
        bright = cv2.threshold(grey[rows, columns], level, 1, cv2.THRESH_BINARY)[1]
        return cls(np.asarray(bright, np.uint8), columns.start, rows.start, (grey.shape[0], grey.shape[1]))


def otsu_mask(grey: Grey) -> Mask:
    """Patches in grey values `[H, W]` by the paper's text: Gaussian, median, Otsu."""
    smooth = smoothed(grey)
    if smooth.counts is None:
        level = round(cv2.threshold(smooth.grey, 0, 1, cv2.THRESH_OTSU)[0])
    else:
        level = otsu_threshold(smooth.counts)
    return Mask.above(smooth.grey, level, smooth.highest)


def otsu_threshold(counts: Counts) -> int:
    """The level that parts the darker from the brighter pixels, `counts` `[256]` of each value, with most variance
    between the two.

    N. Otsu, A threshold selection method from gray-level histograms, IEEE Trans. SMC 9 (1979), Eq. 18; in the order of
    cv2.threshold. Between levels that part a symmetric histogram equally well the last bit decides, which OpenCV's
    compiler makes.
    """
    scale = 1.0 / int(counts.sum())
    mean = float(np.arange(256) @ counts) * scale
    below, below_mean, most, best = 0.0, 0.0, 0.0, 0
    for level, count in enumerate(counts.tolist()):
        share = count * scale
        below_mean *= below
        below += share
        above = 1.0 - below
        if min(below, above) < _NOBODY or max(below, above) > 1.0 - _NOBODY:
            continue
        below_mean = (below_mean + level * share) / below
        above_mean = (mean - below * below_mean) / above
        between = below * above * (below_mean - above_mean) * (below_mean - above_mean)
        if between > most:
            most, best = between, level
    return best


def coded_mask(grey: Grey) -> Mask:
    """Patches in grey values `[H, W]` as the authors coded it: median, fixed threshold.

    A median exceeds the threshold exactly where most of its window does, so counting the window's bright pixels
    gives the same mask as filtering first. No pixel beside all bright ones has so many of them in its window.
    """
    bright = Mask.above(grey, PUBLISHED.coded_threshold)
    window = (PUBLISHED.coded_median, PUBLISHED.coded_median)
    count = cv2.boxFilter(bright.bright, cv2.CV_8U, window, normalize=False, borderType=cv2.BORDER_REPLICATE)
    most = cv2.threshold(count, PUBLISHED.coded_median**2 // 2, 1, cv2.THRESH_BINARY)[1]
    return replace(bright, bright=np.asarray(most, np.uint8))


def outlines(mask: Mask, count: int) -> list[Contour] | LocalizationFailure:
    """Outlines of the `count` largest patches, largest first, each `[N, 2]` pixel indices (column, row).

    Every outline runs through the centres of the outermost bright pixels, as published, so it lies half a pixel
    inside the patch. Of a straight run of pixels it keeps the two ends, as the authors' code does.
    """
    corner = (mask.left, mask.top)
    found, _ = cv2.findContours(mask.bright, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE, offset=corner)
    blobs = [(cv2.contourArea(c), c[:, 0, :]) for c in found if len(c) >= PUBLISHED.fewest_points]
    blobs.sort(key=lambda blob: -blob[0])
    largest = [c for area, c in blobs[:count] if area > 0.0 and area >= PUBLISHED.smallest_share * blobs[0][0]]
    if not largest:
        return LocalizationFailure(NOTHING_FOUND)
    last = np.array(mask.frame[::-1]) - 1
    if any(c.min() == 0 or np.any(c == last) for c in largest):
        return LocalizationFailure(CUT_BY_BORDER)
    if len(largest) < count:
        return LocalizationFailure(FEWER_PATCHES)
    return [np.asarray(c, np.int32) for c in largest]


def contrast(grey: Grey, mask: Mask, scene: Scene) -> float:
    """Mean light where the mask is bright over that elsewhere, from a part of the pixels of grey values `[H, W]`."""
    height, width = mask.bright.shape
    inside = cv2.mean(grey[mask.top : mask.top + height, mask.left : mask.left + width], mask=mask.bright)[0]
    step = max(1, max(grey.shape) // PUBLISHED.contrast_px)
    some = grey[::step, ::step]
    rest = np.ones(some.shape, bool)
    top, left = -(-mask.top // step), -(-mask.left // step)  # the first of those rows and columns in the mask
    dark = mask.bright[top * step - mask.top :: step, left * step - mask.left :: step] == 0
    rest[top : top + dark.shape[0], left : left + dark.shape[1]] = dark
    around = some[rest]
    level = float(around.mean()) if around.size else inside
    levels = np.array([inside, level]) / 255.0
    lit, ground = scene.sensor.decode(levels)
    return float(lit / max(ground, 1.0 / 255.0 / 12.92))


def _span(bright: NDArray[np.bool_]) -> slice:
    """From the first bright row or column to the last, and one to each side where the frame has it.

    The one more is dark, so that filters which repeat the last pixel see beyond the span what the frame shows there.
    Where none is bright, the first one.
    """
    where = np.flatnonzero(bright)
    return slice(max(0, int(where[0]) - 1), int(where[-1]) + 2) if len(where) else slice(0, 1)
