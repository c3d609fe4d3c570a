"""A key in words, for `campaign explain` and the reference: meaning, unit, default, source and bounds."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, get_args

from annotated_types import Ge, Gt, Le, Lt
from pydantic import BaseModel

from conespot.campaigns.key_paths import Key
from conespot.scene.identity import defaults
from conespot.scene.keys import meaning, quantity_of
from conespot.scene.model import Words
from conespot.scene.quantity import UNITS, format_quantity


def kind_of(model: type[BaseModel]) -> str:
    """The word that `kind` has in a description; empty where it has no kinds."""
    field = model.model_fields.get("kind")
    return "" if field is None else str(get_args(field.annotation)[0])


def details(key: Key) -> Iterator[str]:
    """What a key means, its unit, default, source, bounds and words, a line each."""
    said = meaning(key.model, key.name)
    yield said.means
    kind = quantity_of(key.field)
    others = ", ".join(unit for unit in UNITS.get(kind, ()) if unit != said.unit)
    if said.unit:
        yield f"unit     {said.unit}{f' (also {others})' if others else ''}"
    yield f"default  {default_words(key)}"
    if said.source:
        yield f"source   {said.source}"
    if bounds := bounds_words(key):
        yield f"allowed  {bounds}"
    if words := [word for part in key.field.metadata if isinstance(part, Words) for word in part.known()]:
        yield f"words    {', '.join(words)}"


def default_words(key: Key) -> str:
    """What a key is if it is not given, as a file has it."""
    if key.field.is_required():
        return "none, it must be given"
    written = defaults(key.model)
    if key.name not in written:  # a description may leave out what is nothing, as a source's diameter of 0
        return format_quantity(key.field.default, quantity_of(key.field))
    value = written[key.name]
    return "not given" if value is None else in_a_line(value)


def in_a_line(value: Any) -> str:
    """Plain data as YAML's flow style has it, without what is not given."""
    match value:
        case dict():
            return "{" + ", ".join(f"{k}: {in_a_line(v)}" for k, v in value.items() if v is not None) + "}"
        case list() | tuple():
            return "[" + ", ".join(map(in_a_line, value)) + "]"
        case str():
            return value or "''"
        case _:
            return json.dumps(value)


def bounds_words(key: Key) -> str:
    """What a key may be: the bounds of its number, or its choices; empty where any value will do."""
    kind = quantity_of(key.field)

    def limit(value: object) -> str:
        assert isinstance(value, (int, float)), "numbers alone have bounds here"
        return format_quantity(value, kind) if kind else f"{value:g}"

    parts = []
    for part in key.field.metadata:
        match part:
            case Gt(low):
                parts.append(f"above {limit(low)}")
            case Ge(low):
                parts.append(f"from {limit(low)}")
            case Lt(high):
                parts.append(f"below {limit(high)}")
            case Le(high):
                parts.append(f"to {limit(high)}")
    return ", ".join(parts) or ", ".join(arg for arg in get_args(key.field.annotation) if isinstance(arg, str))
