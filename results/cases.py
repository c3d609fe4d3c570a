"""The cases of a run as the run itself describes them (cases.jsonl), hostile until validated."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from conespot.scene import InputError
from conespot.scene.power import BothConventions

FILE = "cases.jsonl"
_MAX_BYTES = 500_000_000
_MAX_LINE = 4_000_000
_MAX_CASES = 10_000
_MAX_LOCALIZERS = 64
_MAX_LABELS = 200


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("must hold printable characters alone")
    return text


_Key = Annotated[str, Field(pattern=r"^[0-9a-f]{16}$")]
_Name = Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_printable)]
_Words = Annotated[str, Field(min_length=1, max_length=500), AfterValidator(_printable)]
_Count = Annotated[int, Field(ge=0, le=1_000_000_000)]


class _Told(BaseModel):
    """Plain data of a file: keys that a later version adds are left alone."""

    model_config = ConfigDict(frozen=True, extra="ignore")


class SceneWords(_Told):
    """What a reader of a number must know of the scene, in words."""

    radius: _Words
    edge: _Words
    power_convention: _Words
    transfer: _Words
    surface: _Words


class LocalizerWords(_Told):
    """What a reader of a number must know of a localizer, in words."""

    threshold: _Words
    ambiguity: _Words


def _physical(watts: BothConventions) -> BothConventions:
    if not all(math.isfinite(value) and value >= 0.0 for value in asdict(watts).values()):
        raise ValueError("must hold finite numbers that are not negative")
    return watts


class Case(_Told):
    """A case as its run describes it: what its rows are called, what it assumes, and all that was rendered.

    Cases with the same `frame` look at the same images. `labels` are the values of its rows' columns, `assumes` and
    `localizers` words for readers, `told` what the localizers are told beside the image. `told`, `trajectory` and
    `scene` are plain data, quantities with their units.
    """

    version: Annotated[int, Field(alias="schema", ge=1, le=1_000_000)]  #: of what the scene's keys and defaults mean
    key: _Key
    frame: _Key
    labels: Annotated[dict[_Name, _Name | FiniteFloat], Field(max_length=_MAX_LABELS)]
    localizers: Annotated[dict[_Name, LocalizerWords], Field(max_length=_MAX_LOCALIZERS)]
    assumes: SceneWords
    watts: Annotated[BothConventions, AfterValidator(_physical)]
    told: dict[str, Any] = {}
    trajectory: dict[str, Any] = {}
    poses: _Count
    samples: _Count
    edge_samples: _Count = 0
    bounds: bool = False
    scene: dict[str, Any]


def read_cases(folder: Path) -> dict[str, Case]:
    """The cases of a run folder by their key; none if the run does not describe them, as in version 0.1.0.

    Raises InputError, with the line, for a file that cannot be read, is too large, or holds what is no case.
    """
    path = folder / FILE
    if not path.exists():
        return {}
    if not path.is_file() and not path.is_dir():  # a pipe would be waited for
        raise InputError(f"{path}: cannot be read: is no file")
    found: dict[str, Case] = {}
    for number, line in _lines(path):
        try:
            case = Case.model_validate_json(line)
        except ValidationError as error:
            raise InputError(f"{path}:{number}: {_sentence(error)}") from None
        if case.key in found:
            raise InputError(f"{path}:{number}: the case {case.key} stands twice; delete one of its lines")
        if len(found) == _MAX_CASES:
            raise InputError(f"{path}:{number}: more than {_MAX_CASES} cases, which no campaign has")
        found[case.key] = case
    return found


def _lines(path: Path) -> Iterator[tuple[int, bytes]]:
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise InputError(f"{path}: larger than {_MAX_BYTES // 1_000_000} MB, which no run's cases need")
        with path.open("rb") as stream:
            number = 0
            while line := stream.readline(_MAX_LINE + 1):
                number += 1
                if len(line) > _MAX_LINE:
                    raise InputError(f"{path}:{number}: longer than {_MAX_LINE // 1_000_000} MB, which no case needs")
                yield number, line
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


def _sentence(error: ValidationError) -> str:
    """The first thing that is wrong, in a line."""
    first = error.errors(include_url=False, include_input=False, include_context=False)[0]
    where = ".".join(str(part)[:80] for part in first["loc"])
    said = first["msg"].removeprefix("Value error, ")
    words = f"{where}: {said}" if where else said
    return f"is no case: {''.join(c if c.isprintable() else '?' for c in words)[:300]}"
