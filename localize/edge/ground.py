"""What the bins of a band look at, kept from frame to frame: a needle hardly leaves the place, and the wall stays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.forward import ambient_irradiance
from conespot.localize.model.sight import Sight, look
from conespot.localize.model.view import Window
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: of a window's size that is looked at on each side of it: a hand's tremor stays within
_MARGIN = 0.3
#: arrays of three components in a `Sight`
_PARTS = 4


class Ground:
    """The place around a track, looked at once until a window leaves it, or has bins of another size."""

    def __init__(self, scene: Scene) -> None:
        """Of a scene's camera, eye and microscope light."""
        self._scene = scene
        self._at: Window | None = None
        self._seen = self._confusion = np.zeros(0)

    def under(self, window: Window, cells: tuple[NDArray[np.intp], NDArray[np.intp]]) -> tuple[Sight, Array]:
        """What the bins of a window at rows and columns `[N]` see, and the ambient irradiance there `[N]`.

        The sight's arrays have their components first in memory.
        """
        at = self._at
        if at is None or not _holds(at, window):
            at = self._look_around(window)
        row, column = cells
        across, down = (window.column - at.column) // at.side, (window.row - at.row) // at.side
        index = (row + down) * at.width + (column + across)
        seen = self._seen.take(index, axis=1, mode="clip")
        confusion = self._confusion[index] if len(self._confusion) else self._confusion
        points, normals, right, below = (seen[3 * k : 3 * k + 3].T for k in range(_PARTS))
        return Sight(points, normals, right, below, at.side, confusion), seen[-1]

    def _look_around(self, window: Window) -> Window:
        scene, side = self._scene, window.side
        rows, columns = (size // side for size in scene.camera.shape)
        more = int(_MARGIN * max(window.height, window.width))
        row, column = max(0, window.row // side - more), max(0, window.column // side - more)
        height = min(rows, window.row // side + window.height + more) - row
        width = min(columns, window.column // side + window.width + more) - column
        at = Window(row * side, column * side, height, width, side)
        sight = look(scene, at.pixels, side)
        parts = (sight.points, sight.normals, sight.along_x, sight.along_y)
        self._seen = np.concatenate([*(part.T for part in parts), ambient_irradiance(sight, scene)[None]])
        self._confusion, self._at = sight.confusion, at
        return at


def _holds(outer: Window, inner: Window) -> bool:
    """Whether a window lies in another one of the same bins."""
    below = inner.row + inner.height * inner.side <= outer.row + outer.height * outer.side
    beside = inner.column + inner.width * inner.side <= outer.column + outer.width * outer.side
    return inner.side == outer.side and inner.row >= outer.row and inner.column >= outer.column and below and beside
