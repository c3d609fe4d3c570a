"""Content addresses: equal for equal descriptions, whatever file they came from and however it is written.

What counts is what differs from the defaults, under a version of what they mean: a new key with a default changes no
address, and one that is raised changes all.
"""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

#: raised when a default changes, or what a key does; not for a new key whose default does what was done before
SCHEMA = 1

Part = BaseModel | Mapping[str, Any] | str | int | float | None


def identity(*parts: Part) -> str:
    """The content address of descriptions [16 hex digits], and of plain data as it is, under `SCHEMA`."""
    return digest([SCHEMA, *(essence(part) if isinstance(part, BaseModel) else part for part in parts)])


def digest(data: Any) -> str:
    """The content address of plain data [16 hex digits], whatever version reads it."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def essence(description: BaseModel) -> dict[str, Any]:
    """A description as plain data, without the keys that hold their default and the files its points came from.

    What a file would hold is compared, to twelve digits: 9 deg read from one is not the float that stands in the code.
    """
    found: dict[str, Any] = _essence(description, description.model_dump(mode="json"))
    return found


def _essence(value: object, written: Any) -> Any:
    if isinstance(value, BaseModel):
        default = defaults(type(value))
        # a kind is never left out: two kinds with nothing but defaults would be one
        return {
            name: _essence(getattr(value, name), plain)
            for name, plain in written.items()
            if (name == "kind" or name not in default or plain != default[name])
            and not (name == "file" and written.get("points"))
        }
    if isinstance(value, dict):
        return {name: _essence(item, written[name]) for name, item in value.items()}
    if isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
        return [_essence(item, plain) for item, plain in zip(value, written, strict=True)]
    return written


@functools.cache
def defaults(kind: type[BaseModel]) -> dict[str, Any]:
    """What a file would hold of the keys of a description that have a default."""
    values = {n: f.get_default(call_default_factory=True) for n, f in kind.model_fields.items() if not f.is_required()}
    return kind.model_construct(**values).model_dump(mode="json", include=set(values))
