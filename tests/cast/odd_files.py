"""What stands in a frame's place and is none: pipes, devices, loops, bombs, and files of other kinds under its name."""

from __future__ import annotations

import io
import os
import struct
import zlib
from pathlib import Path

import av
import numpy as np
import zstandard
from PIL import Image

#: bytes that a bomb unpacks to, from a thousandth of them
BOMB = 4_000_000_000
_UNPACKED = 200_000_000


def odd_files(folder: Path, side: tuple[int, int]) -> list[Path]:
    """Paths of all of them, written into a folder; bombs claim to be frames of `side` (columns and rows)."""
    (folder / "folder.png").mkdir()
    (folder / "within.png").mkdir()
    (folder / "within.png" / "folder.tiff").mkdir()
    (folder / "empty").mkdir()
    for name, target in {
        "loop.png": "loop.png",
        "zero.png": "/dev/zero",
        "zero.mkv": "/dev/zero",
        "no.exr": "no",
    }.items():
        (folder / name).symlink_to(target)
    for name in ("pipe.png", "pipe.mkv", "pipe.mcap"):
        os.mkfifo(folder / name)
    for ending in ("png", "jpg", "tiff", "exr", "mp4", "mkv", "mcap"):
        (folder / f"nothing.{ending}").touch()
        (folder / f"words.{ending}").write_text("no picture\n" * 99)
    (folder / "list.mkv").write_text("#EXTM3U\n/etc/passwd\n")
    Path(os.fsdecode(os.fsencode(folder) + b"/\xff\xfe.png")).write_bytes(b"\x89PNG\r\n\x1a\n")
    grey = np.full(side[::-1], 7, np.uint8)
    other = [Image.fromarray(grey + np.uint8(1))]
    Image.fromarray(grey).save(folder / "moving.png", save_all=True, append_images=other)
    Image.fromarray(grey).save(folder / "moving.gif", save_all=True, append_images=other)
    for ending in ("bmp", "webp", "jp2"):
        Image.fromarray(grey).save(folder / f"picture.{ending}")
    _audio(folder / "sound.mkv")
    _audio(folder / "sound.mp4", "aac", "fltp")
    for name, data in _bombs(side).items():
        (folder / name).write_bytes(data)
    return sorted(path for path in folder.iterdir())


def _audio(path: Path, codec: str = "pcm_s16le", kind: str = "s16") -> None:
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=8000)
        stream.layout = "mono"
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.int16 if kind == "s16" else np.float32), kind, "mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
        container.mux(stream.encode())


def _zeros() -> bytes:
    """`BOMB` zeros, deflated: one block again and again."""
    block, count = 10_000_000, BOMB // 10_000_000
    packer = zlib.compressobj(9)
    packed = packer.compress(bytes(block)) + packer.flush(zlib.Z_FULL_FLUSH)
    last = zlib.compressobj(9, wbits=-15)
    end = last.compress(b"") + last.flush()
    return packed[:2] + packed[2:] * count + end + struct.pack(">I", (block * count % 65521) << 16 | 1)


def _bombs(side: tuple[int, int]) -> dict[str, bytes]:
    columns, rows = side
    zeros = _zeros()
    plain = zlib.compress(bytes(rows * (columns + 1)))
    head = chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 0, 0, 0, 0))
    bombs = {
        "bomb_data.png": chunk(b"IDAT", zeros),
        "bomb_text.png": chunk(b"zTXt", b"c\0\0" + zeros) + chunk(b"IDAT", plain),
        "bomb_profile.png": chunk(b"iCCP", b"c\0\0" + zeros) + chunk(b"IDAT", plain),
        "bomb_exif.png": chunk(b"eXIf", bytes(6_000_000)) + chunk(b"IDAT", plain),
    }
    pngs = {name: b"\x89PNG\r\n\x1a\n" + head + data + chunk(b"IEND", b"") for name, data in bombs.items()}
    # pages that begin each other: the last points to the first
    tags = {256: columns, 257: rows, 258: 8, 259: 8, 262: 1, 273: 200, 277: 1, 278: rows, 279: len(zeros)}
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags.items())
    tiff = struct.pack("<2sHIH", b"II", 42, 8, len(tags)) + entries
    return {
        **pngs,
        "bomb.tiff": (tiff + bytes(4)).ljust(200, b"\0") + zeros,
        "round.tiff": (tiff + struct.pack("<I", 8)).ljust(200, b"\0") + plain,
        "scans.jpg": _scans(side),
        "bomb.mcap": _recording(bytes(_UNPACKED), _UNPACKED),
        "lie.mcap": _recording(bytes(_UNPACKED), 1000),
    }


def _scans(side: tuple[int, int]) -> bytes:
    """A progressive JPEG whose last scan stands there again and again."""
    whole = io.BytesIO()
    Image.fromarray(np.zeros(side[::-1], np.uint8)).save(whole, "JPEG", progressive=True)
    data = whole.getvalue()[:-2]
    scan = data[data.rindex(b"\xff\xda") :]
    return data + scan * 300_000 + b"\xff\xd9"


def _recording(data: bytes, said: int) -> bytes:
    """An MCAP whose only chunk unpacks to `data`, of which it says another length."""

    def record(kind: int, data: bytes) -> bytes:
        return struct.pack("<BQ", kind, len(data)) + data

    def text(words: str) -> bytes:
        return struct.pack("<I", len(words)) + words.encode()

    magic = b"\x89MCAP0\r\n"
    packed = zstandard.ZstdCompressor(level=1).compress(data)
    part = struct.pack("<QQQI", 0, 1, said, 0) + text("zstd") + struct.pack("<Q", len(packed)) + packed
    ends = record(1, text("ros2") + text("odd")), record(2, struct.pack("<QQI", 0, 0, 0))
    return magic + ends[0] + record(6, part) + ends[1] + magic


def chunk(kind: bytes, data: bytes) -> bytes:
    """A chunk of a PNG."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
