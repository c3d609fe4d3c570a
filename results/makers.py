"""Who made the rows of a run, and how many of its poses: a run may go on on another machine, or with other software."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, TypeAdapter, ValidationError

from conespot.results.table import Block
from conespot.scene import InputError

FILE = "makers.json"
_MOST_BYTES = 1_000_000
_MOST_LINES = 100
_Makers = TypeAdapter(
    dict[Annotated[str, Field(max_length=500)], Annotated[int, Field(ge=0, le=1_000_000_000, strict=True)]]
)


def read_makers(folder: Path) -> dict[str, int]:
    """How many poses of a run each maker finished, by the line that names it; none if the run does not say.

    Raises InputError for a file that says something else.
    """
    path = folder / FILE
    if not path.is_file():  # a pipe would be waited for
        return {}
    try:
        with path.open("rb") as stream:
            return _Makers.validate_json(stream.read(_MOST_BYTES))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    except ValidationError:
        raise InputError(f"{path}: does not say how many poses each maker finished; remove it") from None


def maker_block(makers: dict[str, int]) -> Block | None:
    """The makers for the eye, who made most first."""
    ordered = sorted(makers.items(), key=lambda item: (-item[1], item[0]))
    lines = tuple((str(poses), maker or "not stated") for maker, poses in ordered[:_MOST_LINES])
    more = len(makers) - len(lines)
    notes = (f"{more} more makers stand in {FILE}.",) if more else ()
    return Block("", ("poses", "made with"), lines, notes) if lines else None
