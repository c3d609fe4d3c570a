"""What a validation finds wrong with plain data, as one sentence about the key where it stands."""

from __future__ import annotations

import difflib
import re
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from conespot.scene.quantity import in_unit_of

_OURS = {"unknown_key", "unknown_name", "no_number", "quantity", "value_error"}


def complaint(error: ValidationError, data: Any, at: tuple[str | int, ...] = ()) -> tuple[list[str | int], str]:
    """The keys that lead to the first thing wrong with what stands `at` some keys of `data`, and what it is."""
    first = error.errors()[0]
    keys: list[str | int] = list(at)
    here: Any = data
    for key in at:
        here = here[key]
    said_kind = False
    for part in first["loc"]:
        # a discriminated union adds the kind to the location, which is no key of the file
        if not said_kind and isinstance(here, dict) and here.get("kind") == part:
            said_kind = True
            continue
        inside = isinstance(here, dict) and part in here
        inside |= isinstance(here, (list, tuple)) and isinstance(part, int) and part < len(here)
        if inside:
            keys.append(part)
            here, said_kind = here[part], False
        elif first["type"] == "missing" and part == first["loc"][-1]:
            keys.append(part)
    if first["type"] in ("unknown_key", "no_number"):
        keys.append(first["ctx"]["key"])
    return keys, _sentence(first, here)


def _sentence(first: ErrorDetails, here: Any) -> str:
    said, context = first["msg"].removeprefix("Value error, "), first.get("ctx", {})
    match first["type"]:
        case "missing":
            return "is required but missing"
        case "union_tag_invalid":
            known = re.findall(r"'([^']*)'", context["expected_tags"])
            near = difflib.get_close_matches(context["tag"], known, n=1)
            hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"
            return f"unknown kind {short(context['tag'])}; {hint}"
        case "finite_number":
            return f"must be finite, got {short(first['input'])}"
        case "union_tag_not_found":
            return f"kind is required but missing, got {short(here)}"
        case "too_short":
            return f"holds {context['actual_length']} values and needs at least {context['min_length']}"
        case kind if kind in _OURS:
            return said
    said = re.sub(
        r" or (instance of \w+|object to extract fields from)", " of keys and values", f"{said[0].lower()}{said[1:]}"
    )
    written = first["input"] if isinstance(first["input"], (str, int, float)) else here
    bound = next(iter(context.values()), None)
    if isinstance(here, str) and isinstance(bound, float):
        # a bound reads best in the unit the value was written in
        said, written = f"{said.removesuffix(str(bound).removesuffix('.0'))}{in_unit_of(here, bound)}", here
    elif isinstance(here, (str, int, float)):
        written = here
    return f"{said}, got {short(written)}"


def short(value: object) -> str:
    """A value as it was written, no longer than a message can bear."""
    return cut(repr(value), 60)


def cut(text: str, longest: int = 200) -> str:
    """A text, or its beginning."""
    return text if len(text) <= longest else f"{text[: longest - 3]}..."
