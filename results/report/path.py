"""The path in space: where the needle was, where it was found, and the line to where it goes through the wall."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from conespot.results.columns import TIP, TRUE_TIP
from conespot.results.light_exposure import scene_of
from conespot.results.pose_figure import at_reference_power
from conespot.results.report.chart import Json, numbers, plain, tone
from conespot.results.report.frames import frame_of
from conespot.results.run import Run
from conespot.results.variants import by_axes, split

_MOST_PATHS, _MOST_POSES, _MOST_NEEDLES = 12, 300, 40
#: how much of a needle is drawn [mm]: errors of some tens of micrometres would not show on its whole length
_NEEDLE_MM = 1.5

Path = tuple[str, list[Json]]


def paths(run: Run) -> list[Path]:
    """The paths of a run at its reference power by what they are called, at most twelve."""
    found: list[Path] = []
    if run.rows is None:
        return found
    needed = [*run.rows.group, "case", "pose", "status", *TRUE_TIP, *TIP, "position_error_mm"]
    for variant, part in split(run.rows.frame[needed], run.rows.group):
        for axes, here in by_axes(at_reference_power(part)):
            if len(found) == _MOST_PATHS:
                return found
            name = f"{axes['trajectory']}, {axes['surface']}, {axes['spotlights']}, {variant.label}"
            traces = _path(here.sort_values("pose"), _rcm(run, str(here["case"].iloc[0])))
            if traces:
                found.append((name, traces))
    return found


def space(traces: list[Json]) -> Json:
    """The layout of a path in space: one scale along all axes, none of them shorter than a third of the longest."""
    ranges = {axis: _ends([x for trace in traces for x in trace[axis] if x is not None]) for axis in "xyz"}
    longest = max(high - low for low, high in ranges.values())
    axes, lengths = {}, {}
    for axis, (low, high) in ranges.items():
        half = 0.55 * max(high - low, longest / 3.0)
        axes[f"{axis}axis"] = {
            "title": {"text": f"{axis} [mm]"},
            "range": [(low + high) / 2.0 - half, (low + high) / 2.0 + half],
        }
        lengths[axis] = 2.0 * half / longest
    camera = {"eye": {"x": 1.5, "y": -1.5, "z": 0.85}, "center": {"x": 0, "y": 0, "z": -0.06}}
    return {
        "height": 560, "scene": {**axes, "aspectmode": "manual", "aspectratio": lengths, "camera": camera},
        "margin": {"l": 0, "r": 0, "t": 40, "b": 0},
        "legend": {"orientation": "h", "x": 0, "y": 1, "yref": "container", "yanchor": "top"},
    }  # fmt: skip


def _ends(values: list[float]) -> tuple[float, float]:
    low, high = min(values), max(values)
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def _path(rows: pd.DataFrame, rcm: NDArray[np.float64] | None) -> list[Json]:
    rows = rows[np.isfinite(rows[list(TRUE_TIP)].to_numpy(float)).all(axis=1)]
    rows = rows.iloc[:: max(1, -(-len(rows) // _MOST_POSES))]
    if rows.empty:
        return []
    ok = rows[rows["status"] == "ok"]
    lost = rows[rows["status"] != "ok"]
    true = rows[list(TRUE_TIP)].to_numpy(float)
    found = ok[list(TIP)].to_numpy(float)
    traces = [
        _points(true, "true tips", "true", "lines+markers", [int(pose) for pose in rows["pose"]]),
        _points(found, "found tips", "found", "markers", [
            [frame_of(row), int(row["pose"]), f"{1e3 * row['position_error_mm']:.3g}"] for row in ok.to_dict("records")
        ]),
    ]  # fmt: skip
    traces[0]["hovertemplate"] = "pose %{customdata}, true tip<extra></extra>"
    traces[1]["hovertemplate"] = "pose %{customdata[1]}: %{customdata[2]} um off<extra></extra>"
    if len(lost):
        told = [int(pose) for pose in lost["pose"]]
        refused = _points(lost[list(TRUE_TIP)].to_numpy(float), "not localized", "failed", "markers", told)
        traces.append({**refused, "hovertemplate": "pose %{customdata} not localized<extra></extra>"})
    if rcm is not None:
        some = slice(None, None, max(1, -(-len(true) // _MOST_NEEDLES)))
        traces.append(_needles(true[some], rcm, "true needles", "true"))
        some = slice(None, None, max(1, -(-len(found) // _MOST_NEEDLES)))
        traces.append(_needles(found[some], rcm, "found needles", "found"))
    return traces


def _points(points: NDArray[np.float64], name: str, colour: str, mode: str, told: list[Any]) -> Json:
    x, y, z = (numbers(values) for values in points.T)
    return {
        "type": "scatter3d", "mode": mode, "x": x, "y": y, "z": z, "name": plain(name), "customdata": told,
        "marker": {"size": 3.2, "color": tone(colour)}, "line": {"width": 2, "color": tone(colour)},
    }  # fmt: skip


def _needles(tips: NDArray[np.float64], rcm: NDArray[np.float64], name: str, colour: str) -> Json:
    """The end of each needle: a line from its tip towards the remote centre of motion."""
    along = rcm - tips
    length = np.linalg.norm(along, axis=1, keepdims=True)
    ends = tips + along / np.where(length > 0.0, length, 1.0) * np.minimum(_NEEDLE_MM, length)
    gaps = np.full_like(tips, np.nan)  # lifts the pen between needles
    lines = np.stack([tips, ends, gaps], axis=1).reshape(-1, 3)
    trace = _points(lines, name, colour, "lines", [])
    return {**trace, "hoverinfo": "skip", "line": {"width": 5 if colour == "true" else 3, "color": tone(colour, 0.75)}}


def _rcm(run: Run, case: str) -> NDArray[np.float64] | None:
    """The remote centre of motion of a case [mm]; None if it does not say."""
    scene = scene_of(run.cases[case]) if case in run.cases else None
    return None if scene is None else np.asarray(scene.instrument.rcm, float)
