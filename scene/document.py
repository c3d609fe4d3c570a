"""YAML 1.2 files: read with line numbers, validated, and complained about in one clear sentence.

Files may come from strangers: only plain data is read (no tags, no anchors), and size and depth are bounded.
"""

from __future__ import annotations

import copy
import difflib
import functools
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, NoReturn, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from conespot.scene.complaint import complaint, cut, short
from conespot.scene.quantity import FROM_FILE
from conespot.scene.text_file import at_home, read_text

T = TypeVar("T")
Path_ = tuple[str | int, ...]
#: more than any description needs, and read in seconds: text, values and keys in it, and how deep they are nested
_MAX_BYTES = 256_000
_MAX_NODES = 12_000
_MAX_DEPTH = 32
_MAX_BITS = 1024
_LONGEST = 1000
#: texts whose values are kept: a command reads its campaign and its presets again and again
_KEPT = 32
#: keys that another key stands for: a camera's calibration file, and the eye of a population whose shape a surface has
_STOOD_FOR = {
    "calibration": ("resolution", "focal_length", "pixel_aspect", "principal_point", "distortion"),
    "population": ("semi_axes",),
}
_PLAIN_TAGS = {f"tag:yaml.org,2002:{name}" for name in ("str", "int", "float", "bool", "null")}


class InputError(Exception):
    """Something the user gave cannot be used; the message says what, where and how to mend it.

    It is one line of printable characters, however long or strange the input that it names.
    """

    def __init__(self, sentence: str) -> None:
        line = "".join(c if c.isprintable() else "?" for c in sentence)
        super().__init__(line if len(line) <= _LONGEST else f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 2 :]}")


@dataclass(frozen=True)
class Document:
    """Plain data and where each part of it stands: `lines` maps a path of keys to a line of the file `source`."""

    source: str
    data: dict[str, Any]
    lines: dict[Path_, str] = field(default_factory=dict)
    folder: Path = Path()

    def place(self, path: Sequence[str | int]) -> str:
        """`file:line` of the nearest part of the document that contains `path`."""
        keys = tuple(path)
        while keys not in self.lines and keys:
            keys = keys[:-1]
        return self.lines.get(keys, self.source)

    def validate(self, kind: type[T], *, at: Path_ = ()) -> T:
        """The document's data as a `kind`. Raises InputError for the first thing that is wrong with it."""
        data: Any = self.data
        for key in at:
            data = data[key]
        try:
            return TypeAdapter(kind).validate_python(data, context={FROM_FILE: True, "folder": str(self.folder)})
        except ValidationError as error:
            raise InputError(self._sentence(error, at)) from None

    def _sentence(self, error: ValidationError, at: Path_) -> str:
        keys, said = complaint(error, self.data, at)
        name = ".".join(map(str, keys))
        return f"{self.place(keys)}: {cut(name) + ': ' if name else ''}{cut(said, 400)}"


def read_document(path: Path) -> Document:
    """Read a YAML 1.2 file that holds a mapping.

    Raises InputError for a missing or unreadable file, bad syntax, tags, anchors, repeated keys and empty files.
    """
    try:
        text = read_text(path, _MAX_BYTES, "description")
    except ValueError as error:
        raise InputError(str(error)) from None
    data, lines = _load(text, str(path))
    if data is None:
        raise InputError(f"{path}: is empty; `campaign show power_sweep` prints an example")
    if not isinstance(data, dict):
        raise InputError(f"{path}:1: must hold `key: value` lines, not {type(data).__name__}")
    return Document(str(path), data, lines, path.parent)


def read_value(text: str, source: str) -> Any:
    """The plain value that a piece of YAML 1.2 holds; `source` names it in messages. Raises InputError."""
    return _load(text, source)[0]


class _Composer(Composer):
    """Stops at what is no description, while it is read: anchors and aliases, too many values, too deep a nest."""

    _nodes = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.parser.peek_event()
        if getattr(event, "anchor", None):
            self._refuse("anchors and aliases are not read; write the value out", event)
        self._nodes += 1
        if self._nodes > _MAX_NODES:
            self._refuse(f"holds more than {_MAX_NODES} values, which no description needs", event)
        if self.depth >= _MAX_DEPTH:
            self._refuse(f"nested too deeply, {_MAX_DEPTH} levels are the most", event)
        return super().compose_node(parent, index)

    @staticmethod
    def _refuse(reason: str, event: Any) -> NoReturn:
        raise _NotPlainError(reason, event.start_mark.line + 1)


class _NotPlainError(Exception):
    """What is wrong, and the line it stands in."""


def _load(text: str, source: str) -> tuple[Any, dict[Path_, str]]:
    """The value that a text holds and where each part of it stands, for the caller to change."""
    data, lines = _parsed(text, source)
    return copy.deepcopy(data), dict(lines)


@functools.lru_cache(maxsize=_KEPT)
def _parsed(text: str, source: str) -> tuple[Any, dict[Path_, str]]:
    yaml = YAML(typ="safe", pure=True)
    yaml.Composer = _Composer
    lines: dict[Path_, str] = {}
    try:
        node = yaml.compose(text)
        return (_plain(yaml, node, source, (), lines) if node is not None else None), lines
    except _NotPlainError as error:
        raise InputError(f"{source}:{error.args[1]}: {error.args[0]}") from None
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        raise InputError(f"{source}{line}: not valid YAML: {error.problem or error.context}") from None
    except YAMLError as error:
        raise InputError(f"{source}: not valid YAML: {' '.join(str(error).split())}") from None


