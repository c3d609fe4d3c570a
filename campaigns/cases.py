"""`cases.jsonl`: what the cases of a run are, so that whoever reads its rows need guess nothing.

One JSON object a line and one line a case, in the order of the plan. Long tables of points stand as a digest, with
the name of the file or package that they came from.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from conespot.campaigns.plan import Case, Plan
from conespot.localize import find_localizer
from conespot.results.cases import FILE
from conespot.scene.atomic import write_atomically
from conespot.scene.identity import SCHEMA, digest
from conespot.scene.words import assumed

#: long tables that a digest stands for
_POINTS = ("points", "times")


def write_cases(folder: Path, plan: Plan) -> None:
    """Write what the cases of a plan are: the same whenever and wherever the same campaign is read."""
    lines = "".join(f"{json.dumps(case, ensure_ascii=False)}\n" for case in _described(plan))
    write_atomically(folder / FILE, lines.encode())


def _described(plan: Plan) -> Iterator[dict[str, Any]]:
    for case in plan.cases:
        yield {
            "schema": SCHEMA,
            "key": case.key,
            "frame": case.frame,
            "labels": {**case.labels, **case.swept},
            "localizers": {name: _words(name) for name in case.localizers},
            "assumes": assumed(case.scene),
            "watts": asdict(case.scene.power.both(case.scene.beam)),
            "told": _plain(case.knowledge),
            **_visited(case),
            "bounds": plan.campaign.bounds,
            "scene": _plain(case.scene),
        }


def _words(localizer: str) -> dict[str, str]:
    entry = find_localizer(localizer)
    return {"threshold": entry.threshold, "ambiguity": entry.ambiguity}


def _visited(case: Case) -> dict[str, Any]:
    campaign = case.campaign
    counts = {"poses": campaign.poses, "samples": campaign.samples, "edge_samples": campaign.edge_samples}
    return {"trajectory": _plain(campaign.trajectory), **counts}


def _plain(model: BaseModel) -> dict[str, Any]:
    data: dict[str, Any] = _without_points(model.model_dump(mode="json"))
    return data


def _without_points(data: Any) -> Any:
    """Plain data with a digest in place of points that a file or another package holds; of a file its name alone."""
    if isinstance(data, list):
        return [_without_points(item) for item in data]
    if not isinstance(data, dict):
        return data
    if data.get("points"):
        kept = {key: Path(value).name if key == "file" else value for key, value in data.items() if key not in _POINTS}
        points = {key: data[key] for key in _POINTS if data.get(key)}
        data = {**kept, "digest": digest(points if len(points) > 1 else data["points"])}
    return {key: _without_points(value) for key, value in data.items()}
