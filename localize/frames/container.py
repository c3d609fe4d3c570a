"""How long a video's container says its file is, by the heads of its outermost parts: a file cut short says more.

FFmpeg reads a Matroska or raw video that was cut to its last whole frame, as if there had been no more.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from typing import BinaryIO

#: parts that are looked at: a fragmented MP4 of a day has so many
_MOST_PARTS = 100_000
#: Matroska's first element (RFC 9559, 4.5; EBML: RFC 8794, 11.2.1) and the one that holds the rest
_EBML, _SEGMENT = b"\x1a\x45\xdf\xa3", b"\x18\x53\x80\x67"
#: boxes that an ISO file may begin with (ISO 14496-12, 4.3; the others are QuickTime's)
_BOXES = (b"ftyp", b"moov", b"mdat", b"free", b"skip", b"wide", b"pnot")


def stated_bytes(file: BinaryIO) -> int | None:
    """Bytes that a Matroska, MP4, QuickTime or AVI file has by its own word; None where it says nothing.

    A live recording's Matroska and AVI, transport and program streams say nothing.
    """
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    part = _part(file.read(12))
    at = 0
    for _ in range(_MOST_PARTS if part else 0):
        if at >= size:
            break
        file.seek(at)
        assert part is not None
        length = part(file.read(16))
        if length is None:
            return None
        at += length
    file.seek(0)
    return at if part else None


def _part(first: bytes) -> Callable[[bytes], int | None] | None:
    """What tells a part's length, head and all, from its first 16 bytes, of a container that begins so."""
    if first.startswith(_EBML):
        return _element
    if first.startswith(b"RIFF") and first[8:] == b"AVI ":
        return _chunk
    return _box if first[4:8] in _BOXES else None


def _element(head: bytes) -> int | None:
    """Of EBML: an identifier and a size whose first bits say how many bytes they have (RFC 8794, 4 and 5)."""
    known = next((name for name in (_EBML, _SEGMENT, b"\xec") if head.startswith(name)), None)
    if known is None or len(head) <= len(known) or not head[len(known)]:
        return None
    width = 9 - head[len(known)].bit_length()
    said = head[len(known) : len(known) + width]
    size = int.from_bytes(said) & ((1 << 7 * width) - 1)
    # all ones: unknown, as of a live stream
    return None if len(said) < width or size == (1 << 7 * width) - 1 else len(known) + width + size


def _chunk(head: bytes) -> int | None:
    """Of RIFF: a name and a size, padded to an even one."""
    if len(head) < 8 or not head.startswith(b"RIFF"):
        return None
    size = int.from_bytes(head[4:8], "little")
    return None if size in (0, 0xFFFFFFFF) else 8 + size + size % 2


def _box(head: bytes) -> int | None:
    """Of ISO files: a size and a name; 1 where the size follows in 8 bytes, 0 where it goes on to the file's end."""
    if len(head) < 8 or not head[4:8].isalnum():
        return None
    size: int = struct.unpack(">I", head[:4])[0]
    if size == 1 and len(head) == 16:
        size = struct.unpack(">Q", head[8:])[0]
    return size if size >= 8 else None
