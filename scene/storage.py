"""How the camera's frames lie in files, as far as neither the files nor the sensor say it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from conespot.scene.model import Model


class Storage(Model):
    """What a reader of frames must be told, since a guess would be wrong in silence.

    `alignment` says where a sensor of 9 to 15 bits has its value in the 16 of a file: in the lower bits (12 bits end at
    4095), or `left`, in the upper ones (they end at 65520 or 65535). A frame is turned upright as its file says (EXIF
    orientation, a video's display matrix), and then by `turned` [deg, clockwise] and `mirrored` (left for right).
    `channel` is the one of a colour file that a grey sensor's scene means. `white` is the float value that is white,
    `matrix` what makes colours of a video's luma and chroma. With `profile: ignored` a file's own word on its transfer
    (sRGB, gamma, a colour profile) does not count.
    """

    alignment: Literal["right", "left"] = "right"
    turned: Literal[0, 90, 180, 270] = 0
    mirrored: bool = Field(False, strict=True)
    channel: Literal["red", "green", "blue"] | None = None
    white: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] | None = None
    matrix: Literal["bt601", "bt709"] | None = None
    profile: Literal["obeyed", "ignored"] = "obeyed"
