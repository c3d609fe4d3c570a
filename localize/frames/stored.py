"""A picture as its file holds it, and what the file says of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from conespot.scene.document import InputError
from conespot.scene.scene import Scene
from conespot.scene.storage import Storage

Pixels = NDArray[Any]
Transfer = Literal["srgb", "linear", "other"]


@dataclass(frozen=True)
class Turn:
    """How a picture becomes upright: mirrored left for right first, then `quarters` of a turn clockwise."""

    quarters: int = 0
    mirrored: bool = False

    @classmethod
    def exif(cls, orientation: int) -> Turn:
        """Of the EXIF tag 274, 1 to 8 (JEITA CP-3451, section 4.6.4); what is none of these says nothing."""
        known = {2: cls(0, True), 3: cls(2), 4: cls(2, True), 5: cls(3, True), 6: cls(1), 7: cls(1, True), 8: cls(3)}
        return known.get(orientation, cls())

    @classmethod
    def stated(cls, storage: Storage) -> Turn:
        """What a scene states, which turns first and mirrors then."""
        quarters = storage.turned // 90
        return cls(-quarters % 4 if storage.mirrored else quarters, storage.mirrored)

    def of(self, pixels: Pixels) -> Pixels:
        """The picture `[H, W, ...]` upright."""
        flipped = pixels[:, ::-1] if self.mirrored else pixels
        return np.ascontiguousarray(np.rot90(flipped, -self.quarters)) if self.mirrored or self.quarters else flipped

    def shape(self, shape: tuple[int, int]) -> tuple[int, int]:
        """Rows and columns of an upright picture, of those of the stored one or the other way round."""
        return shape if self.quarters % 2 == 0 else (shape[1], shape[0])


@dataclass(frozen=True, eq=False)
class Stored:
    """A picture `[H, W]`, `[H, W, 3]` (RGB) or `[H, W, 4]` (RGBA): uint8, uint16 or float, and what its file says.

    `transfer` is what its values are by the file's own word, `radiance` that they are [W m-2 sr-1], `span` the codes of
    a video that black and white have. None is not said.
    """

    pixels: Pixels
    turn: Turn = Turn()
    transfer: Transfer | None = None
    radiance: bool = False
    span: Literal["full", "limited"] | None = None


def check_size(name: str, rows: int, columns: int, turns: tuple[Turn, ...], scene: Scene) -> None:
    """Raises InputError for a stored size that, upright, is not the camera's: before anything is unpacked."""
    shape = (rows, columns)
    for turn in turns:
        shape = turn.shape(shape)
    if shape == scene.camera.shape:
        return
    size = f"{shape[1]} x {shape[0]} px" + (" once it is upright" if shape != (rows, columns) else "")
    hint = f"write scene.camera.resolution: [{shape[1]}, {shape[0]}] if that is the camera's whole frame"
    if shape == scene.camera.shape[::-1]:
        hint = "write scene.storage.turned: 90 deg, or 270 deg, if it lies on its side".replace(" deg", "")
    raise InputError(f"{name}: {size} do not fit scene.camera.resolution = {scene.camera.size_words}; {hint}")
