"""A video, read as a stream by FFmpeg through PyAV (the extra `video`): one frame in memory at a time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from conespot.localize.frames.container import stated_bytes
from conespot.localize.frames.fit import as_camera
from conespot.localize.frames.stored import Pixels, Stored, Turn, check_size
from conespot.scene.document import InputError
from conespot.scene.scene import Scene

if TYPE_CHECKING:
    from av import VideoFormat, VideoFrame

#: by which a file is taken for a video
SUFFIXES = (".mp4", ".m4v", ".mov", ".mkv", ".webm", ".avi", ".mpg", ".mpeg", ".ts", ".mts", ".m2ts", ".y4m", ".mjpg")
#: containers that hold what they show: none of a list of addresses, which FFmpeg would follow
_CONTAINERS = "mov,matroska,webm,avi,mpeg,mpegts,yuv4mpegpipe,mjpeg"
#: bytes of a line of a raw video's text
_MOST_LINE = 1000
#: codes that a grey camera's chroma may be off the middle: rounding, and no colour
_GREY_CODES = 2
#: FFmpeg's numbers of colour matrices (ITU-T H.273, table 4)
_MATRICES = {1: "bt709", 5: "bt601", 6: "bt601"}


def read_video(path: Path, scene: Scene) -> Iterator[tuple[float | None, Stored]]:
    """Frames of the first video stream: time stamp [s], None where the file has none, and picture.

    Raises InputError without PyAV, for what is no video, is cut short by what its container says, another size than
    the camera's, damage, interlacing, and a pixel format that is not read.
    """
    try:
        import av
    except ImportError:
        raise InputError(f"{path}: videos need PyAV: pip install 'conespot[video]'") from None
    rows, columns = scene.camera.shape
    limits = {
        "format_whitelist": _CONTAINERS,
        "protocol_whitelist": "file",
        "max_pixels": str(4 * rows * columns + 1_000_000),
        "err_detect": "explode",
    }
    av.logging.set_level(None)
    try:
        _check_whole(path)
        with open(path, "rb") as file, av.open(file, "r", options=limits) as container:
            if not container.streams.video:
                raise InputError(f"{path}: holds no video stream")
            stream = container.streams.video[0]
            context = stream.codec_context
            if context is None:
                raise InputError(f"{path}: holds a video of a kind that FFmpeg cannot unpack")
            context.options = {**context.options, "err_detect": "explode", "max_pixels": limits["max_pixels"]}
            size = (context.height, context.width)
            if size not in (scene.camera.shape, scene.camera.shape[::-1]):  # which turn it has, its frames say
                check_size(str(path), *size, (Turn.stated(scene.storage),), scene)
            if container.format.name == "yuv4mpegpipe":
                _check_raw(path, context.format)
            number = -1
            for number, frame in enumerate(container.decode(stream)):
                yield frame.time, _stored(f"{path}, frame {number}", frame, scene)
            if number < 0:
                raise InputError(f"{path}: holds no whole frame; copy or record it again")
    except (av.FFmpegError, OSError, ValueError, MemoryError) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise InputError(f"{path}: cannot be read as a video: {reason}; copy or record it again") from None


def _check_whole(path: Path) -> None:
    """Raise InputError for a file that has fewer bytes than it says."""
    with open(path, "rb") as file:
        stated, size = stated_bytes(file), path.stat().st_size
    if not size:
        raise InputError(f"{path}: is empty; copy or record it again")
    if stated is not None and stated > size:
        raise InputError(
            f"{path}: is cut short: {size} bytes, where it says that it has at least {stated}; copy or record it again"
        )


def _check_raw(path: Path, pixels: VideoFormat | None) -> None:
    """Raise InputError for a file of raw frames (YUV4MPEG2) that does not end with a whole one."""
    if pixels is None:
        return
    frame = sum(part.width * part.height * ((part.bits + 7) // 8) for part in pixels.components)
    with open(path, "rb") as file:
        head = len(file.readline(_MOST_LINE))
        each = len(file.readline(_MOST_LINE)) + frame
    if (path.stat().st_size - head) % each:
        raise InputError(f"{path}: is cut short: it ends within a frame; copy or record it again")


def _stored(name: str, frame: VideoFrame, scene: Scene) -> Stored:
    """A frame's picture in its own codes, and what the stream says of them."""
    turn = Turn(round(-frame.rotation / 90.0) % 4)
    check_size(name, frame.height, frame.width, (turn, Turn.stated(scene.storage)), scene)
    if frame.is_corrupt:
        raise InputError(f"{name}: is damaged")
    if frame.interlaced_frame:
        raise InputError(f"{name}: is interlaced, two instants in one frame; deinterlace the video first")
    kind = frame.format
    bits = {component.bits for component in kind.components}
    if len(bits) != 1 or kind.is_big_endian or kind.has_palette or kind.is_bayer or kind.is_bit_stream:
        raise InputError(
            f"{name}: the pixel format {kind.name} is not read; give yuv420p, yuv444p, gray, gray12le or rgb24"
        )
    if kind.is_rgb:
        if bits != {8}:
            raise InputError(f"{name}: the pixel format {kind.name} is not read; give rgb24")
        return Stored(frame.to_ndarray(format="rgb24"), turn, span="full")
    span = _span(name, frame, scene)
    luma = _plane(frame, 0, bits.pop())
    if len(kind.components) == 1:
        return Stored(luma, turn, span=span)
    if luma.dtype != np.uint8:
        raise InputError(f"{name}: the pixel format {kind.name} is not read; give 8 bits, or gray12le and the like")
    if scene.storage.channel is None and not _colours(scene) and _is_grey(frame):
        return Stored(luma, turn, span=span)
    return Stored(_rgb(name, frame, span, scene), turn, span=span)


