"""A tile: the part of the frame that one spotlight reaches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Crop:
    """A rectangle of whole pixels of the frame; empty where height or width is 0."""

    row: int
    column: int
    height: int
    width: int

    @classmethod
    def whole(cls, shape: tuple[int, int]) -> Crop:
        """All pixels of a frame of `shape` (rows, columns)."""
        return cls(0, 0, *shape)

    @classmethod
    def around(cls, pixels: NDArray[np.float64], shape: tuple[int, int], margin: float) -> Crop:
        """The pixels within `margin` [px] of the bounding box of `pixels` `[N, 2]` (x, y), cut to a frame of `shape`.

        Pixels that are NaN, what the camera does not see, do not count.
        """
        seen = pixels[np.all(np.isfinite(pixels), axis=1)]
        if not len(seen):
            return cls(0, 0, 0, 0)
        low = np.clip(np.floor(seen.min(axis=0) - margin), 0, shape[::-1]).astype(int)
        high = np.clip(np.ceil(seen.max(axis=0) + margin), 0, shape[::-1]).astype(int)
        return cls(int(low[1]), int(low[0]), int(high[1] - low[1]), int(high[0] - low[0]))

    @classmethod
    def covering(cls, pixels: NDArray[np.uint32], columns: int) -> Iterator[Crop]:
        """Rectangles that make up the pixels `[N]` (row * columns + column, ascending)."""
        row, column = np.divmod(pixels.astype(int), columns)
        starts = np.flatnonzero((np.diff(column, prepend=-2) != 1) | (np.diff(row, prepend=-1) != 0))
        grown: Crop | None = None
        for start, end in zip(starts, [*starts[1:], len(pixels)], strict=True):
            run = cls(int(row[start]), int(column[start]), 1, int(end - start))
            if grown and (grown.row + grown.height, grown.column, grown.width) == (run.row, run.column, run.width):
                grown = replace(grown, height=grown.height + 1)
                continue
            if grown:
                yield grown
            grown = run
        if grown:
            yield grown

    def hull(self, pixels: NDArray[np.float64], margin: int) -> NDArray[np.bool_]:
        """Which of its pixels `[height, width]` lie within `margin` [px] of the hull of `pixels` `[N, 2]` (x, y).

        All of them where some are NaN: what the camera does not see may lie beyond those that it does.
        """
        if not np.all(np.isfinite(pixels)) or not self.height or not self.width:
            return np.ones((self.height, self.width), bool)
        # OpenCV's pixels have their centres at whole numbers; in sixteenths of a pixel
        corners = cv2.convexHull((pixels - (self.column + 0.5, self.row + 0.5)).astype(np.float32))
        filled = np.zeros((self.height, self.width), np.uint8)
        cv2.fillConvexPoly(filled, np.round(16.0 * corners).astype(np.int32), 1, shift=4)
        return np.asarray(cv2.dilate(filled, np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)), bool)

    def pixels(self, columns: int) -> NDArray[np.uint32]:
        """Its pixels `[height * width]`, each row * columns + column of the frame, ascending."""
        row, column = (np.arange(s.start, s.stop, dtype=np.uint32) for s in self.slices)
        return (row[:, None] * np.uint32(columns) + column).ravel()

    def grown(self, down: int, right: int, shape: tuple[int, int]) -> Crop:
        """The crop with so many more rows above and below, and columns to both sides, cut to a frame of `shape`."""
        row, column = max(self.row - down, 0), max(self.column - right, 0)
        bottom, end = min(self.row + self.height + down, shape[0]), min(self.column + self.width + right, shape[1])
        return Crop(row, column, bottom - row, end - column)

    def within(self, outer: Crop) -> tuple[slice, slice]:
        """Rows and columns of a crop that holds it."""
        row, column = self.row - outer.row, self.column - outer.column
        return slice(row, row + self.height), slice(column, column + self.width)

    @property
    def corners(self) -> NDArray[np.float64]:
        """The middles of its first and last pixel `[2, 2]` (x, y); none where it is empty."""
        first = np.array([[self.column, self.row]]) + 0.5
        size = np.array([[self.width, self.height]])
        return np.concatenate([first, first + size - 1.0])[: 2 * int(size.all())]

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns of the frame."""
        return slice(self.row, self.row + self.height), slice(self.column, self.column + self.width)


@dataclass(frozen=True)
class Tile:
    """Radiance `[h, w, C]` [W m-2 sr-1] of one spotlight at 1 W inside `crop`; it is 0 outside.

    A lens' glare `[C]`, if there is any, lies over the whole frame, the crop included, on top of that.
    """

    crop: Crop
    radiance: NDArray[np.float32]
    glare: NDArray[np.float32] | None = None