def _plain(yaml: YAML, node: Node, source: str, path: Path_, lines: dict[Path_, str]) -> Any:
    where = f"{source}:{node.start_mark.line + 1}"
    lines.setdefault(path, where)
    if isinstance(node, ScalarNode):
        if node.tag not in _PLAIN_TAGS:
            return _untagged(node, where)
        try:
            value = yaml.constructor.construct_object(node)
            if isinstance(value, int) and value.bit_length() > _MAX_BITS:
                raise ValueError("more than any quantity")
            return value
        except ValueError:
            raise InputError(f"{where}: {short(node.value)} is not a valid value") from None
    if isinstance(node, SequenceNode) and node.tag == "tag:yaml.org,2002:seq":
        return [_plain(yaml, item, source, (*path, i), lines) for i, item in enumerate(node.value)]
    if isinstance(node, MappingNode) and node.tag == "tag:yaml.org,2002:map":
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            at = f"{source}:{key_node.start_mark.line + 1}"
            if not isinstance(key_node, ScalarNode):
                raise InputError(f"{at}: a key must be a plain word")
            key = str(key_node.value)
            if key in result:
                raise InputError(f"{at}: '{key}' stands twice")
            lines[(*path, key)] = at
            result[key] = _plain(yaml, value_node, source, (*path, key), lines)
        return result
    return _untagged(node, where)


def _untagged(node: Node, where: str) -> Any:
    if str(node.tag).endswith(":timestamp") and isinstance(node, ScalarNode):
        return node.value
    raise InputError(f"{where}: the tag {node.tag} is not read; only plain values are")


def merge(base: dict[str, Any], over: dict[str, Any], model: type[BaseModel] | None = None) -> dict[str, Any]:
    """`base` with `over` laid on it: mappings are merged key by key, everything else is replaced.

    A mapping that names another `kind` replaces as a whole, since its other keys mean nothing to the new kind; one that
    names a `calibration` file, or an eye of the `population`, replaces what that holds. Where the data are a `model`'s,
    a word of `base` (`sensor: linear`) is the mapping that it stands for.
    """
    replaced = [key for name, keys in _STOOD_FOR.items() if name in over for key in keys]
    result = {key: value for key, value in base.items() if key not in replaced}
    for key, value in over.items():
        old = result.get(key)
        if model is not None and isinstance(old, str) and isinstance(value, dict):
            old = _spelt_out(model, key, old)
        if isinstance(old, dict) and isinstance(value, dict) and value.get("kind", old.get("kind")) == old.get("kind"):
            value = merge(old, value, _part(model, key))
        result[key] = value
    return result


def _part(model: type[BaseModel] | None, key: str) -> type[BaseModel] | None:
    kind = model.model_fields[key].annotation if model is not None and key in model.model_fields else None
    return kind if isinstance(kind, type) and issubclass(kind, BaseModel) else None


@functools.lru_cache(maxsize=256)
def _spelt_out(model: type[BaseModel], key: str, word: str) -> dict[str, Any] | str:
    """What a word stands for as the value of a model's key, as a file would hold it; the word if that is no mapping."""
    field = model.model_fields.get(key)
    if field is None:
        return word
    kind: Any = Annotated[field.annotation, *field.metadata]
    try:
        found: object = TypeAdapter(kind).validate_python(word)
    except ValidationError:
        return word  # whoever validates the whole says so
    return found.model_dump(mode="json") if isinstance(found, BaseModel) else word


@functools.cache
def shipped(room: str, folder: str) -> dict[str, Path]:
    """The YAML files that come with a room, by name."""
    root = Path(str(resources.files(f"conespot.{room}"))) / folder
    return {p.stem: p for p in sorted(root.glob("*.yaml"))}


def find_document(name: str, room: str, folder: str, what: str) -> Path:
    """The file `name` names: a path that exists and is no folder, else a shipped one. Raises InputError if neither."""
    path = at_home(Path(name))
    if is_file(path):
        return path
    known = shipped(room, folder)
    if path.parent == Path() and path.name.removesuffix(".yaml") in known:
        return known[path.name.removesuffix(".yaml")]
    if os.path.isdir(path):
        raise InputError(f"{name}: is a folder; name the {what}'s file in it")
    near = difflib.get_close_matches(path.name.removesuffix(".yaml"), list(known), n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"shipped: {', '.join(known)}"
    raise InputError(f"{name}: no such {what}, neither a file nor shipped; {hint}")


def is_file(path: Path) -> bool:
    """Whether something can be read there: a file or a pipe, and no folder."""
    try:
        return path.exists() and not path.is_dir()
    except (OSError, ValueError):  # a name too long, or with a NUL character
        return False


def dump(content: BaseModel | dict[str, Any]) -> str:
    """A model, or plain data, as a YAML file that reads back to an equal one."""
    import io

    stream = io.StringIO()
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = None
    yaml.width = 110
    yaml.sort_base_mapping_type_on_output = False  # type: ignore[assignment]
    yaml.dump(content.model_dump(mode="json") if isinstance(content, BaseModel) else content, stream)
    return stream.getvalue()
