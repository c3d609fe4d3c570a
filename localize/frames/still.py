"""Pictures from a file: PNG, TIFF, JPEG or EXR, known by its first bytes, of 8 to 16 bits or float.

Pillow reads the headers of PNG and JPEG, and JPEG, OpenCV unpacks PNG and TIFF with all their bits, OpenEXR reads EXR.
"""

from __future__ import annotations

import io
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from conespot.localize.frames.stored import Pixels, Stored, Transfer, Turn, check_size
from conespot.localize.frames.tiff import Page, pages_of, turn_to
from conespot.scene.document import InputError
from conespot.scene.exr import read_exr
from conespot.scene.hushed import hushed
from conespot.scene.scene import Scene
from conespot.scene.text_file import read_bytes

#: what a file's first bytes say it is
MAGIC = {
    b"\x89PNG\r\n\x1a\n": "PNG",
    b"\xff\xd8\xff": "JPEG",
    b"II*\0": "TIFF",
    b"MM\0*": "TIFF",
    b"II+\0": "BigTIFF",
    b"MM\0+": "BigTIFF",
    b"\x76\x2f\x31\x01": "EXR",
}
#: bytes of a file a pixel of the frame, and beside: four floats, twice, and room for what cameras write into headers
_MOST_BYTES, _BESIDE_BYTES = 32, 8_000_000
#: bytes of a TIFF of several pages: it is held in memory, twice for a moment
_MOST_STACK_BYTES = 400_000_000
_ORIENTATION = 274
#: bytes of a PNG's data that are unpacked within a second or two whatever they hold
_FEW_PACKED = 200_000
#: what begins a scan of a JPEG, and how many there may be: an encoder makes ten, a thumbnail one more
_SCAN, _MOST_SCANS = b"\xff\xda", 64
#: where a PNG's first chunk says how many bits a value has, and of which colours it is
_PNG_BITS, _PNG_COLOUR = 24, 25
_TIFF_KINDS = {0: "white is zero", 3: "a palette", 4: "a mask", 5: "CMYK", 6: "YCbCr", 8: "CIELAB"}


def kind_of(path: Path) -> str | None:
    """`PNG`, `JPEG`, `TIFF`, `BigTIFF` or `EXR` by a file's first bytes; None for what is none of them.

    Raises InputError for a file that cannot be read.
    """
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: is a pipe or a device; give a file")
    try:
        with open(path, "rb") as file:
            first = file.read(8)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    return next((kind for magic, kind in MAGIC.items() if first.startswith(magic)), None)


def read_stills(path: Path, kind: str, scene: Scene) -> Iterator[tuple[str, Stored]]:
    """The pictures in a file of a `kind` with their names: one, or of a TIFF as many as it has pages.

    Raises InputError for a file that is broken, and for a picture that is not of the camera's size: of all pages before
    the first is unpacked.
    """
    name = str(path)
    match kind:
        case "EXR":
            yield name, _exr(path, scene)
        case "BigTIFF":
            raise InputError(f"{name}: is a BigTIFF; save the frames as TIFFs below 400 MB, or as PNG")
        case "TIFF":
            yield from _stack(name, bytearray(_raw(path, _MOST_STACK_BYTES, scene)), scene)
        case _:
            yield name, _picture(name, kind, _raw(path, 0, scene), scene)


def _raw(path: Path, least: int, scene: Scene) -> bytes:
    """A file's bytes, of which a frame has a limit that is at `least` so many."""
    rows, columns = scene.camera.shape
    try:
        return read_bytes(path, max(least, most_bytes(1, scene)), f"frame of {columns} x {rows} px")
    except ValueError as error:
        raise InputError(str(error)) from None


def most_bytes(frames: int, scene: Scene) -> int:
    """Bytes of a file of so many frames."""
    rows, columns = scene.camera.shape
    return frames * rows * columns * _MOST_BYTES + _BESIDE_BYTES


def still_of(name: str, raw: bytes, scene: Scene) -> Stored:
    """The picture in the bytes of a PNG, JPEG or TIFF called `name`. Raises InputError as `read_stills` does."""
    kind = next((kind for magic, kind in MAGIC.items() if raw.startswith(magic)), None)
    rows, columns = scene.camera.shape
    if kind not in ("PNG", "JPEG", "TIFF") or len(raw) > most_bytes(1, scene):
        raise InputError(f"{name}: is no PNG, JPEG or TIFF of a frame of {columns} x {rows} px")
    return _picture(name, kind, raw, scene)


