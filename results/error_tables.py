"""Tables of errors from the stored boxes: IV and V beside the paper's, and by light power.

AE is the mean and ME the maximum of `position_error_mm` and `rotation_error_deg` over the localized frames.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import pandas as pd

from conespot.results.assumptions import Assumptions, Pairs, assumptions, pairs, power_in_words, watts_of
from conespot.results.columns import column
from conespot.results.paper_values import BOTH, NOTES, REFERENCE_POWER_W, STEADY_ABOVE_W, paper_value, purpose
from conespot.results.run import Run
from conespot.results.table import Block, Table, number
from conespot.results.variants import AXES, Variant, by_axes, paired

QUANTITIES = {"AE": "mean", "ME": "max"}
#: the errors that the tables hold, with what they are called
_METRICS = {"position_error_mm": "position", "rotation_error_deg": "rotation"}
_UNITS = {metric: f"[{column(metric).unit}]" for metric in _METRICS}

_Records = list[dict[str, Any]]


class Key(NamedTuple):
    """Which box of a variant."""

    surface: str
    trajectory: str
    spotlights: str
    power_w: float
    metric: str


@dataclass(frozen=True)
class Cell:
    """A stored box, and which cases and localizers it is about."""

    box: dict[str, Any]
    about: Pairs


_Cells = dict[Key, Cell]


@dataclass(frozen=True)
class ErrorTable:
    """A table with a block a variant: `make` gives its records and the block, or None where it has no rows."""

    name: str
    title: str
    note: str
    make: Callable[[Run, Variant, _Cells], tuple[_Records, Block] | None]

    def table(self, run: Run, parts: Sequence[tuple[Variant, _Cells]]) -> Table | None:
        """The table of a run with these `cells`; None if no variant has rows for it."""
        records: _Records = []
        blocks: list[Block] = []
        for variant, cells in parts:
            made = self.make(run, variant, cells)
            if made is not None:
                records += [{**variant.setting, **record} for record in made[0]]
                blocks.append(made[1])
        if not blocks:
            return None
        data = pd.DataFrame(records)
        last = list(Assumptions().columns())
        data = data[[*data.columns.drop(last), *last]]
        return Table(self.name, self.title, data, tuple(blocks), (self.note,))


def cells(run: Run, boxes: pd.DataFrame) -> list[tuple[Variant, _Cells]]:
    """The boxes of every variant in the paper's order."""
    return [(variant, _cells(rows, stored)) for variant, rows, stored in paired(run, boxes)]


def _cells(rows: pd.DataFrame, boxes: pd.DataFrame) -> _Cells:
    found: _Cells = {}
    stored: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for record in boxes[boxes["metric"].isin(list(_METRICS))].to_dict("records"):
        box = {str(name): value for name, value in record.items()}
        stored.setdefault(tuple(box[name] for name in AXES), []).append(box)
    for axes, here in by_axes(rows[[*AXES, "case", "localizer"]]):
        about = pairs(here)
        for box in stored[tuple(axes[name] for name in AXES)]:
            found[Key(metric=box["metric"], **axes)] = Cell(box, about)
    return found


def _ratio(value: float, base: float | None) -> float:
    return value / base if base else math.nan


def at_reference(cells: _Cells, surface: str) -> _Cells:
    """The boxes on a surface at 1 W, the paper's power, or else at the highest power there is."""
    power = reference_power({key.power_w for key in cells if key.surface == surface})
    return {key: cell for key, cell in cells.items() if key.surface == surface and key.power_w == power}


def reference_power(powers: set[float]) -> float:
    """1 W if it is among the `powers`, or else the highest [W]; NaN if there is none."""
    near = [p for p in powers if math.isclose(p, REFERENCE_POWER_W)]
    return near[0] if near else max(powers, default=math.nan)


def _beside_paper(run: Run, key: Key, cell: Cell, source: str) -> _Records:
    """AE and ME of a box beside the published numbers, where the paper has them."""
    records: _Records = []
    for quantity, statistic in QUANTITIES.items():
        known = paper_value(source, key.trajectory, key.spotlights, quantity, key.metric)
        if known is not None:
            ours = cell.box[statistic]
            used = purpose(source, key.trajectory, key.spotlights, quantity, key.metric)
            compared = {"quantity": quantity, "ours": ours, "published": known, "ratio": ours / known, "used": used}
            counts = {"n": cell.box["n"], "failed": cell.box["failed"]}
            assumed = assumptions(run.cases, cell.about).columns()
            records.append({"source": source, **key._asdict(), **compared, **counts, **assumed})
    return records


def _table_4(run: Run, variant: Variant, cells: _Cells) -> tuple[_Records, Block] | None:
    here = at_reference(cells, "smooth")
    records: _Records = []
    for metric in _METRICS:
        for key, cell in here.items():
            if key.metric == metric:
                records += _beside_paper(run, key, cell, "Table IV")
        for source in ("abstract", "conclusion"):
            for key, helix in here.items():
                other = key._replace(trajectory="box")
                if key.trajectory == "helix" and key.metric == metric and other in here:
                    records += _beside_paper(run, key._replace(trajectory=BOTH), _pooled(here[other], helix), source)
    return (records, _error_block(run, variant, records, here.values())) if records else None