def _span(name: str, frame: VideoFrame, scene: Scene) -> Literal["full", "limited"]:
    """The range that the stream states, or the scene."""
    said: int = frame.color_range
    if said in (1, 2):
        return "limited" if said == 1 else "full"
    if frame.format.name.startswith("yuvj") or len(frame.format.components) == 1:
        return "full"
    stated = getattr(scene.sensor, "range", None)
    if stated is None:
        raise InputError(
            f"{name}: does not say whether its range is full or limited; write scene.sensor: {{kind: recorded, camera:"
            f" {as_camera(scene.sensor)}, range: limited}} (or full)"
        )
    return "limited" if stated == "limited" else "full"


def _colours(scene: Scene) -> bool:
    return scene.sensor.responses is not None and len(scene.sensor.responses) == 3


def _plane(frame: VideoFrame, index: int, bits: int) -> Pixels:
    """A plane's values `[H, W]`, without the padding of its lines."""
    plane = frame.planes[index]
    kind = np.uint8 if bits == 8 else np.uint16
    lines = np.frombuffer(bytes(plane), kind).reshape(plane.height, plane.line_size // np.dtype(kind).itemsize)
    return lines[:, : plane.width].copy()


def _is_grey(frame: VideoFrame) -> bool:
    """Whether the chroma of 8 bits says nothing."""
    for plane in list(frame.planes)[1:]:
        chroma = np.frombuffer(bytes(plane), np.uint8).reshape(plane.height, plane.line_size)
        width = plane.width * (2 if len(frame.planes) == 2 else 1)
        if np.abs(chroma[:, :width].astype(np.int16) - 128).max() > _GREY_CODES:
            return False
    return True


def _rgb(name: str, frame: VideoFrame, span: Literal["full", "limited"], scene: Scene) -> Pixels:
    """The colours `[H, W, 3]` in codes of the stream's range."""
    from av.video.reformatter import ColorRange, Colorspace

    matrix = _MATRICES.get(int(frame.colorspace)) or scene.storage.matrix
    if matrix is None:
        raise InputError(f"{name}: does not say its colour matrix; write scene.storage.matrix: bt709 (HD) or bt601")
    space = Colorspace.ITU709 if matrix == "bt709" else Colorspace.ITU601
    limited = span == "limited"
    found = frame.reformat(
        format="rgb48le" if limited else "rgb24",
        src_colorspace=space,
        dst_colorspace=space,
        src_color_range=ColorRange.MPEG if limited else ColorRange.JPEG,
        dst_color_range=ColorRange.JPEG,
    ).to_ndarray()
    if not limited:
        return np.asarray(found)
    # a frame of limited range shows its codes as they are (scene.sensor.Recorded), which FFmpeg stretches
    codes = np.floor(16.0 + 219.0 * np.arange(65536) / 65535.0 + 0.5).astype(np.uint8)
    return codes[found]
