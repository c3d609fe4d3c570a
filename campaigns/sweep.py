"""What a campaign sweeps: axes of choices, of which every combination is a case.

A key of the campaign has a list of its values. A name of one's own has named choices, each a mapping of such keys:
what goes together (a light and the filter for it), or what differs in more than one place (an ideal world, a real one).
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from conespot.results.columns import COLUMNS
from conespot.scene import InputError
from conespot.scene.document import Document, Path_

MAX_COMBINATIONS = 10_000
CASE = ("scene", "trajectory", "poses", "localizers", "knowledge", "samples", "edge_samples")
SWEPT = (*CASE, "seed")
OWN_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")
_COLUMNS = {column.name for column in COLUMNS}


@dataclass(frozen=True)
class Setting:
    """A `value` for the key at `path` in the campaign, and where it stands in the file."""

    path: tuple[str, ...]
    value: Any
    at: Path_


@dataclass(frozen=True)
class Choice:
    """One of an axis' choices: its `label`, which is the value itself where it has no name, and what it settles."""

    label: Any
    settings: tuple[Setting, ...]


@dataclass(frozen=True)
class Axis:
    """A swept key, or a name of one's own, with its choices."""

    key: str
    choices: tuple[Choice, ...]


def sweep_products(document: Document) -> list[list[Axis]]:
    """The axes of every Cartesian product under `sweep` (one mapping, or a list of them). Raises InputError."""
    sweep = document.data.get("sweep", {})
    listed = isinstance(sweep, list)
    products, count = [], 0
    for j, product in enumerate(sweep if listed else [sweep]):
        at: Path_ = ("sweep", j) if listed else ("sweep",)
        if not isinstance(product, dict):
            raise InputError(f"{document.place(at)}: sweep: must hold lines of `key: [values]`, got {product!r}")
        axes = [_axis(document, key, items, (*at, key)) for key, items in product.items()]
        products.append(axes)
        count += math.prod(len(axis.choices) for axis in axes)
        if count > MAX_COMBINATIONS:
            raise InputError(f"{document.place(at)}: sweep: more than {MAX_COMBINATIONS} combinations; sweep over less")
    return products or [[]]


def _axis(document: Document, key: str, items: Any, at: Path_) -> Axis:
    if isinstance(items, dict) and key.split(".")[0] not in SWEPT:
        return _named(document, key, items, at)
    _check(document, key, at, "sweep")
    if not isinstance(items, list) or not items:
        raise InputError(f"{document.place(at)}: sweep.{key}: must be a list of values, got {items!r}")
    path = tuple(key.split("."))
    return Axis(key, tuple(Choice(item, (Setting(path, item, (*at, i)),)) for i, item in enumerate(items)))


def _named(document: Document, name: str, items: dict[str, Any], at: Path_) -> Axis:
    """An axis of named choices."""
    where = f"{document.place(at)}: sweep"
    if name in _COLUMNS or name.startswith("est_") or not OWN_NAME.fullmatch(name):
        raise InputError(
            f"{where}: '{name}' cannot name choices; take small letters, digits and _, and no column of the rows"
        )
    if not items:
        raise InputError(f"{where}.{name}: must hold a choice, such as `ideal: {{}}`")
    choices = []
    for label, keys in items.items():
        if not isinstance(keys, dict):
            what = f"{document.place((*at, label))}: sweep.{name}.{label}"
            raise InputError(f"{what}: must be a mapping of keys of the campaign, got {keys!r}")
        for key in keys:
            _check(document, key, (*at, label, key), f"sweep.{name}.{label}")
        settings = (Setting(tuple(key.split(".")), value, (*at, label, key)) for key, value in keys.items())
        choices.append(Choice(label, tuple(settings)))
    return Axis(name, tuple(choices))


def _check(document: Document, key: str, at: Path_, where: str) -> None:
    root = key.split(".")[0]
    if root not in SWEPT:
        near = difflib.get_close_matches(root, SWEPT, n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"what can be: {', '.join(SWEPT)}"
        raise InputError(f"{document.place(at)}: {where}: '{root}' cannot be swept; {hint}")


def settled(product: dict[str, Any], path: tuple[str, ...], laid: Callable[[str, Any], Any]) -> dict[str, Any]:
    """A product without what `path` settles; `laid` lays its value on what a key above it is given."""
    kept: dict[str, Any] = {}
    for key, items in product.items():
        if isinstance(items, dict):
            kept[key] = {
                label: _without(keys, path, laid) if isinstance(keys, dict) else keys for label, keys in items.items()
            }
        elif not _within(key, path):
            above = isinstance(items, list) and _above(key, path)
            kept[key] = [laid(key, item) for item in items] if above else items
    return kept


def _without(keys: dict[str, Any], path: tuple[str, ...], laid: Callable[[str, Any], Any]) -> dict[str, Any]:
    left = {key: value for key, value in keys.items() if not _within(key, path)}
    return {key: laid(key, value) if _above(key, path) else value for key, value in left.items()}


def _within(key: str, path: tuple[str, ...]) -> bool:
    return tuple(key.split("."))[: len(path)] == path


def _above(key: str, path: tuple[str, ...]) -> bool:
    parts = tuple(key.split("."))
    return len(parts) < len(path) and path[: len(parts)] == parts


def lines_within_sweep(document: Document) -> dict[Path_, dict[Path_, str]]:
    """The lines at and within each part of the sweep, by where that stands: looked up, not sought, by a combination."""
    within: dict[Path_, dict[Path_, str]] = {}
    for path, line in document.lines.items():
        if path[:1] == ("sweep",):
            for n in range(2, len(path) + 1):
                within.setdefault(path[:n], {})[path[n:]] = line
    return within
