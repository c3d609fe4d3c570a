"""A recording of ROS 2 in an MCAP file, read message by message (the extra `ros`); no ROS is needed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from conespot.localize.frames.still import still_of
from conespot.localize.frames.stored import Stored
from conespot.scene.document import InputError
from conespot.scene.scene import Scene

SUFFIX = ".mcap"
_KIND = "sensor_msgs/msg/CompressedImage"
#: bytes of an unpacked chunk; frames of a camera of this size are in chunks of a few megabytes
_MOST_CHUNK = 400_000_000


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
            reader = SeekingReader(
                stream, validate_crcs=True, record_size_limit=_MOST_CHUNK, decoder_factories=[DecoderFactory()]
            )
            for schema, channel, _, message in reader.iter_decoded_messages(log_time_order=True):
                if schema is None or schema.name != _KIND:
                    continue
                if topic not in (None, channel.topic):
                    raise InputError(f"{path}: holds images of {topic} and {channel.topic}; record one camera a file")
                topic = channel.topic
                stamp = message.header.stamp
                time = stamp.sec + 1e-9 * stamp.nanosec
                yield time, still_of(f"{path}, {topic} at {time:.6f} s", bytes(message.data), scene)
    except (McapError, OSError, ValueError, EOFError, MemoryError, KeyError, TypeError, IndexError) as error:
        raise InputError(f"{path}: cannot be read as MCAP: {' '.join(str(error).split())[:200]}") from None
    except Exception as error:  # what unpacks chunks has errors of its own
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: cannot be read as MCAP: {' '.join(str(error).split())[:200]}") from None
    if topic is None:
        raise InputError(f"{path}: holds no compressed image ({_KIND})")
