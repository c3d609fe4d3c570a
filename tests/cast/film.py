"""Videos for tests, cast from arrays."""

import av
import numpy as np


def write_film(path, frames, codec="ffv1", pixels="gray", rate=30, color_range=None, colorspace=None):
    """Frames `[H, W]` of uint8, or uint16 of 12 bits, or `[H, W, 3]` RGB, as a video."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=rate)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = pixels
        if color_range is not None:
            stream.codec_context.color_range = color_range
        if colorspace is not None:
            stream.codec_context.colorspace = colorspace
        for image in frames:
            kind = "rgb24" if image.ndim == 3 else "gray" if image.dtype == np.uint8 else "gray12le"
            container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format=kind)))
        container.mux(stream.encode())
    return path
