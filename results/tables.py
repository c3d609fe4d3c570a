"""The tables a run has rows for: ours, published, ratio, n, failed, and the assumption set beside them.

AE is the mean and ME the maximum of `position_error_mm` and `rotation_error_deg` over the localized frames.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import pandas as pd

from conespot.results.assumptions import assumptions, both_conventions, scene_of, theory_assumptions
from conespot.results.paper_values import (
    BOTH,
    NOTES,
    REFERENCE_POWER_W,
    STEADY_ABOVE_W,
    paper_table_1,
    paper_value,
)
from conespot.results.precision import precision_table
from conespot.results.run import VOLUME_COLUMN, Run
from conespot.results.table import Block, Table, number
from conespot.results.variants import Variant, by_axes, split

QUANTITIES = {"AE": "mean", "ME": "max"}
TABLE_METRICS = {"position_error_mm": "position [mm]", "rotation_error_deg": "rotation [deg]"}

_Records = list[dict[str, Any]]


class Key(NamedTuple):
    """Which box of a variant."""

    surface: str
    trajectory: str
    spotlights: str
    power_w: float
    metric: str


_Boxes = dict[Key, dict[str, Any]]
_Maker = Callable[[Run, Variant, _Boxes], tuple[_Records, Block] | None]


def make_tables(run: Run, boxes: pd.DataFrame | None) -> list[Table]:
    """Every table that the run has rows for: I, IV, V, the errors by power, and precision."""
    made = [_table_1(run)]
    if run.rows is not None and boxes is not None:
        parts = [(variant, _indexed(part)) for variant, part in split(boxes, run.rows.group)]
        made.append(
            _collect("table_4", "Table IV: errors on the smooth retina", NOTES["Table IV"], _table_4, run, parts)
        )
        made.append(
            _collect("table_5", "Table V: errors on the deformed retina", NOTES["Table V"], _table_5, run, parts)
        )
        precise = precision_table(run)
        if precise is None or run.rows.frame["power_w"].nunique() > 1:
            made.append(_collect("power", "Errors by light power", NOTES["Figs. 10, 11"], _by_power, run, parts))
        made.append(precise)
    return [table for table in made if table is not None]


def _indexed(part: pd.DataFrame) -> _Boxes:
    """The boxes of a variant in the paper's order."""
    return {
        Key(metric=box["metric"], **axes): {str(name): value for name, value in box.items()}
        for axes, here in by_axes(part)
        for box in here.to_dict("records")
        if box["metric"] in TABLE_METRICS
    }


def _collect(
    name: str, title: str, note: str, make: _Maker, run: Run, parts: list[tuple[Variant, _Boxes]]
) -> Table | None:
    records: _Records = []
    blocks: list[Block] = []
    for variant, boxes in parts:
        made = make(run, variant, boxes)
        if made is not None:
            columns = assumptions(run.scene, variant.setting).columns()
            records += [{**variant.setting, **record, **columns} for record in made[0]]
            blocks.append(made[1])
    return Table(name, title, pd.DataFrame(records), tuple(blocks), (note,)) if blocks else None


def _table_1(run: Run) -> Table | None:
    if run.theory is None:
        return None
    sets = theory_assumptions()
    records: _Records = []
    lines: list[tuple[str, ...]] = []
    for row in run.theory.sort_values("half_angle_deg").to_dict("records"):
        angle, ours = row["half_angle_deg"], row["in_plane_um"]
        known = next((v for a, v in paper_table_1().items() if math.isclose(a, angle)), math.nan)
        numbers = {
            "ours_um": ours,
            "published_um": known,
            "difference_um": ours - known,
            "ratio": ours / known,
            "distance_3d_um": row["distance_3d_um"],
            VOLUME_COLUMN: row.get(VOLUME_COLUMN, math.nan),
        }
        records.append({"half_angle_deg": angle, **numbers, **sets.columns()})
        lines.append((f"{angle:g}", *map(_hundredths, numbers.values())))
    header = ("half angle [deg]", "in plane [um]", "paper", "difference", "ratio", "in 3D [um]", "in 3D, volume [um]")
    block = Block("closed form, no images", header, tuple(lines), (f"Assumes: {sets.sentence()}.",))
    title = "Table I: greatest difference between cone-sphere curve and ellipse"
    return Table("table_1", title, pd.DataFrame(records), (block,), (NOTES["Table I"],))


def _ratio(value: float, base: float | None) -> float:
    return value / base if base else math.nan


def _hundredths(value: float) -> str:
    return f"{value:.2f}".replace("-0.00", "0.00") if math.isfinite(value) else "–"


def at_reference(boxes: _Boxes, surface: str) -> _Boxes:
    """The boxes on a surface at 1 W, the paper's power, or else at the highest power there is."""
    powers = {key.power_w for key in boxes if key.surface == surface}
    power = reference_power(powers)
    return {key: box for key, box in boxes.items() if key.surface == surface and key.power_w == power}


def reference_power(powers: set[float]) -> float:
    """1 W if it is among the `powers`, or else the highest [W]; NaN if there is none."""
    near = [p for p in powers if math.isclose(p, REFERENCE_POWER_W)]
    return near[0] if near else max(powers, default=math.nan)


def _beside_paper(key: Key, box: dict[str, Any], source: str) -> _Records:
    """AE and ME of a box beside the published numbers, where the paper has them."""
    records: _Records = []
    for quantity, statistic in QUANTITIES.items():
        known = paper_value(source, key.trajectory, key.spotlights, quantity, key.metric)
        if known is not None:
            ours = box[statistic]
            compared = {"quantity": quantity, "ours": ours, "published": known, "ratio": ours / known}
            records.append({"source": source, **key._asdict(), **compared, "n": box["n"], "failed": box["failed"]})
    return records