def _pooled(box: Cell, helix: Cell) -> Cell:
    """Both trajectories as one: the mean over all their localized frames."""
    parts = [cell.box for cell in (box, helix) if cell.box["n"]]  # without a frame the mean is NaN
    n = sum(part["n"] for part in parts)
    mean = sum(part["mean"] * part["n"] for part in parts) / n if n else math.nan
    most = max((part["max"] for part in parts), default=math.nan)
    failed = box.box["failed"] + helix.box["failed"]
    return Cell({"mean": mean, "max": most, "n": n, "failed": failed}, [*box.about, *helix.about])


def _table_5(run: Run, variant: Variant, cells: _Cells) -> tuple[_Records, Block] | None:
    records: _Records = []
    over: list[str] = []
    bumps = at_reference(cells, "bumps")
    for key, cell in sorted(bumps.items(), key=lambda item: list(_METRICS).index(item[0].metric)):
        smooth = cells.get(key._replace(surface="smooth"))
        for record in _beside_paper(run, key, cell, "Table V"):
            quantity = record["quantity"]
            known = paper_value("Table IV", key.trajectory, key.spotlights, quantity, key.metric)
            ratio = _ratio(record["ours"], smooth.box[QUANTITIES[quantity]] if smooth else None)
            paper = _ratio(record["published"], known)
            records.append({**record, "over_smooth": ratio, "published_over_smooth": paper})
            if smooth:
                over.append(
                    f"{_METRICS[key.metric]} {quantity} {key.spotlights} {number(ratio)} (paper {number(paper)})"
                )
    if not records:
        return None
    notes = (f"Bumps over smooth: {', '.join(over)}.",) if over else ()
    return records, _error_block(run, variant, records, bumps.values(), notes)


def _error_block(
    run: Run, variant: Variant, records: _Records, cells: Iterable[Cell], notes: tuple[str, ...] = ()
) -> Block:
    found: dict[tuple[str, ...], dict[str, dict[str, Any]]] = {}
    for record in records:
        where = f"both ({record['source']})" if record["trajectory"] == BOTH else record["trajectory"]
        counts = (str(record["n"]), str(record["failed"]))
        metric = record["metric"]
        line = (f"{_METRICS[metric]} {_UNITS[metric]}", where, record["spotlights"], *counts)
        found.setdefault(line, {})[record["quantity"]] = record
    names = [(quantity, name) for quantity in QUANTITIES for name in ("ours", "published", "ratio")]
    lines = tuple((*line, *(_shown(pair, q, k) for q, k in names)) for line, pair in found.items())
    header = ("error", "trajectory", "spotlights", "n", "failed", "AE", "paper", "ratio", "ME", "paper", "ratio")
    about = _about(cells)
    heading = f"{variant.label}, at {power_in_words(run.cases, about, records[0]['power_w'])}"
    return Block(heading, header, lines, notes, assumptions(run.cases, about))


def _about(cells: Iterable[Cell]) -> Pairs:
    return list(dict.fromkeys(pair for cell in cells for pair in cell.about))


def _shown(pair: dict[str, dict[str, Any]], quantity: str, name: str) -> str:
    """A number of a table's line; the published one that was fitted has an asterisk."""
    if quantity not in pair:
        return ""
    fitted = name == "published" and pair[quantity]["used"] == "fit"
    return f"{number(pair[quantity][name])}{'*' if fitted else ''}"


def _by_power(run: Run, variant: Variant, cells: _Cells) -> tuple[_Records, Block] | None:
    quarter = next((key.power_w for key in cells if math.isclose(key.power_w, STEADY_ABOVE_W)), math.nan)
    records: _Records = []
    lines: dict[Key, list[str]] = {}
    for key, cell in cells.items():
        box, watts = cell.box, watts_of(run.cases, cell.about)
        flux = watts.flux_w if watts else math.nan
        base = cells.get(key._replace(power_w=quarter))
        relative = _ratio(box["mean"], base.box["mean"] if base else None)
        values = {name: box[name] for name in ("mean", "median", "max", "n", "failed")}
        both = {"isotropic_w": watts.isotropic_w if watts else math.nan, "flux_w": flux}
        assumed = assumptions(run.cases, cell.about).columns()
        records.append({**key._asdict(), **both, **values, "mean_over_quarter_watt": relative, **assumed})
        where = key.trajectory if key.surface == "smooth" else f"{key.trajectory}, {key.surface}"
        first = [where, key.spotlights, f"{key.power_w:g}", number(1e3 * flux), str(box["n"]), str(box["failed"])]
        line = lines.setdefault(key._replace(metric=""), first)
        line += [number(box["mean"]), number(box["max"]), number(relative)]
    errors = [text for unit in _UNITS.values() for text in (f"mean {unit}", f"max {unit}", "relative")]
    header = ("trajectory", "spotlights", "power [W]", "flux [mW]", "n", "failed", *errors)
    notes = (f"'relative' is the mean over the mean at {STEADY_ABOVE_W} W.",)
    together = assumptions(run.cases, _about(cells.values()))
    return records, Block(variant.label, header, tuple(map(tuple, lines.values())), notes, together)


POWER = ErrorTable("power", "Errors by light power", NOTES["Figs. 10, 11"], _by_power)
ERROR_TABLES = (
    ErrorTable("table_4", "Table IV: errors on the smooth retina", NOTES["Table IV"], _table_4),
    ErrorTable("table_5", "Table V: errors on the deformed retina", NOTES["Table V"], _table_5),
    POWER,
)
