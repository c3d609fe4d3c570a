"""The base of every description: frozen, complete, and helpful about a misspelt key."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, model_validator
from pydantic_core import PydanticCustomError


class Model(BaseModel):
    """A frozen description. An unknown key is refused with the nearest known one."""

    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    @model_validator(mode="before")
    @classmethod
    def _known_keys(cls, data: Any) -> Any:
        if isinstance(data, dict):
            known = cls.model_fields  # once: a journal has millions of keys
            for key in data:
                if key not in known:
                    raise unknown_key(str(key), list(known))
        return data


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


def named(known: Mapping[str, Any], what: str) -> BeforeValidator:
    """Lets a file name one of `known` (a `what`) in place of writing it out."""

    def look_up(value: Any) -> Any:
        if not isinstance(value, str):
            return value
        if value not in known:
            raise unknown_name(value, list(known), what)
        return known[value]

    return BeforeValidator(look_up)
