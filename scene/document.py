"""YAML 1.2 files: read with line numbers, validated, and complained about in one clear sentence.

Files may come from strangers: only plain data is read (no tags, no anchors), and size and depth are bounded.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, TypeAdapter, ValidationError
from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from conespot.scene.quantity import FROM_FILE, in_unit_of

T = TypeVar("T")
Path_ = tuple[str | int, ...]
_MAX_BYTES = 1_000_000
_PLAIN_TAGS = {f"tag:yaml.org,2002:{name}" for name in ("str", "int", "float", "bool", "null")}


class InputError(Exception):
    """Something the user gave cannot be used; the message says what, where and how to mend it."""


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
        first = error.errors()[0]
        # a discriminated union adds its tag to the location, which is no key of the file
        keys: list[str | int] = list(at)
        here: Any = self.data
        for key in at:
            here = here[key]
        for part in first["loc"]:
            inside = isinstance(here, dict) and part in here
            inside |= isinstance(here, (list, tuple)) and isinstance(part, int) and part < len(here)
            if inside:
                keys.append(part)
                here = here[part]
            elif first["type"] == "missing" and part == first["loc"][-1]:
                keys.append(part)
        if first["type"] == "unknown_key":
            keys.append(first["ctx"]["key"])
        name = ".".join(map(str, keys))
        said = first["msg"].removeprefix("Value error, ")
        if first["type"] == "missing":
            said = "is required but missing"
        elif first["type"] not in {"unknown_key", "unknown_name", "quantity", "value_error"}:
            said = f"{said[0].lower()}{said[1:]}"
            written, bound = here, next(iter(first.get("ctx", {}).values()), None)
            if isinstance(written, str) and isinstance(bound, float):
                # a bound reads best in the unit the value was written in
                said = f"{said.removesuffix(str(bound).removesuffix('.0'))}{in_unit_of(written, bound)}"
            said += f", got {_short(written if isinstance(written, (str, int, float)) else first['input'])}"
        return f"{self.place(keys)}: {name + ': ' if name else ''}{said}"


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def read_document(path: Path) -> Document:
    """Read a YAML 1.2 file that holds a mapping.

    Raises InputError for a missing or unreadable file, bad syntax, tags, anchors, repeated keys and empty files.
    """
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    if len(raw) > _MAX_BYTES:
        raise InputError(f"{path}: larger than {_MAX_BYTES} bytes, which no description needs")
    try:
        data, lines = _load(raw.decode("utf-8"), str(path))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not valid YAML: {error}") from None
    if data is None:
        raise InputError(f"{path}: is empty; `campaign show power_sweep` prints an example")
    if not isinstance(data, dict):
        raise InputError(f"{path}:1: must hold `key: value` lines, not {type(data).__name__}")
    return Document(str(path), data, lines, path.parent)


def read_value(text: str, source: str) -> Any:
    """The plain value that a piece of YAML 1.2 holds; `source` names it in messages. Raises InputError."""
    return _load(text, source)[0]


def _load(text: str, source: str) -> tuple[Any, dict[Path_, str]]:
    yaml = YAML(typ="safe", pure=True)
    lines: dict[Path_, str] = {}
    try:
        node = yaml.compose(text)
        return (_plain(yaml, node, source, (), lines, set()) if node is not None else None), lines
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f":{mark.line + 1}" if mark else ""
        raise InputError(f"{source}{line}: not valid YAML: {error.problem or error.context}") from None
    except YAMLError as error:
        raise InputError(f"{source}: not valid YAML: {' '.join(str(error).split())}") from None
    except RecursionError:
        raise InputError(f"{source}: nested too deeply") from None


def _plain(yaml: YAML, node: Node, source: str, path: Path_, lines: dict[Path_, str], seen: set[int]) -> Any:
    where = f"{source}:{node.start_mark.line + 1}"
    lines.setdefault(path, where)
    if id(node) in seen or node.anchor:
        raise InputError(f"{where}: anchors and aliases are not read; write the value out")
    seen.add(id(node))
    if isinstance(node, ScalarNode):
        if node.tag not in _PLAIN_TAGS:
            return _untagged(node, where)
        try:
            return yaml.constructor.construct_object(node)
        except ValueError:
            raise InputError(f"{where}: {_short(node.value)} is not a valid value") from None
    if isinstance(node, SequenceNode) and node.tag == "tag:yaml.org,2002:seq":
        return [_plain(yaml, item, source, (*path, i), lines, seen) for i, item in enumerate(node.value)]
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
            result[key] = _plain(yaml, value_node, source, (*path, key), lines, seen)
        return result
    return _untagged(node, where)


def _untagged(node: Node, where: str) -> Any:
    if str(node.tag).endswith(":timestamp") and isinstance(node, ScalarNode):
        return node.value
    raise InputError(f"{where}: the tag {node.tag} is not read; only plain values are")


def merge(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """`base` with `over` laid on it: mappings are merged key by key, everything else is replaced.

    A mapping that names another `kind` replaces as a whole, since its other keys mean nothing to the new kind.
    """
    result = dict(base)
    for key, value in over.items():
        old = result.get(key)
        same_kind = (
            isinstance(old, dict) and isinstance(value, dict) and value.get("kind", old.get("kind")) == old.get("kind")
        )
        result[key] = merge(old, value) if same_kind and isinstance(old, dict) else value
    return result


def shipped(room: str, folder: str) -> dict[str, Path]:
    """The YAML files that come with a room, by name."""
    root = Path(str(resources.files(f"conespot.{room}"))) / folder
    return {p.stem: p for p in sorted(root.glob("*.yaml"))}


def find_document(name: str, room: str, folder: str, what: str) -> Path:
    """The file `name` names: a path that exists, else a shipped one. Raises InputError if neither."""
    path = Path(name)
    if path.exists():
        return path
    known = shipped(room, folder)
    if path.parent == Path() and path.name.removesuffix(".yaml") in known:
        return known[path.name.removesuffix(".yaml")]
    near = difflib.get_close_matches(path.name.removesuffix(".yaml"), list(known), n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"shipped: {', '.join(known)}"
    raise InputError(f"{name}: no such {what}, neither a file nor shipped; {hint}")


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
