"""`campaign explain KEY`: what a key means, its unit, its default and where that comes from."""

from __future__ import annotations

import difflib
import functools
from collections.abc import Iterator
from typing import Any

from conespot.campaigns.key_paths import Key, keys_of
from conespot.campaigns.key_words import details, in_a_line, kind_of
from conespot.campaigns.schema import Campaign
from conespot.scene import InputError
from conespot.scene.document import read_document, shipped

#: keys of one name that are explained all at once
_MOST = 8


def explain(wanted: str) -> Iterator[str]:
    """Lines that explain a key: a dotted path, or its end. Raises InputError for one that nothing reads."""
    asked = tuple(wanted.strip().removeprefix("sweep.").split("."))
    known = _known()
    found = [path for path in known if path[-len(asked) :] == asked]
    found = [path for path in found if path == asked] or found
    if not found:
        ends = {".".join(path[-n:]) for path in known for n in range(1, len(path) + 1)}
        near = difflib.get_close_matches(wanted, sorted(ends), n=1)
        hint = (
            f"did you mean '{near[0]}'?" if near else "the outermost: " + ", ".join(k[0] for k in known if len(k) < 2)
        )
        raise InputError(f"{wanted}: no such key; {hint}")
    if len(found) > _MOST:
        yield f"{len(found)} keys are called {wanted}; name more of the path:"
        yield from (f"  {'.'.join(path)}" for path in found)
        return
    for i, path in enumerate(found):
        yield from [""] * (i > 0)
        yield from _explained(known[path])


@functools.cache
def _known() -> dict[tuple[str, ...], list[Key]]:
    """All keys by path; those of several kinds together."""
    found: dict[tuple[str, ...], list[Key]] = {}
    for key in keys_of(Campaign):
        found.setdefault(key.path, []).append(key)
    return found


def _explained(keys: list[Key]) -> Iterator[str]:
    """A key, once for every meaning that it has."""
    yield keys[0].dotted + (" (in each item of a list)" if keys[0].listed else "")
    said: dict[tuple[str, ...], list[str]] = {}
    for key in keys:
        said.setdefault(tuple(details(key)), []).append(kind_of(key.model))
    for lines, kinds in said.items():
        names = [kind for kind in kinds if kind]
        if names and (len(said) > 1 or len(names) > 1):
            yield f"  of kind {', '.join(names)}:"
        yield from (f"  {line}" for line in lines)
    if presets := _in_presets(keys[0].path):
        yield f"  presets  {presets}"
    below = dict.fromkeys(".".join(p) for p in _known() if p[: len(keys[0].path)] == keys[0].path and p != keys[0].path)
    direct = [name for name in below if name.count(".") == len(keys[0].path)]
    if direct:
        yield f"  holds    {', '.join(name.rpartition('.')[2] for name in direct)}"


def _in_presets(path: tuple[str, ...]) -> str:
    """What the shipped presets have there."""
    if path[0] != "scene" or len(path) < 2:
        return ""
    found: dict[str, list[str]] = {}
    for name, file in shipped("scene", "presets").items():
        value: Any = read_document(file).data
        for step in path[1:]:
            value = value.get(step) if isinstance(value, dict) else None
        if value is not None and not isinstance(value, dict):
            found.setdefault(in_a_line(value), []).append(name)
    return "; ".join(f"{value} in {', '.join(names)}" for value, names in found.items())
