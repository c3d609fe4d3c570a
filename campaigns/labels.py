"""What the rows call a case: the standing columns, and one for every other swept key."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

from conespot.campaigns.schema import Campaign, Combination
from conespot.results.columns import names as declared
from conespot.scene.identity import digest
from conespot.scene.illumination import light_name
from conespot.scene.sensor import sensor_name
from conespot.scene.spotlights import rig_name
from conespot.scene.surface import surface_name

Label = str | float
_LONGEST = 120

_RESOLUTION = "scene.camera.resolution"
#: the standing labels: which key of the campaign each tells, and its short name
_STANDING: dict[str, tuple[str, Callable[[Campaign], Label]]] = {
    "trajectory": ("trajectory", lambda c: c.trajectory.kind),
    "spotlights": ("scene.spotlights", lambda c: rig_name(c.scene.spotlights)),
    "power_w": ("scene.power.value", lambda c: c.scene.power.value),
    "illumination": ("scene.illumination", lambda c: light_name(c.scene.illumination)),
    "surface": ("scene.surface", lambda c: surface_name(c.scene.surface)),
    "sensor": ("scene.sensor", lambda c: sensor_name(c.scene.sensor)),
    "resolution_px": (_RESOLUTION, lambda c: c.scene.camera.shape[1]),
}
_TOLD = {key for key, _ in _STANDING.values()} | {"localizers"}


def label_columns(cases: Sequence[Combination]) -> dict[str, Sequence[Label]]:
    """The standing columns, one value a case.

    Where a swept key gives two cases the same short name (two helices), it is the value as the file writes it.
    """
    columns: dict[str, Sequence[Label]] = {}
    for name in declared("label"):
        key, short = _STANDING[name]
        names = [short(case.campaign) for case in cases]
        # a frame's width stays a number; the size itself gets a column of its own
        if name != "resolution_px" and any(key in case.chosen for case in cases):
            values = [json.dumps(_without_files(_dumped(case, key)), sort_keys=True) for case in cases]
            if len(set(zip(names, values, strict=True))) > len(set(names)):
                names = [_written(case, key) for case in cases]
        columns[name] = names
    return columns


def swept_columns(cases: Sequence[Combination]) -> dict[str, Sequence[Label]]:
    """A column for every swept key that no standing one tells: its path, within the scene if that leaves a dot.

    The values are as the file writes them; numbers if all are, else text.
    """
    columns: dict[str, Sequence[Label]] = {}
    told = _TOLD if all(len(set(case.campaign.scene.camera.shape)) == 1 for case in cases) else _TOLD - {_RESOLUTION}
    for key in dict.fromkeys(key for case in cases for key in case.chosen if key not in told):
        values = [_written(case, key) for case in cases]
        numbers = all(isinstance(value, (int, float)) for value in values)
        inner = key.removeprefix("scene.")
        columns[inner if "." in inner else key] = values if numbers else [str(value) for value in values]
    return columns


def _without_files(data: Any) -> Any:
    """Plain data without the names of the files that its points were read from."""
    if isinstance(data, dict):
        return {k: _without_files(v) for k, v in data.items() if not (k == "file" and data.get("points"))}
    return [_without_files(item) for item in data] if isinstance(data, list) else data


def _written(case: Combination, key: str) -> Label:
    """The value of a key as the file writes it, or as it would be written where the file leaves it out."""
    value = case.chosen.get(key)
    if value is None:
        value = _at(case.document.data, key)
    if value is None:
        value = _dumped(case, key)
    if isinstance(value, dict) and len(value) == 1 and key in ("scene", "trajectory"):
        value = next(iter(value.values()))  # written as a word
    if isinstance(value, str) or (isinstance(value, (int, float)) and not isinstance(value, bool)):
        return value
    text = json.dumps(value).replace('"', "")
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 20]}... {digest(text)}"


def _dumped(case: Combination, key: str) -> Any:
    return _at(case.campaign.model_dump(mode="json"), key)


def _at(data: Any, key: str) -> Any:
    for part in key.split("."):
        data = data.get(part) if isinstance(data, dict) else None
    return data
