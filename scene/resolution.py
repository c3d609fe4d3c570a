"""How many pixels a frame has: a square's side, or width and height."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import BeforeValidator, Field

from conespot.scene.model import Text

#: pixels a side
FEWEST, MOST = 16, 20000


def _resolution(value: object) -> object:
    """A pair for [width, height] and "1920x1080"; a square's side alone, so that it has one address."""
    if isinstance(value, str) and (match := re.fullmatch(r"\s*(\d+)\s*[xX×]\s*(\d+)\s*", value)):
        value = [int(match[1]), int(match[2])]
    if not isinstance(value, (list, tuple)):
        return value
    whole = len(value) == 2 and all(type(side) is int and FEWEST <= side <= MOST for side in value)
    if not whole:
        raise ValueError(f"give pixels a side, or [width, height], from {FEWEST} to {MOST}, got {list(value)!r}")
    return value[0] if value[0] == value[1] else tuple(value)


_Side = Annotated[int, Field(ge=FEWEST, le=MOST)]
#: pixels a side, or (width, height) [px]
Resolution = Annotated[_Side | tuple[_Side, _Side], BeforeValidator(_resolution), Text(r"^\s*\d+\s*[xX×]\s*\d+\s*$")]
