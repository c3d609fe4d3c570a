"""The report: one HTML file that needs nothing beside it, and trusts nothing that stands in the run."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jinja2

from conespot.results.assumptions import Assumptions, assumptions, pairs
from conespot.results.columns import SETTING, column
from conespot.results.figures import Drawing
from conespot.results.light_exposure import light_exposures
from conespot.results.makers import maker_block, read_makers
from conespot.results.paper_values import CITATION
from conespot.results.run import Run
from conespot.results.table import Block, Table, number
from conespot.results.variants import AXES, by_axes, ordered, split

_MOST_LINES = 300
_MOST_TEXT = 100_000


def make_report(run: Run, tables: Sequence[Table], drawings: Sequence[Drawing], left_out: int, figures: Path) -> bytes:
    """The report as HTML. The PNG of the `drawings` stand in the folder `figures`; they are inlined as base64."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("conespot.results", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    data = run.document.data
    return (
        environment.get_template("report.html")
        .render(
            name=run.name,
            description=str(data.get("description") or "")[:4000],
            facts=_facts(run),
            tables=tables,
            figures=[(drawing, _inlined(figures / f"{drawing.name}.png")) for drawing in drawings],
            left_out=left_out,
            powers=_powers(run),
            failures=_failures(run),
            assumed=_assumption_sets(run),
            versions=_versions(data.get("made_with")),
            makers=maker_block(read_makers(run.folder)),
            resolved=(run.folder / "campaign.yaml").read_text(encoding="utf-8")[:_MOST_TEXT],
            citation=CITATION,
        )
        .encode()
    )


def _inlined(path: Path) -> str:
    return base64.b64encode(path.read_bytes()).decode("ascii")


def _facts(run: Run) -> list[tuple[str, str]]:
    facts = [("seed", str(run.document.data.get("seed", "not stated")))]
    if run.rows is None:
        return facts
    frame = run.rows.frame
    failed = int((frame["status"] == "failed").sum())
    powers = [f"{power:g}" for power in sorted(frame["power_w"].unique())]
    facts += [
        ("rows", f"{len(frame)} (one per frame and localizer)"),
        ("poses", str(frame["pose"].nunique())),
        *([("frames", str(len(frame[["frame", "pose"]].drop_duplicates())))] if "frame" in frame else []),
        ("failed", f"{failed} ({100.0 * failed / len(frame):.3g} %)"),
        ("power", f"{', '.join(powers[:20])}{' ...' if len(powers) > 20 else ''} W"),
    ]
    for name in SETTING:
        if name != "power_w":
            c = column(name)
            values = [str(value) for value in ordered(frame[name])]
            text = f"{', '.join(values[:12])}{' ...' if len(values) > 12 else ''} {c.unit}".rstrip()
            facts.append((name.removesuffix(f"_{c.unit}"), text))
    stated = assumptions(run.cases, pairs(frame))
    facts += [("power convention", stated.power_convention), ("transfer", stated.transfer)]
    exposures = light_exposures(run).items()
    return facts + [(f"retinal exposure, {name}", exposure.sentence) for name, exposure in exposures]


def _powers(run: Run) -> Block | None:
    """Every power in both conventions, for every beam."""
    if run.rows is None:
        return None
    lines: dict[tuple[str, ...], None] = {}
    stated = run.rows.frame[["case", "power_w"]].drop_duplicates().sort_values("power_w", kind="stable")
    for key, power in stated.itertuples(index=False):
        case = run.cases.get(key)
        if case is not None:
            watts = case.watts
            numbers = (watts.isotropic_w, 1e3 * watts.flux_w, 1e3 * watts.axial_intensity)
            said = case.assumes
            lines[(f"{power:g}", said.power_convention, said.edge, *map(number, numbers))] = None
    header = ("power as stated [W]", "convention", "beam", "isotropic [W]", "flux from the tip [mW]", "on axis [mW/sr]")
    return Block("", header, tuple(lines)[:_MOST_LINES], ()) if lines else None


def _failures(run: Run) -> Block | None:
    """How many frames failed, by setting and reason."""
    if run.rows is None:
        return None
    lines: list[tuple[str, ...]] = []
    for variant, part in split(run.rows.frame, run.rows.group):
        counted: dict[tuple[str, ...], int] = {}
        frames: dict[tuple[str, ...], int] = {}
        for axes, here in by_axes(part[[*AXES, "status", "reason"]]):
            place = (variant.label, axes["surface"], axes["trajectory"], axes["spotlights"], f"{axes['power_w']:g}")
            frames[place] = len(here)
            for reason, count in here.loc[here["status"] == "failed", "reason"].value_counts().items():
                counted[(*place, " ".join(str(reason).split()) or "no reason given")] = int(count)
        lines += [(*key[:-1], str(n), str(frames[key[:-1]]), key[-1]) for key, n in counted.items()]
    header = ("localizer", "surface", "trajectory", "spotlights", "power [W]", "failed", "of", "reason")
    more = len(lines) - _MOST_LINES
    notes = (f"{more} more lines are left out; every failed row stands in errors.csv.",) if more > 0 else ()
    return Block("", header, tuple(lines[:_MOST_LINES]), notes) if lines else None


def _assumption_sets(run: Run) -> Block | None:
    """A line a variant, and one a surface where it has several."""
    if run.rows is None:
        return None
    lines: list[tuple[str, ...]] = []
    for variant, part in split(run.rows.frame, run.rows.group)[:_MOST_LINES]:
        surfaces = ordered(part["surface"])
        for surface in surfaces:
            label = f"{variant.label}, {surface}" if len(surfaces) > 1 else variant.label
            lines.append((label, *assumptions(run.cases, pairs(part[part["surface"] == surface])).columns().values()))
    names = (name.replace("_", " ") for name in Assumptions().columns())
    return Block("", ("numbers of", *names), tuple(lines[:_MOST_LINES]), ())


def _versions(made_with: Any) -> list[tuple[str, str]]:
    if not isinstance(made_with, dict):
        return []
    return [(str(name)[:80], str(version)[:200]) for name, version in list(made_with.items())[:60]]
