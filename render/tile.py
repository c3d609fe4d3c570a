"""A tile: the part of the frame that one spotlight reaches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

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
    def around(cls, pixels: NDArray[np.float64], resolution: int, margin: float) -> Crop:
        """The pixels within `margin` [px] of the bounding box of `pixels` `[N, 2]` (x, y), cut to the frame."""
        low = np.clip(np.floor(pixels.min(axis=0) - margin), 0, resolution).astype(int)
        high = np.clip(np.ceil(pixels.max(axis=0) + margin), 0, resolution).astype(int)
        return cls(int(low[1]), int(low[0]), int(high[1] - low[1]), int(high[0] - low[0]))

    @classmethod
    def covering(cls, pixels: NDArray[np.uint32], resolution: int) -> Iterator[Crop]:
        """Rectangles that make up the pixels `[N]` (row * resolution + column, ascending)."""
        row, column = np.divmod(pixels.astype(int), resolution)
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

    def pixels(self, resolution: int) -> NDArray[np.uint32]:
        """Its pixels `[height * width]`, each row * resolution + column, ascending."""
        rows, columns = (np.arange(s.start, s.stop, dtype=np.uint32) for s in self.slices)
        return (rows[:, None] * np.uint32(resolution) + columns).ravel()

    @property
    def slices(self) -> tuple[slice, slice]:
        """Rows and columns of the frame."""
        return slice(self.row, self.row + self.height), slice(self.column, self.column + self.width)


@dataclass(frozen=True)
class Tile:
    """Radiance `[h, w, C]` [W m-2 sr-1] of one spotlight at 1 W inside `crop`; it is 0 outside."""

    crop: Crop
    radiance: NDArray[np.float32]
