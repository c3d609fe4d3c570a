"""The filters before Otsu's threshold: Gaussian, then median, and the histogram of what they leave.

Otsu's threshold rests on the histogram of the whole filtered frame, dark ground included. Frames without noise of one
camera differ only where the patches are: all else has been filtered and counted before.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.localize.published.settings import PUBLISHED

Grey = NDArray[np.uint8]
Counts = NDArray[np.int64]
Box = tuple[slice, slice]

#: how far a pixel reaches through both filters [px]
_REACH = PUBLISHED.gaussian // 2 + PUBLISHED.median // 2
#: rows that are compared at once: 32 of 5000 px stay in a processor's second cache
_BAND = 32
#: cv2.calcHist counts in float32, which is exact up to 2^24
_COUNTED_AT_ONCE = 2**23


class _Last(threading.local):
    """The frame that this thread smoothed last; filtered and counted once a second one has shown the same ground."""

    grey: Grey = np.zeros((0, 0), np.uint8)
    smooth: Grey | None = None
    counts: Counts = np.zeros(256, np.int64)
    highest: Grey = np.zeros(0, np.uint8)


_LAST = _Last()


@dataclass(frozen=True, eq=False)
class Smooth:
    """Grey values `[H, W]` after both filters, the highest of each row `[H]`, and where that is known how many pixels
    have each value `[256]`. All are good until the next frame of this thread.
    """

    grey: Grey
    highest: Grey
    counts: Counts | None = None


def smoothed(grey: Grey) -> Smooth:
    """Grey values `[H, W]` after Gaussian and median: the same to the byte as filtering the whole frame."""
    last = _LAST
    new = _differing(grey, last.grey)
    if new == _whole(grey):
        last.grey, last.smooth = grey.copy(), None
        smooth = _filtered(grey)
        return Smooth(smooth, smooth.max(axis=1))
    last.grey[new] = grey[new]
    if last.smooth is None:
        last.smooth = _filtered(grey)
        last.counts, last.highest = _counts(last.smooth), last.smooth.max(axis=1)
    else:
        touched = _grown(new, grey)
        seen = _grown(touched, grey)
        inside = tuple(slice(t.start - s.start, t.stop - s.start) for t, s in zip(touched, seen, strict=True))
        smooth = _filtered(grey[seen])[inside]
        last.counts = last.counts - _counts(last.smooth[touched]) + _counts(smooth)
        last.smooth[touched] = smooth
        last.highest[touched[0]] = last.smooth[touched[0]].max(axis=1)
    return Smooth(last.smooth, last.highest, last.counts)


def _filtered(grey: Grey) -> Grey:
    blurred = cv2.GaussianBlur(grey, (PUBLISHED.gaussian, PUBLISHED.gaussian), 0)
    return np.asarray(cv2.medianBlur(blurred, PUBLISHED.median), np.uint8)


def _whole(grey: Grey) -> Box:
    return slice(0, grey.shape[0]), slice(0, grey.shape[1])


def _differing(a: Grey, b: Grey) -> Box:
    """A box around all pixels in which two frames `[H, W]` differ: all where the first and the last rows do.

    So a noisy frame is not compared to its end.
    """
    if a.shape != b.shape:
        return _whole(a)
    starts = range(0, len(a), _BAND)

    def differ(start: int) -> bool:
        # numpy would write down where before it says whether
        return cv2.norm(a[start : start + _BAND], b[start : start + _BAND], cv2.NORM_INF) > 0.0

    first = next(filter(differ, starts), None)
    if first is None:
        return slice(0, 0), slice(0, 0)
    rows = slice(first, min(next(filter(differ, reversed(starts))) + _BAND, len(a)))
    if rows == slice(0, len(a)):
        return _whole(a)
    columns = np.flatnonzero(np.any(a[rows] != b[rows], axis=0))
    return rows, slice(int(columns[0]), int(columns[-1]) + 1)


def _grown(box: Box, grey: Grey) -> Box:
    """The box and what the filters carry beyond it, inside the frame."""
    rows, columns = (
        slice(max(0, part.start - _REACH), min(side, part.stop + _REACH))
        for part, side in zip(box, grey.shape, strict=True)
    )
    return rows, columns


def _counts(grey: Grey) -> Counts:
    """How many of the pixels `[H, W]` have each value `[256]`."""
    bands = np.array_split(grey, grey.size // _COUNTED_AT_ONCE + 1)
    counts = [cv2.calcHist([np.ascontiguousarray(band)], [0], None, [256], [0, 256]) for band in bands if band.size]
    return np.asarray(np.sum(counts, axis=0, dtype=np.int64)).reshape(256)
