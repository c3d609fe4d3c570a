"""What a video recorder makes of a camera's frame: eight bits, and what JPEG leaves of them."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.scene.sensor import Recorded

_CHROMA = {"4:2:0": cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420, "4:4:4": cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444}


def recorded(image: NDArray[Any], recorder: Recorded) -> NDArray[np.uint8]:
    """The codes `[H, W]` or `[H, W, 3]` (RGB) that are read back of a camera's values of that shape."""
    values = np.arange(recorder.camera.full_scale + 1) / recorder.camera.full_scale
    codes = np.floor(recorder.code(values) + 0.5).astype(np.uint8)[image]
    settings = [cv2.IMWRITE_JPEG_QUALITY, recorder.quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, _CHROMA[recorder.chroma]]
    colour = codes.ndim == 3
    _, file = cv2.imencode(".jpg", codes[..., ::-1] if colour else codes, settings)
    back = np.asarray(cv2.imdecode(file, cv2.IMREAD_COLOR if colour else cv2.IMREAD_GRAYSCALE), np.uint8)
    return back[..., ::-1] if colour else back