def _table_4(run: Run, variant: Variant, boxes: _Boxes) -> tuple[_Records, Block] | None:
    here = at_reference(boxes, "smooth")
    records: _Records = []
    for metric in TABLE_METRICS:
        for key, box in here.items():
            if key.metric == metric:
                records += _beside_paper(key, box, "Table IV")
        for source in ("abstract", "conclusion"):
            for key, helix in here.items():
                other = key._replace(trajectory="box")
                if key.trajectory == "helix" and key.metric == metric and other in here:
                    records += _beside_paper(key._replace(trajectory=BOTH), _pooled(here[other], helix), source)
    return (records, _error_block(run, variant, records)) if records else None


def _pooled(box: dict[str, Any], helix: dict[str, Any]) -> dict[str, Any]:
    """Both trajectories as one: the mean over all their localized frames."""
    parts = [part for part in (box, helix) if part["n"]]  # without a frame the mean is NaN
    n = sum(part["n"] for part in parts)
    mean = sum(part["mean"] * part["n"] for part in parts) / n if n else math.nan
    most = max((part["max"] for part in parts), default=math.nan)
    return {"mean": mean, "max": most, "n": n, "failed": box["failed"] + helix["failed"]}


def _table_5(run: Run, variant: Variant, boxes: _Boxes) -> tuple[_Records, Block] | None:
    records: _Records = []
    over: list[str] = []
    for key, box in sorted(
        at_reference(boxes, "bumps").items(), key=lambda item: list(TABLE_METRICS).index(item[0].metric)
    ):
        smooth = boxes.get(key._replace(surface="smooth"), {})
        for record in _beside_paper(key, box, "Table V"):
            quantity = record["quantity"]
            known = paper_value("Table IV", key.trajectory, key.spotlights, quantity, key.metric)
            ratio = _ratio(record["ours"], smooth.get(QUANTITIES[quantity]))
            paper = _ratio(record["published"], known)
            records.append({**record, "over_smooth": ratio, "published_over_smooth": paper})
            if smooth:
                error = key.metric.split("_")[0]
                over.append(f"{error} {quantity} {key.spotlights} {number(ratio)} (paper {number(paper)})")
    if not records:
        return None
    notes = (f"Bumps over smooth: {', '.join(over)}.",) if over else ()
    return records, _error_block(run, variant, records, notes)


def _error_block(run: Run, variant: Variant, records: _Records, notes: tuple[str, ...] = ()) -> Block:
    found: dict[tuple[str, ...], dict[str, dict[str, Any]]] = {}
    for record in records:
        where = f"both ({record['source']})" if record["trajectory"] == BOTH else record["trajectory"]
        counts = (str(record["n"]), str(record["failed"]))
        line = (TABLE_METRICS[record["metric"]], where, record["spotlights"], *counts)
        found.setdefault(line, {})[record["quantity"]] = record
    names = [(quantity, name) for quantity in QUANTITIES for name in ("ours", "published", "ratio")]
    lines = tuple((*line, *(number(pair[q][k]) if q in pair else "" for q, k in names)) for line, pair in found.items())
    header = ("error", "trajectory", "spotlights", "n", "failed", "AE", "paper", "ratio", "ME", "paper", "ratio")
    heading = f"{variant.label}, at {power_in_words(run, variant, records[0]['power_w'])}"
    return Block(heading, header, lines, (*notes, *assumed(run, variant)))


def _by_power(run: Run, variant: Variant, boxes: _Boxes) -> tuple[_Records, Block] | None:
    scene = scene_of(run.scene, variant.setting)
    quarter = next((key.power_w for key in boxes if math.isclose(key.power_w, STEADY_ABOVE_W)), math.nan)
    records: _Records = []
    lines: dict[Key, list[str]] = {}
    for key, box in boxes.items():
        watts = both_conventions(scene, key.power_w)
        flux = watts.flux_w if watts else math.nan
        relative = _ratio(box["mean"], boxes.get(key._replace(power_w=quarter), {}).get("mean"))
        values = {name: box[name] for name in ("mean", "median", "max", "n", "failed")}
        isotropic = watts.isotropic_w if watts else math.nan
        both = {"isotropic_w": isotropic, "flux_w": flux}
        records.append({**key._asdict(), **both, **values, "mean_over_quarter_watt": relative})
        where = key.trajectory if key.surface == "smooth" else f"{key.trajectory}, {key.surface}"
        first = [where, key.spotlights, f"{key.power_w:g}", number(1e3 * flux), str(box["n"]), str(box["failed"])]
        line = lines.setdefault(key._replace(metric=""), first)
        line += [number(box["mean"]), number(box["max"]), number(relative)]
    errors = ("mean [mm]", "max [mm]", "relative", "mean [deg]", "max [deg]", "relative")
    header = ("trajectory", "spotlights", "power [W]", "flux [mW]", "n", "failed", *errors)
    note = f"'relative' is the mean over the mean at {STEADY_ABOVE_W} W."
    block = Block(variant.label, header, tuple(map(tuple, lines.values())), (note, *assumed(run, variant)))
    return records, block


def assumed(run: Run, variant: Variant) -> tuple[str, ...]:
    """The assumption set of a variant in a line."""
    return (f"Assumes: {assumptions(run.scene, variant.setting).sentence()}.",)


def power_in_words(run: Run, variant: Variant, power_w: float) -> str:
    """A power of the variant's scene in both conventions."""
    watts = both_conventions(scene_of(run.scene, variant.setting), power_w)
    return watts.words() if watts else f"{power_w:g} W (convention not stated)"
