"""Images and videos as a stranger may have them: whole, broken, cut off, mislabelled, or huge by their header."""

from __future__ import annotations

import functools
import random
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from film import write_film
from mutants import mutated_bytes
from odd_files import chunk, odd_files
from PIL import Image

from conespot.scene import Scene

SIDE = (60, 40)  # columns and rows
#: what a scene must say of the sensor for a file to fit, by the file
SENSORS = {
    "eight.png": {"kind": "srgb8"},
    "twelve.png": {"kind": "linear", "bits": 12},
    "colour.png": {"kind": "srgb8", "colour": True},
    "eight.jpg": {"kind": "srgb8"},
    "turned.jpg": {"kind": "srgb8"},
    "twelve.tiff": {"kind": "linear", "bits": 12},
    "float.tiff": {"kind": "linear", "bits": 12},
    "light.exr": {"kind": "linear", "bits": 12},
    "film.mkv": {"kind": "srgb8"},
    "film.mp4": {"kind": "recorded", "camera": "srgb8", "range": "limited"},
    "film.avi": {"kind": "srgb8"},
}


def scene_of(name: str) -> Scene:
    """The scene that a whole file fits."""
    return Scene.model_validate({"camera": {"resolution": list(SIDE)}, "sensor": SENSORS[name]})


def settings_of(name: str) -> list[str]:
    """The same for the command, on the preset `paper`."""
    sensor = ", ".join(f"{key}: {str(value).lower()}" for key, value in SENSORS[name].items())
    return ["--set", f"scene.camera.resolution={list(SIDE)}", "--set", f"scene.sensor={{{sensor}}}"]


@functools.cache
def whole_files(folder: Path) -> dict[str, bytes]:
    """Every file of `SENSORS`, whole."""
    import OpenEXR

    rng = np.random.default_rng(1)
    deep = rng.integers(0, 4096, SIDE[::-1], dtype=np.uint16)
    grey = (deep >> 4).astype(np.uint8)
    exif = Image.Exif()
    exif[274] = 3
    Image.fromarray(grey).save(folder / "turned.jpg", exif=exif)
    pictures = {
        "eight.png": grey, "twelve.png": deep, "colour.png": np.stack([grey, grey[::-1], 255 - grey], axis=-1),
        "eight.jpg": grey, "twelve.tiff": deep, "float.tiff": np.asarray(deep / 4095.0, np.float32),
    }  # fmt: skip
    for name, picture in pictures.items():
        cv2.imwrite(str(folder / name), picture)
    with OpenEXR.File({}, {"Y": np.asarray(deep / 4095.0, np.float32)}) as file:
        file.write(str(folder / "light.exr"))
    write_film(folder / "film.mkv", [grey] * 4)
    write_film(folder / "film.mp4", [grey] * 4, "libx264", "yuv420p")
    write_film(folder / "film.avi", [grey] * 4, "mjpeg", "yuvj420p")
    return {name: (folder / name).read_bytes() for name in SENSORS}


@functools.cache
def huge_files() -> dict[str, bytes]:
    """Files that claim, or truly hold, far more pixels than any scene here: kilobytes on the disk."""
    side = 12_000
    rows = zlib.compress(bytes(side + 1) * 2000, 9)  # honest about its first 2,000 rows
    head = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in ((b"IHDR", head), (b"IDAT", rows), (b"IEND", b"")))
    tags = {256: side, 257: side, 258: 16, 259: 1, 262: 1, 273: 8, 277: 1, 278: side, 279: 2 * side * side}
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags.items())
    tiff = struct.pack("<2sHIH", b"II", 42, 8, len(tags)) + entries + bytes(4)
    size = struct.pack(">BHHBBBB", 8, side, side, 1, 1, 17, 0)
    jpeg = b"\xff\xd8\xff\xc0" + struct.pack(">H", len(size) + 2) + size + b"\xff\xd9"
    return {"huge.png": png, "huge.tiff": tiff, "huge.jpg": jpeg}


@functools.cache
def _odd(folder: Path) -> list[Path]:
    place = folder / "odd"
    place.mkdir()
    return odd_files(place, SIDE)


def strangers_file(folder: Path, moment: random.Random) -> tuple[Path, str]:
    """A file that is written into a folder, and the name of the whole one whose scene it should fit."""
    whole = whole_files(folder)
    name = moment.choice(list(whole))
    data, ending = whole[name], name.rpartition(".")[2]
    if moment.random() < 0.15:
        return moment.choice(_odd(folder)), name
    match moment.randrange(8):
        case 0:
            data = data[: moment.randrange(len(data))]
        case 1:
            ending = moment.choice(list(whole)).rpartition(".")[2]
        case 2:
            huge = moment.choice(list(huge_files()))
            data, ending = huge_files()[huge], huge.rpartition(".")[2]
        case 3:  # where sizes and types stand
            data = mutated_bytes(data[:400], moment) + data[400:]
        case 4:
            data = whole[moment.choice(list(whole))]  # of another scene
        case _:
            data = mutated_bytes(data, moment)
    path = folder / f"x.{ending}"
    path.write_bytes(data)
    return path, name
