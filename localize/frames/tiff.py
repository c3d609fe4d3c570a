"""What the directories of a TIFF say of its pages (TIFF 6.0, section 2), as far as a frame needs to know."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np

#: pages of a file, and entries of a page's directory: cameras write about fifty
_MOST_PAGES, _MOST_ENTRIES = 10_000, 1_000
_WIDTH, _HEIGHT, _BITS, _KIND, _ORIENTATION = 256, 257, 258, 262, 274
#: of a value, by its type: BYTE, SHORT and LONG
_TYPES = {1: "u1", 3: "u2", 4: "u4"}
#: values of an entry that are looked at: one for each channel
_MOST_VALUES = 8


@dataclass(frozen=True)
class Page:
    """One page's directory."""

    at: bytes  #: where it begins, in the file's own words
    height: int
    width: int
    bits: frozenset[int]  #: of its channels
    kind: int  #: PhotometricInterpretation
    orientation: int  #: as EXIF has it


def pages_of(raw: bytes | bytearray) -> list[Page]:
    """The pages of a TIFF in their order. Raises ValueError for directories that are broken, or lead in a circle."""
    order = "<" if raw[:2] == b"II" else ">"
    pages: list[Page] = []
    seen: set[int] = set()
    at = bytes(raw[4:8])
    while any(at) or not pages:
        (start,) = _unpack(f"{order}I", at, 0)
        if start in seen:
            raise ValueError("a page leads back to one before it")
        if len(pages) == _MOST_PAGES:
            raise ValueError(f"it has more than {_MOST_PAGES} pages")
        seen.add(start)
        page, at = _page(raw, order, start, at)
        pages.append(page)
    return pages


def turn_to(raw: bytearray, page: Page) -> None:
    """Make a page the first of its file, which is the one that readers of a picture take."""
    raw[4:8] = page.at


def _page(raw: bytes | bytearray, order: str, start: int, at: bytes) -> tuple[Page, bytes]:
    """A page, and where the next one begins."""
    (count,) = _unpack(f"{order}H", raw, start)
    end = start + 2 + 12 * count
    if not 0 < count <= _MOST_ENTRIES or end + 4 > len(raw):
        raise ValueError("a page's directory is broken")
    entry = np.dtype([("tag", f"{order}u2"), ("type", f"{order}u2"), ("count", f"{order}u4"), ("value", "V4")])
    entries = np.frombuffer(raw, entry, count, start + 2)
    places = {int(tag): k for k, tag in enumerate(entries["tag"].tolist())}

    def values(tag: int, default: int | None = None) -> list[int]:
        if tag not in places:
            if default is None:
                raise ValueError(f"a page's directory has no tag {tag}")
            return [default]
        k = places[tag]
        kind, many = _TYPES.get(int(entries["type"][k])), int(entries["count"][k])
        if kind is None or not many:
            raise ValueError(f"a page's tag {tag} is of another type")
        number = np.dtype(order + kind)
        inside = start + 2 + 12 * k + 8
        if many * number.itemsize > 4:
            (inside,) = _unpack(f"{order}I", raw, inside)
        many = min(many, _MOST_VALUES)
        if inside + many * number.itemsize > len(raw):
            raise ValueError(f"a page's tag {tag} lies beyond the file")
        return [int(value) for value in np.frombuffer(raw, number, many, inside)]

    page = Page(
        at, values(_HEIGHT)[0], values(_WIDTH)[0], frozenset(values(_BITS, 1)), values(_KIND, 1)[0],
        values(_ORIENTATION, 1)[0],
    )  # fmt: skip
    return page, bytes(raw[end : end + 4])


def _unpack(form: str, raw: bytes | bytearray, at: int) -> tuple[int, ...]:
    try:
        return struct.unpack_from(form, raw, at)
    except struct.error:
        raise ValueError("its data end early") from None
