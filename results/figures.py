"""Which figures a run has: errors along each trajectory (8, 9) and boxes over light power (10, 11)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from conespot.results.assumptions import assumptions
from conespot.results.pose_figure import pose_figure
from conespot.results.power_figure import power_figure
from conespot.results.run import Run
from conespot.results.style import save, style
from conespot.results.tables import power_in_words, reference_power
from conespot.results.variants import Variant, ordered, split

_MOST_FIGURES = 60
_BY_POSE = {"box": "figure_8", "helix": "figure_9"}
_BY_POWER = {"box": "figure_10", "helix": "figure_11"}
_PUBLISHED = {"smooth": "Table IV", "bumps": "Table V"}
_TUKEY = (
    "Boxes: quartiles; line: median; dot: mean; whiskers: farthest values within 1.5 interquartile ranges (Tukey); "
    "crosses: values beyond them."
)


@dataclass(frozen=True)
class Drawing:
    """A figure to be drawn: `name` is its file's, `draw` makes it inside `style`."""

    name: str
    title: str
    caption: str
    draw: Callable[[str, str], Figure]


def plan_figures(run: Run, boxes: pd.DataFrame | None) -> tuple[list[Drawing], int]:
    """The figures the run has rows for, one for each variant, surface and trajectory; the paper's come first.

    Returns at most sixty, and how many are left out.
    """
    if run.rows is None or boxes is None:
        return [], 0
    found: dict[str, Drawing] = {}
    group = run.rows.group
    for (variant, rows), (_, stored) in zip(split(run.rows.frame, group), split(boxes, group), strict=True):
        for surface in ordered(rows["surface"]):
            for trajectory in ordered(rows["trajectory"]):
                here = (rows["surface"] == surface) & (rows["trajectory"] == trajectory)
                there = (stored["surface"] == surface) & (stored["trajectory"] == trajectory)
                pair = [_along(run, variant, rows[here], surface, trajectory)] if here.any() else []
                if stored.loc[there, "power_w"].nunique() > 1:
                    pair.append(_over_power(run, variant, stored[there], surface, trajectory))
                for drawing in pair:  # long names may only differ in what a file name leaves out
                    taken = drawing.name in found
                    name = f"{drawing.name}-{len(found) + 1}" if taken else drawing.name
                    found[name] = replace(drawing, name=name)
    drawings = sorted(found.values(), key=lambda drawing: not drawing.name.startswith("figure"))
    return drawings[:_MOST_FIGURES], max(len(drawings) - _MOST_FIGURES, 0)


def draw_figures(drawings: list[Drawing], folder: Path) -> list[Path]:
    """Draw them as PNG and SVG into the folder. Raises InputError."""
    written: list[Path] = []
    for drawing in drawings:
        with style():
            written += save(drawing.draw(drawing.title, drawing.caption), folder / drawing.name)
    return written


def _along(run: Run, variant: Variant, rows: pd.DataFrame, surface: str, trajectory: str) -> Drawing:
    power = reference_power(set(rows["power_w"]))
    rows = rows[rows["power_w"] == power]
    title = _title(_BY_POSE, "Errors along the", surface, trajectory, variant)
    counted = f"At {power_in_words(run, variant, power)}. Signed per axis; overall is their length. {_failures(rows)}"
    caption = f"{counted}\n{_assumed(run, variant)}"
    source = _source(surface, trajectory)
    name = _name(_BY_POSE, "along", surface, trajectory, variant)
    return Drawing(name, title, caption, lambda title, caption: pose_figure(rows, title, caption, source))


def _over_power(run: Run, variant: Variant, boxes: pd.DataFrame, surface: str, trajectory: str) -> Drawing:
    title = _title(_BY_POWER, "Errors over light power,", surface, trajectory, variant)
    one = boxes[boxes["metric"] == "position_error_mm"]
    failed, frames = int(one["failed"].sum()), int(one["failed"].sum() + one["n"].sum())
    red = " (in red: how many at each power)" if failed else ""
    least, most = (power_in_words(run, variant, power) for power in (one["power_w"].min(), one["power_w"].max()))
    counted = f"{_TUKEY} {failed} of {frames} frames failed{red}; boxes hold the others. From {least} to {most}."
    caption = f"{counted}\n{_assumed(run, variant)}"
    source = _source(surface, trajectory)
    name = _name(_BY_POWER, "power", surface, trajectory, variant)
    return Drawing(name, title, caption, lambda title, caption: power_figure(boxes, title, caption, source))


def _title(numbers: dict[str, str], what: str, surface: str, trajectory: str, variant: Variant) -> str:
    number = numbers.get(trajectory) if surface == "smooth" else None
    first = f"Fig. {number.removeprefix('figure_')}  " if number else ""
    on = "" if surface == "smooth" else f" on {surface}"
    return f"{first}{what} {trajectory}{on} ({variant.label})"


def _name(numbers: dict[str, str], kind: str, surface: str, trajectory: str, variant: Variant) -> str:
    if surface == "smooth" and trajectory in numbers:
        return f"{numbers[trajectory]}_{variant.slug}"
    return "_".join((kind, *(_plain(part) for part in (trajectory, surface)), variant.slug))


def _plain(name: str) -> str:
    return "".join(c if c.isascii() and c.isalnum() else "-" for c in name)[:40]


def _source(surface: str, trajectory: str) -> str | None:
    return _PUBLISHED.get(surface) if trajectory in _BY_POSE and (surface, trajectory) != ("bumps", "box") else None


def _failures(rows: pd.DataFrame) -> str:
    failed = int((rows["status"] == "failed").sum())
    return f"{failed} of {len(rows)} frames failed{' (red crosses)' if failed else ''}."


def _assumed(run: Run, variant: Variant) -> str:
    return f"Localizer: {variant.setting['localizer']}; {assumptions(run.scene, variant.setting).sentence()}."