def _picture(name: str, kind: str, raw: bytes, scene: Scene) -> Stored:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow's remarks on headers
        match kind:
            case "PNG":
                return _png(name, raw, scene)
            case "JPEG":
                return _jpeg(name, raw, scene)
            case _:
                pages = _pages(name, raw, scene)
                if len(pages) > 1:
                    raise InputError(f"{name}: holds several pages, where one frame is due")
                return _page(name, raw)


def _png(name: str, raw: bytes, scene: Scene) -> Stored:
    from PIL import Image

    try:
        head = Image.open(io.BytesIO(raw), formats=["PNG"])
        turn = Turn.exif(head.getexif().get(_ORIENTATION, 1))
        size, transfer, several = head.size, _transfer(head.info), getattr(head, "n_frames", 1) > 1
    except Exception as error:  # whatever Pillow makes of a broken header
        raise _broken(name, "PNG", error) from None
    if several:
        raise InputError(f"{name}: is an animated PNG; save one frame a file")
    # of the header (PNG 1.2, 11.2.2): libpng would show fewer bits, and a palette, as 8 in silence
    if raw[_PNG_COLOUR] == 3 or raw[_PNG_BITS] < 8:
        said = "of a palette" if raw[_PNG_COLOUR] == 3 else f"of {raw[_PNG_BITS]} bits"
        raise InputError(f"{name}: is a PNG {said}; save it in grey or RGB, with 8 or 16 bits")
    check_size(name, size[1], size[0], (turn, Turn.stated(scene.storage)), scene)
    try:
        Image.open(io.BytesIO(raw), formats=["PNG"]).verify()  # every chunk's checksum: libpng would complain on stderr
    except Exception as error:
        raise _broken(name, "PNG", error) from None
    if _unpacks_beyond(raw, size):
        raise InputError(f"{name}: cannot be read as PNG: its data go on behind the last row")
    return Stored(_unpacked(name, "PNG", raw), turn, transfer)


def _unpacks_beyond(raw: bytes, size: tuple[int, int]) -> bool:
    """Whether a PNG, its chunks being whole, unpacks to more than a picture of `size` (columns, rows) has.

    libpng unpacks all of it before it returns: a megabyte may hold a thousand.
    """
    parts, at = [], 8
    while at < len(raw):
        end = at + 8 + int.from_bytes(raw[at : at + 4], "big")
        if raw[at + 4 : at + 8] == b"IDAT":
            parts.append(memoryview(raw)[at + 8 : end])
        at = end + 4
    if sum(map(len, parts)) < _FEW_PACKED:
        return False
    most = size[0] * size[1] * 8 + 16 * size[1] + 1000  # four values of 16 bits, and each row's filter, interlaced too
    packed, found = zlib.decompressobj(), 0
    try:
        for part in parts:
            found += len(packed.decompress(part, most + 1 - found))
            if found > most:
                return True
    except zlib.error:  # libpng says what
        return False
    return False


def _jpeg(name: str, raw: bytes, scene: Scene) -> Stored:
    from PIL import Image

    try:
        picture = Image.open(io.BytesIO(raw), formats=["JPEG"])
        turn, mode = Turn.exif(picture.getexif().get(_ORIENTATION, 1)), picture.mode
    except Exception as error:
        raise _broken(name, "JPEG", error) from None
    if mode not in ("L", "RGB"):
        raise InputError(f"{name}: is a JPEG in {mode}; save it in grey or RGB")
    check_size(name, picture.height, picture.width, (turn, Turn.stated(scene.storage)), scene)
    if (scans := raw.count(_SCAN)) > _MOST_SCANS:
        raise InputError(f"{name}: is a JPEG of {scans} scans, each of which is a picture to unpack; save it anew")
    try:
        pixels = np.asarray(picture)
    except Exception as error:
        raise _broken(name, "JPEG", error) from None
    return Stored(pixels, turn, _transfer(picture.info))


