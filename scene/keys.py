"""What the keys of descriptions mean: meaning, unit, where a default comes from. The table is data/keys.yaml."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Annotated, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from conespot.scene.document import read_document
from conespot.scene.quantity import WRITTEN, Quantity


@dataclass(frozen=True)
class Meaning:
    """What a key means, the unit of its numbers (empty for none), and where its default comes from."""

    means: str
    unit: str = ""
    source: str = ""


def meaning(model: type[BaseModel], key: str) -> Meaning:
    """What a key of a description means. Raises KeyError for one that the table lacks."""
    if key == "kind":
        return Meaning(f"which kind it is: {summary(model)}")
    said = _table()[_name(model)][key]
    found = Meaning(said) if isinstance(said, str) else Meaning(**said)
    kind = quantity_of(model.model_fields[key])
    return replace(found, unit=WRITTEN[kind]) if kind else found


def summary(model: type[BaseModel]) -> str:
    """The first sentence of a description's own documentation."""
    first = (model.__doc__ or "").strip().split("\n\n")[0]
    return " ".join(first.split()).removesuffix(".")


def known_keys() -> dict[str, set[str]]:
    """The keys that the table explains, by the name of their class."""
    return {name: set(keys) for name, keys in _table().items()}


def _name(model: type[BaseModel]) -> str:
    """A class' name in the table: with its module where another has the same."""
    longer = f"{model.__module__.rpartition('.')[2]}.{model.__name__}"
    return longer if longer in _table() else model.__name__


def quantity_of(field: FieldInfo) -> str:
    """The kind of quantity that a key holds, alone or in a list; empty for none."""
    return next(_quantities(field.annotation, field.metadata), "")


def _quantities(annotation: object, metadata: Sequence[object]) -> Iterator[str]:
    yield from (part.kind for part in metadata if isinstance(part, Quantity))
    for inner in get_args(annotation):
        base, *inside = get_args(inner) if get_origin(inner) is Annotated else (inner,)
        yield from _quantities(base, inside)


@functools.cache
def _table() -> dict[str, dict[str, str | dict[str, str]]]:
    return read_document(Path(str(resources.files("conespot.scene"))) / "data" / "keys.yaml").data
