"""The keys that a campaign may hold, each by its dotted path, and the description that reads it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

#: in a path, for a name of one's own
ANY_NAME = "NAME"


@dataclass(frozen=True)
class Key:
    """A key: its `path`, the description that reads it, and whether it stands in the items of a list."""

    path: tuple[str, ...]
    model: type[BaseModel]
    listed: bool

    @property
    def name(self) -> str:
        """Its name within its description."""
        return self.path[-1]

    @property
    def field(self) -> FieldInfo:
        """What pydantic knows of it."""
        return self.model.model_fields[self.name]

    @property
    def dotted(self) -> str:
        """Its path as `--set` and `sweep:` have it."""
        return ".".join(self.path)


def keys_of(model: type[BaseModel], path: tuple[str, ...] = (), listed: bool = False) -> Iterator[Key]:
    """The keys of a description and of all below it, top down; a key of several kinds comes once for each of them."""
    for name, field in model.model_fields.items():
        key = Key((*path, name), model, listed)
        yield key
        for inner, steps, in_list in _models(field.annotation):
            yield from keys_of(inner, (*key.path, *steps), listed or in_list)


def models_of(model: type[BaseModel]) -> dict[str, type[BaseModel]]:
    """A description and all below it, by the names that pydantic's JSON Schema gives them."""
    found = {key.model for key in keys_of(model)} | {model}
    names = [kind.__name__ for kind in found]
    return {
        kind.__name__
        if names.count(kind.__name__) == 1
        else f"{kind.__module__}.{kind.__name__}".replace(".", "__"): kind
        for kind in found
    }


def _models(annotation: object) -> Iterator[tuple[type[BaseModel], tuple[str, ...], bool]]:
    """The descriptions in an annotation, the steps to them, and whether they are items of a list."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation, (), False
        return
    origin = get_origin(annotation)
    for inner in get_args(annotation):
        for model, steps, in_list in _models(inner):
            yield model, (ANY_NAME, *steps) if origin is dict else steps, in_list or origin is tuple
