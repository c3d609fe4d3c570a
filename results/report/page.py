"""The page: sections of a template, filled from a run; its two scripts and nothing else may run in it."""

from __future__ import annotations

import base64
import functools
import hashlib
import importlib.util
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from conespot.results.assumptions import assumptions, pairs
from conespot.results.columns import SETTING, column
from conespot.results.crops import read_crops
from conespot.results.figures import Drawing
from conespot.results.light_exposure import light_exposures
from conespot.results.makers import maker_block, read_makers
from conespot.results.paper_values import CITATION
from conespot.results.reality_gap import is_gap
from conespot.results.report.assumed import assumed
from conespot.results.report.charts import (
    figure_charts,
    numbers_of,
    path_charts,
    pictures,
    survey_charts,
    theory_charts,
)
from conespot.results.report.gallery import LINES, gallery
from conespot.results.report.summary import summary
from conespot.results.report.theory import theory_tables
from conespot.results.report.words import share, um
from conespot.results.run import Run
from conespot.results.table import Block, Table, number
from conespot.results.variants import AXES, by_axes, ordered, split
from conespot.scene import InputError

_MOST_LINES = 300
_MOST_TEXT = 100_000
#: tables that are laid beside published values, which come first
_PUBLISHED = ("expectations", "table_1", "table_4", "table_5", "released", "white")


def make_report(run: Run, tables: Sequence[Table], drawings: Sequence[Drawing], left_out: int, figures: Path) -> bytes:
    """The report as HTML. The PNG of drawings that cannot be touched stand in the folder `figures`, and are inlined."""
    data = run.document.data
    crops = read_crops(run.folder)
    surveys = survey_charts(run)
    theory = theory_tables(run.folder)
    gap = run.rows is not None and is_gap(run)  # whose settings are none of the paper's
    first = [t for name in _PUBLISHED for t in tables if t.name == name and not (gap and name.startswith("table_"))]
    return fill(
        "page.html",
        name=run.name,
        description=str(data.get("description") or "")[:4000],
        summary=summary(run),
        tiles=_tiles(run),
        facts=_facts(run),
        published=first,
        others=[table for table in tables if table not in first],
        theory=theory,
        bounds=theory_charts(run, theory),
        figures=figure_charts(drawings),
        numbers=numbers_of(drawings),
        pictures=[(drawing, _inlined(figures / f"{drawing.name}.png")) for drawing in pictures(drawings)],
        left_out=left_out,
        paths=path_charts(run),
        surveys=surveys,
        gallery=gallery(run, crops),
        crops=crops,
        lines=LINES,
        powers=_powers(run),
        failures=_failures(run),
        assumed=assumed(run),
        seed=str(data.get("seed", "not stated")),
        versions=_versions(data.get("made_with")),
        makers=maker_block(read_makers(run.folder)),
        resolved=(run.folder / "campaign.yaml").read_text(encoding="utf-8")[:_MOST_TEXT],
        citation=CITATION,
    )


def fill(template: str, **content: Any) -> bytes:
    """A template of this folder as a page with style and scripts in it, and a policy that lets nothing else run."""
    scripts = _scripts()
    page = (
        _environment()
        .get_template(template)
        .render(
            style=Markup((resources.files("conespot.results.report") / "style.css").read_text("utf-8")),
            scripts=list(scripts),
            allowed=" ".join(f"'sha256-{hashed}'" for hashed in scripts.values()),
            **content,
        )
    )
    return page.encode()


@functools.cache
def _environment() -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.PackageLoader("conespot.results.report", "."),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


@functools.cache
def _scripts() -> dict[Markup, str]:
    """The page's scripts and their digests, as its policy names them. Raises InputError."""
    here = resources.files("conespot.results.report")
    return {
        Markup(script): base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
        for script in (_plotly(), (here / "script.js").read_text("utf-8"))
    }


def _plotly() -> str:
    """The plotting library's script. Raises InputError."""
    found = importlib.util.find_spec("plotly")  # without importing it, which takes long
    path = Path(*(found.submodule_search_locations or [""])[:1]) / "package_data" / "plotly.min.js" if found else Path()
    if not path.is_file():
        raise InputError("the report needs the package plotly, which is not installed whole: pip install plotly")
    return path.read_text("utf-8")


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
    for variant, part in split(run.rows.frame[[*run.rows.group, "status", "reason"]], run.rows.group):
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


def _versions(made_with: Any) -> list[tuple[str, str]]:
    if not isinstance(made_with, dict):
        return []
    return [(str(name)[:80], str(version)[:200]) for name, version in list(made_with.items())[:60]]


def _tiles(run: Run) -> list[tuple[str, str, str]]:
    """The few numbers that a glance should find: each with what it is and in which words."""
    if run.rows is None:
        return []
    frame = run.rows.frame
    ok = frame["status"] == "ok"
    errors = frame.loc[ok, "position_error_mm"]
    median = um(errors.median()) if len(errors) else "–"
    worst = f"largest {um(errors.max())}" if len(errors) else "nothing was localized"
    return [
        (f"{len(frame):,}", "answers", f"{frame['pose'].nunique():,} poses, {frame['case'].nunique():,} cases"),
        (share(int(ok.sum()), len(frame)), "localized", f"{int((~ok).sum()):,} refused"),
        (median, "median tip error", f"over all settings; {worst}"),
        (f"{frame['localizer'].nunique()}", "localizers", f"at {frame['power_w'].nunique()} powers"),
    ]
