"""A campaign's file: what is rendered, localized and swept, validated with the line of whatever is wrong.

A campaign with a `scene` (given or swept) makes frames; one without may ask for `theory` alone.
"""

from __future__ import annotations

import difflib
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from conespot.campaigns.knowledge import Knowledge
from conespot.results.expectation import Expectations
from conespot.scene import InputError, Scene
from conespot.scene.document import Document, Path_, find_document, is_file, merge, read_document, read_value
from conespot.scene.model import Model, unknown_name
from conespot.scene.scene import expand
from conespot.scene.text_file import at_home
from conespot.scene.trajectory import AnyTrajectory, Box

MAX_COMBINATIONS = 10_000
#: named in the file by a word alone, which stands for a mapping with this key
_WORDS = {"scene": "preset", "trajectory": "kind"}
#: keys whose value may be a file's name
_FILES = ("file", "preset", "scene")
_CASE = ("scene", "trajectory", "poses", "localizers", "knowledge", "samples", "edge_samples")
_FRAMES = (*_CASE, "bounds", "frames", "sweep")
_SWEPT = (*_CASE, "seed")


def _known_localizer(value: Any) -> Any:
    from conespot.localize import find_localizer, localizer_names

    if isinstance(value, str):
        known = localizer_names()
        if value not in known:
            raise unknown_name(value, known, "localizer")
        try:
            find_localizer(value)
        except InputError as error:
            raise ValueError(str(error)) from None
    return value


def _distinct(value: Any) -> Any:
    if isinstance(value, (list, tuple)) and len({str(v) for v in value}) < len(value):
        raise ValueError("every name may stand only once")
    return value


_Localizer = Annotated[str, BeforeValidator(_known_localizer)]


