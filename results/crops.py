"""The crops of a run: its worst frames, each with what a localizer saw in it. Hostile until validated, as a run is."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from conespot.results.overlay import Overlay, window
from conespot.scene import InputError

FILE = "crops.json"
_MOST_BYTES = 8_000_000
_MOST_CROPS = 1000
#: pixels a side of what is kept, at most
_SIDE_PX = 320
_QUALITY = 82
_MOST_POINTS = 96  #: of an outline
_BASE64 = r"^[A-Za-z0-9+/]*={0,2}$"

_Key = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
_Picture = Annotated[str, Field(max_length=200_000, pattern=_BASE64)]
_Line = Annotated[tuple[tuple[FiniteFloat, FiniteFloat], ...], Field(max_length=2000)]


class Crop(BaseModel):
    """A part of a frame around its patches, `side` x `side` px of the picture showing `span` px of the frame.

    `image` is a WebP and `mask` a PNG that is opaque where light was seen, both base64. `lines` are outlines in the
    picture's pixels by what they are: `true`, `found`, `fitted`.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    case: _Key
    localizer: Annotated[str, Field(min_length=1, max_length=200)]
    pose: Annotated[int, Field(ge=0, le=2**31 - 1)]
    width: Annotated[int, Field(ge=1, le=4000)]
    height: Annotated[int, Field(ge=1, le=4000)]
    span: Annotated[FiniteFloat, Field(gt=0.0, le=1e6)]
    image: _Picture
    mask: _Picture = ""
    lines: dict[str, Annotated[tuple[_Line, ...], Field(max_length=64)]] = {}

    @property
    def name(self) -> str:
        """What ties it to a row."""
        return f"{self.case}/{self.localizer}/{self.pose}"


class Crops(BaseModel):
    """The crops of a run: the `per_box` worst of each box, as far as there were frames enough to draw again.

    `left_out` frames are among the worst too and were not drawn.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    per_box: Annotated[int, Field(ge=0, le=1000)] = 0
    left_out: Annotated[int, Field(ge=0, le=1_000_000)] = 0
    crops: Annotated[tuple[Crop, ...], Field(max_length=_MOST_CROPS)] = ()


def read_crops(folder: Path) -> Crops:
    """The crops of a run folder; none if it has kept none. Raises InputError for a file that says something else."""
    path = folder / FILE
    if not path.is_file():  # a pipe would be waited for
        return Crops()
    try:
        with path.open("rb") as stream:
            data = stream.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise InputError(f"{path}: larger than {_MOST_BYTES // 1_000_000} MB; remove it")
        return Crops.model_validate_json(data)
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError:
        raise InputError(
            f"{path}: holds no crops of a run's frames; remove it, `campaign report` makes it anew"
        ) from None


def crop_of(case: str, localizer: str, pose: int, overlay: Overlay) -> Crop:
    """What is kept of an overlay: a small picture of what lies around its lines, mask and lines beside it."""
    left, top, right, bottom = window(overlay)
    scale = min(1.0, _SIDE_PX / max(right - left, bottom - top))
    size = max(1, round((right - left) * scale)), max(1, round((bottom - top) * scale))
    part = np.clip(overlay.image[top:bottom, left:right] / overlay.white, 0.0, 1.0)
    grey = np.asarray(255.0 * part).astype(np.uint8)
    shown = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    if shown.ndim == 3:
        shown = np.ascontiguousarray(shown[..., ::-1])
    mask = "" if overlay.mask is None else _mask(overlay.mask[top:bottom, left:right], size)
    return Crop(
        case=case,
        localizer=localizer,
        pose=pose,
        width=size[0],
        height=size[1],
        span=float(max(right - left, bottom - top)),
        image=_encoded(".webp", shown, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY]),
        mask=mask,
        lines=_lines(overlay.lines, np.array([left, top], float), scale),
    )


def _mask(mask: NDArray[np.bool_], size: tuple[int, int]) -> str:
    small = cv2.resize(mask.astype(np.uint8) * 255, size, interpolation=cv2.INTER_AREA)
    levels = np.zeros((*small.shape, 4), np.uint8)
    levels[..., :3] = (0, 200, 255)  # amber, in OpenCV's order
    levels[..., 3] = np.where(small > 127, 80, 0)
    return _encoded(".png", levels, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def _encoded(kind: str, image: NDArray[Any], options: Sequence[int]) -> str:
    done, data = cv2.imencode(kind, image, list(options))
    assert done, f"OpenCV writes no {kind}"
    return base64.b64encode(data.tobytes()).decode("ascii")


def _lines(
    lines: Mapping[str, Sequence[NDArray[np.float64]]], corner: NDArray[np.float64], scale: float
) -> dict[str, tuple[tuple[tuple[float, float], ...], ...]]:
    found = {}
    for what, outlines in lines.items():
        some = [points[:: max(1, -(-len(points) // _MOST_POINTS))] for points in outlines if len(points)]
        placed = [np.round((points - corner) * scale, 1).tolist() for points in some]
        found[what] = tuple(tuple((float(x), float(y)) for x, y in points) for points in placed)
    return found
