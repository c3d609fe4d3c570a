"""What was seen in a frame, to be drawn over it: outlines, mask, and what a fit leaves over. Plain arrays.

Who localizes and who renders hand over what they have; nothing is computed here. `results.overlay_picture` draws it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_MARGIN = 0.3


@dataclass(frozen=True, eq=False)
class Residual:
    """Differences `[h, w]` in bins of `side` px from pixel (row, column)."""

    row: int
    column: int
    side: int
    values: Array


@dataclass(frozen=True, eq=False)
class Mark:
    """Points `[N, 2]` [px] that are drawn over a frame as one thing, in a colour of `COLOURS`, named in the legend."""

    name: str
    points: Array
    colour: str
    how: Literal["line", "closed", "dots", "point"] = "line"  #: a point lies above all else


@dataclass(frozen=True, eq=False)
class Overlay:
    """A frame `[H, W]` or `[H, W, 3]` (RGB), in which `white` is the largest value, and what was seen in it.

    `lines` are outlines `[N, 2]` [px] (column, row; pixel centres at i + 0.5) by what they are: `true`, `found`,
    `fitted`; `marks` are drawn above them. `mask` `[H, W]` is what was taken for light.
    """

    image: NDArray[Any]
    white: float
    lines: Mapping[str, Sequence[Array]] = field(default_factory=dict)
    mask: NDArray[np.bool_] | None = None
    residuals: Sequence[Residual] = ()
    marks: Sequence[Mark] = ()


def anything_seen(overlay: Overlay) -> bool:
    """Whether there is anything to draw over the frame."""
    lines = (points for lines in overlay.lines.values() for points in lines)
    return any(map(len, lines)) or any(len(mark.points) for mark in overlay.marks)


def window(overlay: Overlay) -> tuple[int, int, int, int]:
    """Left, top, right, bottom [px] of what is drawn, with a margin; the whole frame where nothing is."""
    height, width = overlay.image.shape[:2]
    drawn = [points for lines in overlay.lines.values() for points in lines if len(points)]
    drawn += [mark.points for mark in overlay.marks if len(mark.points) == 1]  # the tip; a shaft leads far away
    if not drawn:
        return 0, 0, width, height
    points = np.concatenate(drawn)
    low, high = points.min(axis=0), points.max(axis=0)
    size = float(np.max(high - low)) * (1.0 + 2.0 * _MARGIN)
    middle = (low + high) / 2.0
    left, top = np.clip(np.floor(middle - size / 2.0), 0, [width - 2, height - 2]).astype(int)
    right, bottom = np.clip(np.ceil(middle + size / 2.0), [left + 1, top + 1], [width, height]).astype(int)
    return int(left), int(top), int(right), int(bottom)