def _stack(name: str, raw: bytearray, scene: Scene) -> Iterator[tuple[str, Stored]]:
    """The pages of a TIFF, one unpacked at a time."""
    pages = _pages(name, raw, scene)
    if len(raw) > most_bytes(len(pages), scene):
        said = "a frame" if len(pages) == 1 else f"{len(pages)} frames"
        raise InputError(f"{name}: larger than {said} of {scene.camera.size_words} can be")
    for number, page in enumerate(pages):
        turn_to(raw, page)
        own = name if len(pages) == 1 else f"{name}, frame {number}"
        yield own, _page(own, raw)


def _page(name: str, raw: bytes | bytearray) -> Stored:
    # OpenCV takes the first page, and turns it upright by itself
    return Stored(_unpacked(name, "TIFF", raw))


def _pages(name: str, raw: bytes | bytearray, scene: Scene) -> list[Page]:
    try:
        pages = pages_of(raw)
    except ValueError as error:
        raise _broken(name, "TIFF", error) from None
    for number, page in enumerate(pages):
        own = name if len(pages) == 1 else f"{name}, frame {number}"
        if page.kind in _TIFF_KINDS:
            raise InputError(f"{own}: is a TIFF of {_TIFF_KINDS[page.kind]}; save it in grey or RGB, black as zero")
        if not page.bits <= {8, 16, 32, 64}:
            words = ", ".join(map(str, sorted(page.bits)))
            raise InputError(f"{own}: has {words} bits a value in its TIFF; save it with 8 or 16, or as 32-bit float")
        turns = (Turn.exif(page.orientation), Turn.stated(scene.storage))
        check_size(own, page.height, page.width, turns, scene)
    return pages


def _unpacked(name: str, kind: str, raw: bytes | bytearray) -> Pixels:
    try:
        with hushed():  # libpng and libtiff would complain on stderr too
            found = cv2.imdecode(np.frombuffer(raw, np.uint8), cv2.IMREAD_UNCHANGED)
    except (cv2.error, MemoryError) as error:
        raise _broken(name, kind, error) from None
    if found is None:
        raise _broken(name, kind, None)
    pixels: Pixels = np.asarray(found)
    if pixels.dtype not in (np.uint8, np.uint16, np.float32, np.float64):
        raise InputError(f"{name}: pixels of type {pixels.dtype} cannot be read; save 8 or 16 bits, or 32-bit float")
    if pixels.ndim == 3:
        pixels = pixels[..., 0] if pixels.shape[2] == 1 else pixels[..., [2, 1, 0, 3][: pixels.shape[2]]]
    return pixels


def _exr(path: Path, scene: Scene) -> Stored:
    stated = (Turn.stated(scene.storage),)
    try:
        found, header = read_exr(path, lambda rows, columns: check_size(str(path), rows, columns, stated, scene))
    except ValueError as error:
        raise _broken(str(path), "EXR", error) from None
    names = next((names for names in (["Y"], list("RGB"), ["C0", "C1", "C2"]) if set(names) <= set(found)), None)
    if names is None:
        said = ", ".join(sorted(found)[:8])
        raise InputError(f"{path}: has the channels {said}; give R, G and B, or Y alone, in one layer")
    picture = np.stack([found[name] for name in names], axis=-1)
    radiance = str(header.get("conespot.unit", "")).startswith("W")
    return Stored(picture[..., 0] if len(names) == 1 else picture, transfer="linear", radiance=radiance)


def _transfer(info: dict[Any, Any]) -> Transfer | None:
    """What a PNG's or a JPEG's header says of the transfer of its values."""
    if profile := info.get("icc_profile"):
        return "srgb" if b"sRGB" in bytes(profile).replace(b"\0", b"") else "other"
    if "srgb" in info:
        return "srgb"
    if "gamma" not in info:
        return None
    known: tuple[tuple[float, Transfer], ...] = ((1.0 / 2.2, "srgb"), (1.0, "linear"))
    return next((said for gamma, said in known if abs(float(info["gamma"]) - gamma) < 0.01), "other")


def _broken(name: str, kind: str, error: BaseException | None) -> InputError:
    reason = " ".join(str(error).split()) if error is not None and str(error) else "its data end early or are damaged"
    return InputError(f"{name}: cannot be read as {kind}: {reason[:200]}; copy or save it again")
