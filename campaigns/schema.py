"""A campaign's file: what is rendered, localized and swept, validated with the line of whatever is wrong.

A campaign with a `scene` (given or swept) makes frames; one without may ask for `theory` alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from conespot.campaigns.knowledge import Knowledge
from conespot.campaigns.sweep import CASE, Setting, lines_within_sweep, settled, sweep_products
from conespot.results.expectation import Expectations
from conespot.scene import InputError, Scene
from conespot.scene.document import Document, Path_, find_document, is_file, merge, read_document, read_value
from conespot.scene.model import Model, unknown_name
from conespot.scene.scene import expand
from conespot.scene.text_file import at_home
from conespot.scene.trajectory import AnyTrajectory, Box

#: named in the file by a word alone, which stands for a mapping with this key
_WORDS = {"scene": "preset", "trajectory": "kind"}
#: keys whose value may be a file's name
_FILES = ("file", "preset", "scene", "calibration")
_FRAMES = (*CASE, "bounds", "frames", "sweep")


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
class Combination:
    """One combination of what is swept: the campaign, its file as if nothing were, and what is `chosen` by key."""

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

    def laid(key: str, item: Any) -> Any:
        axis = tuple(key.split("."))
        return _value_at(lay(lay({}, axis, item), path, value), axis)

    if path[0] == "sweep":
        if not isinstance(sweep, dict):
            raise InputError(f"{option}: the sweep is a list of products; change it in a copy of {document.source}")
        at: Path_ = ("sweep", ".".join(path[1:]))
        data = {**document.data, "sweep": {**sweep, at[1]: value}} if path[1:] else {**document.data, "sweep": value}
    else:
        at, data = path, lay(document.data, path, value)
        if isinstance(sweep, dict) and sweep:
            data["sweep"] = settled(sweep, path, laid)
        elif isinstance(sweep, list):
            data["sweep"] = [settled(p, path, laid) if isinstance(p, dict) else p for p in sweep]
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


def makes_frames(document: Document) -> bool:
    """False for theory alone. Raises InputError for a campaign that wants frames without a scene, or nothing."""
    data = document.data
    if "scene" in data or any(setting.path[0] == "scene" for setting in _swept(document)):
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
    within = lines_within_sweep(document)
    for axes in sweep_products(document):
        for choices in itertools.product(*(axis.choices for axis in axes)):
            laid = unswept
            chosen = {axis.key: choice.label for axis, choice in zip(axes, choices, strict=True)}
            # what lies within another swept key is laid on that one's value, in whatever order they stand
            for setting in sorted((s for choice in choices for s in choice.settings), key=lambda s: len(s.path)):
                laid = _set(laid, setting, document.place(setting.at), within.get(setting.at, {}))
            try:
                yield Combination(_expanded(laid).validate(Campaign), laid, chosen)
            except InputError as error:
                which = ", ".join(f"{key}: {item}" for key, item in chosen.items())
                raise InputError(f"{error} (in the combination {which})" if len(axes) > 1 else str(error)) from None


def _swept(document: Document) -> Iterator[Setting]:
    """Everything that some combination settles."""
    for axes in sweep_products(document):
        for axis in axes:
            for choice in axis.choices:
                yield from choice.settings


def _unswept(document: Document) -> Document:
    """The file without what is swept; every combination has the lines of the others, and only these."""
    lines = {k: v for k, v in document.lines.items() if k[:1] != ("sweep",) or len(k) == 1}
    return replace(document, data={k: v for k, v in document.data.items() if k != "sweep"}, lines=lines)


def _set(document: Document, setting: Setting, place: str, within: dict[Path_, str]) -> Document:
    """The file with a setting laid on it that stands at a `place`, with these lines in it."""
    path = setting.path
    lines = {k: v for k, v in document.lines.items() if k[: len(path)] != path}
    # without sweep the file was valid, so this value is to blame for whatever is wrong around it
    lines |= {path[:n]: place for n in range(1, len(path) + 1)}
    lines |= {path + k: v for k, v in within.items()}
    return replace(document, data=lay(document.data, path, setting.value), lines=lines)


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
    paths = {setting.path for setting in _swept(document)}
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