class Campaign(Model):
    """One combination of a campaign: nothing in it is swept any more."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.+-]{0,79}$")
    description: str = Field("", max_length=4000)
    theory: tuple[Literal["table-1"], ...] = ()
    scene: Scene = Scene()
    trajectory: AnyTrajectory = Box()
    poses: int = Field(100, ge=1, le=100_000, strict=True)
    localizers: Annotated[tuple[_Localizer, ...], BeforeValidator(_distinct), Field(min_length=1)] = ("paper",)
    knowledge: Knowledge = Knowledge()  #: what the localizers are told beside the image
    samples: int = Field(16, ge=1, le=65_536, strict=True)  #: per pixel and rendering
    edge_samples: int = Field(0, ge=0, le=65_536, strict=True)  #: where a beam is steep, if more than `samples`
    seed: int = Field(1, ge=0, lt=2**63, strict=True)
    bounds: bool = Field(False, strict=True)  #: state the Cramer-Rao bound beside what the estimators find
    frames: bool = Field(False, strict=True)  #: keep every frame as EXR and PNG
    expect: Expectations = ()  #: of the tables, see `campaign check`; no row depends on it
    made_with: dict[str, str] = Field({})  #: written by a run: versions, Python, platform; means nothing when read


@dataclass(frozen=True)
class Axis:
    """A swept key: its dotted `key`, that path in the campaign, its `items`, and where the list stands in the file."""

    key: str
    path: tuple[str, ...]
    items: list[Any]
    at: Path_


@dataclass(frozen=True)
class Combination:
    """One combination of what is swept: the campaign, its file as if nothing were, and the items `chosen` by key."""

    campaign: Campaign
    document: Document
    chosen: dict[str, Any]


def read_campaign(name: str) -> Document:
    """The file of a campaign, a path or the name of a shipped one. Raises InputError."""
    document = read_document(find_document(name, "campaigns", "", "campaign"))
    return replace(document, data={"name": Path(document.source).stem, **_spelt(document.data)})


def override(document: Document, key: str, text: str, option: str) -> Document:
    """The campaign with `key` set to the YAML value `text`; it wins over a sweep of the same key. Raises InputError.

    A dotted path goes into the scene; `sweep.` and a path replaces or adds a swept list. A file that is named is one of
    the working folder, or else of the campaign's.
    """
    path = tuple(key.split("."))
    value = _from_here(path[-1], read_value(text, option))
    sweep = document.data.get("sweep", {})
    if path[0] == "sweep":
        if not isinstance(sweep, dict):
            raise InputError(f"{option}: the sweep is a list of products; change it in a copy of {document.source}")
        at: Path_ = ("sweep", ".".join(path[1:]))
        data = {**document.data, "sweep": {**sweep, at[1]: value}} if path[1:] else {**document.data, "sweep": value}
    else:
        at, data = path, lay(document.data, path, value)
        if isinstance(sweep, dict) and sweep:
            data["sweep"] = _settled(sweep, path, value)
        elif isinstance(sweep, list):
            data["sweep"] = [_settled(p, path, value) if isinstance(p, dict) else p for p in sweep]
    kept = {k: v for k, v in document.lines.items() if k[: len(at)] != at}
    return replace(document, data=data, lines={**kept, at: option})


def setting(text: str) -> tuple[str, str]:
    """Key and value of what follows --set. Raises InputError."""
    key, equals, value = text.partition("=")
    if not equals or not key:
        raise InputError(f"--set {text}: write KEY=VALUE, such as --set poses=10")
    return key.strip(), value


def _from_here(key: str, value: Any) -> Any:
    """A value with the files of the working folder that it names by their absolute paths."""
    if isinstance(value, dict):
        return {k: _from_here(k, v) for k, v in value.items()}
    if isinstance(value, list):
        return [_from_here(key, item) for item in value]
    if key in _FILES and isinstance(value, str) and is_file(at_home(Path(value))):
        return str(at_home(Path(value)).absolute())
    return value


def _settled(product: dict[str, Any], path: tuple[str, ...], value: Any) -> dict[str, Any]:
    """A product without the axes that `path` settles, and with `value` laid on the items of those above it."""
    settled: dict[str, Any] = {}
    for key, items in product.items():
        axis = tuple(key.split("."))
        if axis[: len(path)] == path:
            continue
        if path[: len(axis)] == axis and isinstance(items, list):
            items = [_value_at(lay(lay({}, axis, item), path, value), axis) for item in items]
        settled[key] = items
    return settled


def lay(data: dict[str, Any], path: tuple[str, ...], value: Any) -> dict[str, Any]:
    """`data` with `value` laid on it at `path`: mappings are merged, everything else is replaced."""
    nested = value
    for key in reversed(path):
        nested = {key: nested}
    return merge(_spelt(data), _spelt(nested), Campaign)


def _spelt(data: dict[str, Any]) -> dict[str, Any]:
    """The words that stand for a mapping (`scene: paper`, `trajectory: box`) written out, so that keys can be added."""
    return {k: {_WORDS[k]: v} if k in _WORDS and isinstance(v, str) else v for k, v in data.items()}


def _value_at(data: Any, path: tuple[str, ...]) -> Any:
    for key in path:
        data = data[key]
    return data


def sweep_products(document: Document) -> list[list[Axis]]:
    """The axes of every Cartesian product under `sweep` (one mapping, or a list of them). Raises InputError."""
    sweep = document.data.get("sweep", {})
    listed = isinstance(sweep, list)
    products, count = [], 0
    for j, product in enumerate(sweep if listed else [sweep]):
        at: Path_ = ("sweep", j) if listed else ("sweep",)
        if not isinstance(product, dict):
            raise InputError(f"{document.place(at)}: sweep: must hold lines of `key: [values]`, got {product!r}")
        axes = []
        for key, items in product.items():
            where = document.place((*at, key))
            root = key.split(".")[0]
            if root not in _SWEPT:
                near = difflib.get_close_matches(root, _SWEPT, n=1)
                hint = f"did you mean '{near[0]}'?" if near else f"what can be: {', '.join(_SWEPT)}"
                raise InputError(f"{where}: sweep: '{root}' cannot be swept; {hint}")
            if not isinstance(items, list) or not items:
                raise InputError(f"{where}: sweep.{key}: must be a list of values, got {items!r}")
            axes.append(Axis(key, tuple(key.split(".")), items, (*at, key)))
        products.append(axes)
        count += math.prod(len(axis.items) for axis in axes)
        if count > MAX_COMBINATIONS:
            raise InputError(f"{document.place(at)}: sweep: more than {MAX_COMBINATIONS} combinations; sweep over less")
    return products or [[]]


def makes_frames(document: Document) -> bool:
    """False for theory alone. Raises InputError for a campaign that wants frames without a scene, or nothing."""
    data = document.data
    if "scene" in data or any(axis.path[0] == "scene" for axes in sweep_products(document) for axis in axes):
        return True
    if not data.get("theory") or any(key in data for key in _FRAMES):
        raise InputError(f"{document.source}: scene: is required but missing; `scene: paper-code` is a good start")
    return False


def base(document: Document) -> Campaign:
    """The campaign with nothing swept. Raises InputError."""
    return _expanded(_unswept(document)).validate(Campaign)


def combinations(document: Document) -> Iterator[Combination]:
    """Every combination in the order of the file, the last key fastest.

    Raises InputError for the first that is not a campaign, with the line of the swept item that makes it so.
    """
    unswept = _unswept(document)
    for axes in sweep_products(document):
        for picks in itertools.product(*(range(len(axis.items)) for axis in axes)):
            laid = unswept
            chosen = {axis.key: axis.items[i] for axis, i in zip(axes, picks, strict=True)}
            # what lies within another swept key is laid on that one's value, in whatever order they stand
            for axis, i in sorted(zip(axes, picks, strict=True), key=lambda pick: len(pick[0].path)):
                laid = _picked(laid, axis, i)
            try:
                yield Combination(_expanded(laid).validate(Campaign), laid, chosen)
            except InputError as error:
                which = ", ".join(f"{key}: {item}" for key, item in chosen.items())
                raise InputError(f"{error} (in the combination {which})" if len(axes) > 1 else str(error)) from None


def _unswept(document: Document) -> Document:
    return replace(document, data={k: v for k, v in document.data.items() if k != "sweep"})


def _picked(document: Document, axis: Axis, i: int) -> Document:
    item = (*axis.at, i)
    lines = {k: v for k, v in document.lines.items() if k[: len(axis.path)] != axis.path}
    # without sweep the file was valid, so this item is to blame for whatever is wrong around it
    lines |= {axis.path[:n]: document.place(item) for n in range(1, len(axis.path) + 1)}
    lines |= {axis.path + k[len(item) :]: v for k, v in document.lines.items() if k[: len(item)] == item}
    return replace(document, data=lay(document.data, axis.path, axis.items[i]), lines=lines)


def _expanded(document: Document) -> Document:
    if not isinstance(document.data.get("scene"), dict):
        return document
    try:
        return expand(document, ("scene",))
    except InputError as error:
        raise InputError(f"{document.place(('scene', 'preset'))}: scene: {error}") from None


def resolved(document: Document, made_with: dict[str, str]) -> dict[str, Any]:
    """The campaign as plain data that reads back to the same cases, with every default and preset written out."""
    campaign = base(document)
    data = campaign.model_copy(update={"made_with": made_with}).model_dump(mode="json")
    sweep = document.data.get("sweep")
    paths = [axis.path for axes in sweep_products(document) for axis in axes]
    if not makes_frames(document):
        return {key: value for key, value in data.items() if key not in _FRAMES}
    if ("scene",) in paths or ("scene", "preset") in paths:
        # a preset that is swept cannot be written out: what it would replace is not known to come from a preset
        data["scene"] = document.data.get("scene", {})
    return _located({**data, **({"sweep": sweep} if sweep else {})}, document.folder)


def _located(data: Any, folder: Path) -> Any:
    """Plain data whose CSV and calibration files are named by absolute paths, to be read from another folder."""
    if isinstance(data, list):
        return [_located(item, folder) for item in data]
    if not isinstance(data, dict):
        return data
    if data.get("kind") == "csv" and isinstance(data.get("file"), str):
        data = {k: v for k, v in data.items() if k not in ("points", "times")}
        data = {**data, "file": str((folder / data["file"]).resolve())}
    if isinstance(data.get("calibration"), str):
        data = {**data, "calibration": str((folder / data["calibration"]).resolve())}
    if isinstance(data.get("scene.camera.calibration"), list):
        files = [str((folder / str(name)).resolve()) for name in data["scene.camera.calibration"]]
        data = {**data, "scene.camera.calibration": files}
    return {key: _located(value, folder) for key, value in data.items()}
