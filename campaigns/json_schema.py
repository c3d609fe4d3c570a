"""`campaign schema`: the JSON Schema of a campaign's or a scene's file, for editors, with units and meanings.

A file says only what differs from a preset, so nothing but the items of lists has keys that must be given; what is
misspelt, in the wrong unit or of another kind is still marked.
"""

from __future__ import annotations

import re
from typing import Any

from conespot.campaigns.key_paths import ANY_NAME, Key, keys_of, models_of
from conespot.campaigns.key_words import bounds_words
from conespot.campaigns.schema import Campaign
from conespot.campaigns.sweep import OWN_NAME, SWEPT
from conespot.localize.locate import localizer_names
from conespot.scene.document import shipped
from conespot.scene.identity import defaults
from conespot.scene.keys import meaning, quantity_of, summary
from conespot.scene.scene import KNOWLEDGE

_DIALECT = "https://json-schema.org/draft/2020-12/schema"
#: keys that a file may have and no description holds: they are resolved while it is read
_BESIDE: dict[str, dict[str, Any]] = {
    "Scene": {"preset": "a scene to begin with: one that is shipped, or a file beside this one"},
    "Camera": {"calibration": "a calibration file of OpenCV's, for resolution, focal length and distortion"},
    "Surface": {"population": "an eye of a population by its number, or mean, in place of semi_axes"},
    "TabulatedSpread": {"file": "a CSV file of radius and value, in place of the other keys"},
}
#: names of descriptions whose keys must be given: items of lists, which no preset can have
_WHOLE = {"Bump", "Expectation"}


def campaign_schema() -> dict[str, Any]:
    """The JSON Schema of a campaign's file."""
    schema = _described()
    presets = list(shipped("scene", "presets"))
    own = schema["properties"]
    scene = own["scene"]
    own["scene"] = {
        **_without(scene, "$ref"),
        "anyOf": [{"type": "string", "examples": presets}, {"$ref": scene["$ref"]}],
    }
    own["localizers"]["items"] = {"enum": localizer_names()}
    schema["$defs"]["Product"] = _product()
    own["sweep"] = {
        "description": "what is swept; several products may stand in a list.",
        "anyOf": [{"$ref": "#/$defs/Product"}, {"type": "array", "items": {"$ref": "#/$defs/Product"}}],
    }
    schema["title"] = "conespot campaign"
    return schema


def scene_schema() -> dict[str, Any]:
    """The JSON Schema of a scene's file, such as a preset, which may say how well it is known (`campaign localize`)."""
    schema = _described()
    scene = schema["$defs"]["Scene"]
    known = {KNOWLEDGE: {"$ref": "#/$defs/Knowledge", "description": "how well the scene's quantities are known"}}
    scene = {**scene, "properties": {**scene["properties"], **known}}
    return {"$schema": _DIALECT, "title": "conespot scene", "$defs": schema["$defs"], **scene}


def _described() -> dict[str, Any]:
    """pydantic's schema of a campaign, as files have it, with what every key means."""
    schema: dict[str, Any] = _open(Campaign.model_json_schema())
    for name, model in models_of(Campaign).items():
        part = schema if model is Campaign else schema["$defs"][name]
        part["description"] = summary(model)
        if name not in _WHOLE:
            part.pop("required", None)
        written = defaults(model)
        for key in part["properties"]:
            said = meaning(model, key)
            field = Key((key,), model, False)
            unit = f" [{said.unit}]" if said.unit else ""
            bounds = f"; {bounds_words(field)}" if quantity_of(field.field) and bounds_words(field) else ""
            source = f" Source: {said.source}." if said.source else ""
            part["properties"][key]["description"] = f"{said.means}{unit}{bounds}.{source}"
            part["properties"][key].pop("title", None)
            if key in written:
                part["properties"][key]["default"] = written[key]
        for key, means in _BESIDE.get(name, {}).items():
            part["properties"][key] = {"type": ["string", "integer"], "description": f"{means}."}
    schema["$schema"] = _DIALECT
    return schema


def _open(part: Any) -> Any:
    """A schema without what a file that begins with a preset need not say: which kind, and one kind alone."""
    if isinstance(part, list):
        return [_open(item) for item in part]
    if not isinstance(part, dict):
        return part
    numeric = ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum") if part.get("type") == "string" else ()
    return {
        "anyOf" if key == "oneOf" else key: _open(value)
        for key, value in part.items()
        if not (key == "discriminator" and "propertyName" in value) and key not in numeric
    }


def _without(part: dict[str, Any], *keys: str) -> dict[str, Any]:
    return {key: value for key, value in part.items() if key not in keys}


def _product() -> dict[str, Any]:
    """One Cartesian product of `sweep:`: lists of the values of a key, or named choices of keys that go together."""
    names = {model: f"/$defs/{name}" for name, model in models_of(Campaign).items()} | {Campaign: ""}
    found: dict[str, list[str]] = {}
    for key in keys_of(Campaign):
        if key.path[0] in SWEPT and not key.listed:
            for name in (key.name, *_BESIDE.get(key.model.__name__, ())):
                path = ".".join((*key.path[:-1], name))
                found.setdefault(path, []).append(f"#{names[key.model]}/properties/{name}")
    values = {path: _any([{"$ref": target} for target in dict.fromkeys(targets)]) for path, targets in found.items()}
    lists = {path: {"type": "array", "minItems": 1, "items": value} for path, value in values.items()}
    own = {
        "type": "object",
        "additionalProperties": {"type": "object", **_keyed(values)},
    }
    keyed = _keyed(lists)
    keyed["patternProperties"][rf"^(?!({'|'.join(SWEPT)})$){OWN_NAME.pattern}$"] = own
    said = (
        "every combination of these is a case: keys by their dotted path with a list of values each,"
        " or a name of one's own with named choices."
    )
    return {"description": said, "type": "object", **keyed}


def _keyed(values: dict[str, Any]) -> dict[str, Any]:
    """Properties by dotted path, of which a step may be a name of one's own; nothing else."""
    patterns = {
        f"^{re.escape(path).replace(ANY_NAME, '[^.]+')}$": value for path, value in values.items() if ANY_NAME in path
    }
    exact = {path: value for path, value in values.items() if ANY_NAME not in path}
    return {"properties": exact, "patternProperties": patterns, "additionalProperties": False}


def _any(parts: list[dict[str, Any]]) -> dict[str, Any]:
    return parts[0] if len(parts) == 1 else {"anyOf": parts}
