"""The theory of a scene, from plain records: four CSV files, a text for the terminal, and two figures."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from conespot.results.paper_values import NOTES, paper_table_1
from conespot.results.style import COLOURS, frame, plain_numbers, save, style
from conespot.results.table import Block, Table, number
from conespot.scene.atomic import write_atomically

Records = Mapping[str, Sequence[Mapping[str, Any]]]
_TITLES = {
    "table_1": "Table I: greatest difference between cone-sphere curve and ellipse [um]",
    "bounds": "Cramer-Rao bounds: root mean square errors that no unbiased localizer beats on one frame",
    "budget": "Error budget: what one tolerance, and one unit, of each quantity moves the estimate by",
    "design": "Design guidance: the bound with one thing changed at a time",
}
#: a block of its own for each value of these
_APART = {"table_1": [], "bounds": ["resolution_px"], "budget": ["height_mm", "rcm"], "design": ["varied", "rcm"]}
_LINES: dict[str, Any] = {"free": "-", "exact": (0, (5, 3))}
_SHADES = ("#222222", "#0072B2", "#D55E00", "#009E73", "#8A6FB0", "#E69F00")


def write_theory_tables(folder: Path, records: Records, name: str, assumes: str) -> str:
    """Write table_1.csv, bounds.csv, budget.csv, design.csv, theory.txt, and the figures budget and design.

    `records` holds the rows of each of the four tables, `assumes` what they rest on. Returns theory.txt's text.
    Raises InputError for files that cannot be written.
    """
    frames = {table: pd.DataFrame(rows) for table, rows in records.items()}
    known = paper_table_1()
    angles = frames["table_1"]["half_angle_deg"]
    frames["table_1"].insert(2, "published_um", [known.get(round(float(a), 6), math.nan) for a in angles])
    for table, data in frames.items():
        write_atomically(folder / f"{table}.csv", data.to_csv(index=False, float_format="%.9g").encode())
    text = "\n\n".join(_table(table, data).text() for table, data in frames.items())
    text += f"\n\n{name}. {assumes}\n"
    write_atomically(folder / "theory.txt", text.encode())
    with style():
        save(_budget(frames["budget"], name, assumes), folder / "budget")
        save(_design(frames["design"], name, assumes), folder / "design")
    return text


def _table(name: str, data: pd.DataFrame) -> Table:
    apart = _APART[name]
    blocks = []
    parts: list[tuple[list[str], pd.DataFrame]] = [([], data)]
    for key in apart:
        parts = [([*said, f"{_words(key)} {value}"], one) for said, part in parts for value, one in _parts(part, key)]
    for said, part in parts:
        shown = part.drop(columns=apart)
        lines = (tuple(v if isinstance(v, str) else number(v) for v in row) for row in shown.itertuples(index=False))
        blocks.append(
            Block(
                ", ".join(said) or "closed form, no images",
                tuple(_words(str(column)) for column in shown),
                tuple(lines),
                (),
            )
        )
    return Table(name, _TITLES[name], data, tuple(blocks), (NOTES["Table I"],) if name == "table_1" else ())


def _parts(data: pd.DataFrame, key: str) -> list[tuple[Any, pd.DataFrame]]:
    """The values of a column and the rows that have them, in the order in which they come."""
    return [(value, data[data[key] == value]) for value in data[key].unique()]


def _words(column: str) -> str:
    """A column's name as people write it: unit in brackets."""
    what, per, rest = column.partition("_per_unit")
    name, _, unit = what.rpartition("_")
    if unit in {"um", "deg", "mm", "px"}:
        return f"{name.replace('_', ' ')} [{unit}{'/unit' if per else ''}]{rest}"
    return column.replace("_", " ").replace("rcm", "RCM")


def _budget(data: pd.DataFrame, name: str, assumes: str) -> Figure:
    """Bars of the position errors by quantity, a panel for each way the RCM is known, a colour for each height."""
    figure = Figure(figsize=(10.5, 5.4), layout="constrained")
    frame(figure, f"Error budget ({name})", assumes)
    rows = data.drop_duplicates("quantity").to_dict("records")
    labels = [f"{_words(row['quantity'])}, {row['tolerance']:.3g} {row['unit']}" for row in rows]
    order = {row["quantity"]: i for i, row in enumerate(rows)}
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, (rcm, panel) in zip(panels, _parts(data, "rcm"), strict=True):
        for k, (height, part) in enumerate(_parts(panel, "height_mm")):
            places = [order[q] + 0.38 * (k - 0.5) for q in part["quantity"]]
            axes.barh(places, part["position_um"], height=0.36, color=_SHADES[k + 1], label=f"tip {height:g} mm high")
        axes.set_xscale("log")
        plain_numbers(axes.xaxis)
        axes.set_yticks(range(len(labels)), labels)
        axes.set_title(f"RCM {rcm}", loc="left")
        axes.set_xlabel("position [um]")
    panels[0].invert_yaxis()
    panels[1].legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return figure


def _design(data: pd.DataFrame, name: str, assumes: str) -> Figure:
    """The bound on the position over half angle, edge softness and the spread of several spotlights."""
    figure = Figure(figsize=(11.5, 4.8), layout="constrained")
    frame(figure, f"Design guidance ({name})", assumes)
    panels = figure.subplots(1, 3, sharey=True)
    kinds = {"half angle": ("half_angle_deg", "half angle [deg]"), "edge softness": ("softness", "edge softness")}
    for axes, (kind, (column, label)) in zip(panels, kinds.items(), strict=False):
        _lines(axes, data[data["varied"] == kind], column, COLOURS["overall"], "")
        axes.set_xlabel(label)
    rigs = data[data["varied"] == "spotlights"]
    for k, (count, part) in enumerate(_parts(rigs, "spotlights")):
        if count > 1:
            _lines(panels[2], part, "spread_deg", _SHADES[k % len(_SHADES)], f"{count} spotlights, ")
        else:
            for rcm, one in _parts(part, "rcm"):
                panels[2].axhline(
                    one["position_um"].iloc[0], color=_SHADES[0], linestyle=_LINES[str(rcm)], label=f"one, RCM {rcm}"
                )
    panels[2].set_xlabel("angle of each spotlight off the needle [deg]")
    panels[0].set_ylabel("position, root mean square [um]")
    panels[0].set_yscale("log")
    plain_numbers(panels[0].yaxis)
    panels[0].legend()
    panels[2].legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return figure


def _lines(axes: Axes, data: pd.DataFrame, column: str, colour: str, what: str) -> None:
    for rcm, part in _parts(data, "rcm"):
        label = f"{what}RCM {rcm}"
        axes.plot(part[column], part["position_um"], ".", color=colour, linestyle=_LINES[str(rcm)], label=label)
