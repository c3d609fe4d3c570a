"""A recording of ROS 2 in an MCAP file, read message by message (the extra `ros`); no ROS is needed."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from conespot.localize.frames.stamp import NANO, seconds
from conespot.localize.frames.still import most_bytes, still_of
from conespot.localize.frames.stored import Stored
from conespot.scene.document import InputError
from conespot.scene.scene import Scene

SUFFIX = ".mcap"
_KIND = "sensor_msgs/msg/CompressedImage"
#: bytes of a record, packed
_MOST_RECORD = 400_000_000
#: what MCAP's specification calls a chunk, and where its head says how many bytes it unpacks to
_CHUNK, _HEAD = 6, struct.Struct("<QQQII")
#: bytes before the first record
_BEGINNING = 8


def read_recording(path: Path, scene: Scene) -> Iterator[tuple[float, Stored]]:
    """Compressed images of the only topic that has some: time stamp of the header [s] and picture, in their order.

    Raises InputError without the extra, for what is no MCAP, several cameras, and pictures that are broken.
    """
    try:
        from mcap.exceptions import McapError
        from mcap.reader import SeekingReader
        from mcap_ros2.decoder import DecoderFactory
    except ImportError:
        raise InputError(f"{path}: recordings need mcap-ros2-support: pip install 'conespot[ros]'") from None
    topic: str | None = None
    try:
        with open(path, "rb") as stream:
            _check_chunks(stream, most_bytes(1, scene))
            reader = SeekingReader(
                stream, validate_crcs=True, record_size_limit=_MOST_RECORD, decoder_factories=[DecoderFactory()]
            )
            for schema, channel, _, message in reader.iter_decoded_messages(log_time_order=True):
                if schema is None or schema.name != _KIND:
                    continue
                if topic not in (None, channel.topic):
                    raise InputError(f"{path}: holds images of {topic} and {channel.topic}; record one camera a file")
                topic = channel.topic
                stamp = message.header.stamp
                time = seconds(stamp.sec * NANO + stamp.nanosec)
                yield time, still_of(f"{path}, {topic} at {time:.6f} s", bytes(message.data), scene)
    except (McapError, OSError, ValueError, EOFError, MemoryError, KeyError, TypeError, IndexError) as error:
        raise InputError(f"{path}: cannot be read as MCAP: {' '.join(str(error).split())[:200]}") from None
    except Exception as error:  # what unpacks chunks has errors of its own
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: cannot be read as MCAP: {' '.join(str(error).split())[:200]}") from None
    if topic is None:
        raise InputError(f"{path}: holds no compressed image ({_KIND})")


def _check_chunks(stream: BinaryIO, most: int) -> None:
    """Raise ValueError for a chunk that says, or whose packing says, that it unpacks to more than `most` bytes.

    Who unpacks it believes the packing. A chunk is about a megabyte, or one message where that is larger.
    """
    import lz4.frame
    import zstandard

    stream.seek(_BEGINNING)
    while len(head := stream.read(9)) == 9:
        kind, length = struct.unpack("<BQ", head)
        after = stream.tell() + length
        if kind == _CHUNK and len(first := stream.read(_HEAD.size)) == _HEAD.size:
            _, _, size, _, words = _HEAD.unpack(first)
            packing, packed = stream.read(min(words, 16)), stream.read(8) and stream.read(max(0, after - stream.tell()))
            if packing == b"zstd" and (said := zstandard.frame_content_size(packed)) >= 0:
                size = max(size, said)
            elif packing == b"lz4":
                size = max(size, len(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=most + 1)))
            if size > most:
                raise ValueError(f"a chunk unpacks to {size} bytes, more than a frame of this camera can have")
        stream.seek(after)
    stream.seek(0)
