"""The base of every description: frozen, complete, and helpful about a misspelt key."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, get_args

from pydantic import BaseModel, ConfigDict, GetCoreSchemaHandler, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema


class Model(BaseModel):
    """A frozen description. An unknown key is refused with the nearest known one."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True, allow_inf_nan=False)

    #: keys that a file may have in place of others, which they stand for
    stand_ins: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            known = cls.model_fields  # once: a journal has millions of keys
            for key, value in data.items():
                if key not in known:
                    raise unknown_key(str(key), [*known, *cls.stand_ins])
                if _holds_truth(value) and _is_number(known[key].annotation):
                    raise PydanticCustomError(
                        "no_number", "expected a number, got {value}", {"key": key, "value": str(value).lower()}
                    )
        return data


def _holds_truth(value: Any) -> bool:
    """Whether a value is `true` or `false`, or a list with such; pydantic would take them for 1 and 0."""
    return type(value) is bool or (type(value) in (list, tuple) and any(map(_holds_truth, value)))


def _is_number(annotation: Any) -> bool:
    """Whether a type is that of numbers, alone or in a list, and of no truth value."""
    kinds = list(_alone(annotation))
    return any(kind in (int, float) for kind in kinds) and bool not in kinds


def _alone(annotation: Any) -> Iterator[Any]:
    if not get_args(annotation):
        yield annotation
    for part in get_args(annotation):
        yield from _alone(part)


def unknown_key(key: str, known: list[str]) -> PydanticCustomError:
    """The error for a key that nothing reads; `key` in its context tells where it stands."""
    near = difflib.get_close_matches(key, known, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"known keys: {', '.join(known)}"
    return PydanticCustomError("unknown_key", "unknown key '{key}'; {hint}", {"key": key, "hint": hint})


def unknown_name(name: str, known: list[str], what: str) -> PydanticCustomError:
    """The error for a name (of a trajectory, a sensor, ...) that does not exist."""
    near = difflib.get_close_matches(name, known, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"
    return PydanticCustomError(
        "unknown_name", "unknown {what} '{name}'; {hint}", {"what": what, "name": name, "hint": hint}
    )


@dataclass(frozen=True, eq=False)
class Words:
    """Marks a type that a file may also give by a word alone, for whoever describes the types."""

    known: Callable[[], Iterable[str]]

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """One of the words, or what the type is else."""
        return {"anyOf": [{"enum": list(self.known())}, handler(schema)]}


@dataclass(frozen=True, eq=False)
class Text:
    """Marks a type that a file may also give as a text of a `pattern`, for whoever describes the types."""

    pattern: str

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """Such a text, or what the type is else."""
        return {"anyOf": [{"type": "string", "pattern": self.pattern}, handler(schema)]}


@dataclass(frozen=True, eq=False)
class Named(Words):
    """Lets a file name one of `choices` (a `what`) in place of writing it out."""

    choices: Mapping[str, Any]
    what: str

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Looks a word up before anything else is read."""
        return core_schema.no_info_before_validator_function(self._look_up, handler(source))

    def _look_up(self, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        if value not in self.choices:
            raise unknown_name(value, list(self.choices), self.what)
        return self.choices[value]


def named(known: Mapping[str, Any], what: str) -> Named:
    """Lets a file name one of `known` (a `what`) in place of writing it out."""
    return Named(lambda: known, known, what)
