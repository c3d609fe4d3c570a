"""The channels of an EXR file that a stranger may have made: what it claims is checked before it is unpacked."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from conespot.scene.hushed import hushed

#: what a file may claim: pixels a side, channels, values a byte (ZIP packs 258, no more)
_MOST_PIXELS, _MOST_CHANNELS, _MOST_SAMPLES = 20_000, 16, 300


def read_exr(
    path: Path, check: Callable[[int, int], None] | None = None
) -> tuple[dict[str, NDArray[np.floating[Any]]], dict[str, object]]:
    """Channels `[H, W]` by name, and the header, of a file that holds one image.

    `check` is called with rows and columns before anything is unpacked, and may raise. Raises ValueError, without the
    path, for another file, or one that claims more than its bytes can hold.
    """
    import OpenEXR

    if not path.is_file():
        raise ValueError("no such file")
    try:
        with hushed() as heard:
            with OpenEXR.File(os.fsencode(path), header_only=True) as file:
                if len(file.parts) != 1:
                    raise ValueError("it holds several images")
                low, high = (np.asarray(corner, float) for corner in file.header()["dataWindow"])
                channels = len(file.header()["channels"])
            width, height = (int(side) for side in high - low + 1.0)
            if not (1 <= width <= _MOST_PIXELS and 1 <= height <= _MOST_PIXELS and 1 <= channels <= _MOST_CHANNELS):
                raise ValueError(f"{width} x {height} px of {channels} channels are no camera's")
            if width * height * channels > _MOST_SAMPLES * max(1, path.stat().st_size):
                raise ValueError(
                    f"{path.stat().st_size} bytes cannot hold {width} x {height} px of {channels} channels"
                )
            if check is not None:
                check(height, width)
            with OpenEXR.File(os.fsencode(path), separate_channels=True) as file:
                found = {name: np.asarray(channel.pixels) for name, channel in file.channels().items()}
                header = dict(file.header())
        if heard.text:  # it fills with zeros what it cannot read, and only says so
            raise ValueError(heard.text.removeprefix(f"{path}: "))
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, MemoryError, OverflowError) as error:
        raise ValueError(" ".join(str(error).split()) or type(error).__name__) from None
    return found, header
