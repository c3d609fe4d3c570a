"""`campaign compare`: what two lights did in one run or two, written beside the first run's results."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from conespot.results.assumptions import Cases, assumptions, pairs
from conespot.results.comparison import Comparison, compare_lights
from conespot.results.comparison_figure import comparison_figure
from conespot.results.light_exposure import light_exposures
from conespot.results.run import load_run
from conespot.results.style import save, style
from conespot.scene import InputError
from conespot.scene.atomic import write_atomically
from conespot.scene.exposure_limits import RetinalExposure


def compare_runs(folders: Sequence[Path], a: str | None = None, b: str | None = None) -> str:
    """Compare lights pose by pose; writes comparison.txt, tables/comparison.csv and figures/comparison_*.png, .svg.

    `a` is the reference, by default the first light of the first run; every other light is compared with it, or
    `b` alone. Returns the text. Raises InputError for folders that are no runs and rows that do not pair.
    """
    runs = [load_run(folder) for folder in folders]
    rows = [run.rows for run in runs if run.rows is not None]
    if not rows:
        raise InputError(f"{folders[0]}: holds no rows to compare")
    lights = list(dict.fromkeys(str(name) for r in rows for name in r.frame["illumination"]))
    source = ", ".join(map(str, folders))
    a = a or lights[0]
    others = [b] if b else [name for name in lights if name != a]
    if not others:
        raise InputError(
            f"{source}: all frames are in one light, {a}; sweep over scene.illumination or give a second run"
        )
    cases = {key: case for run in runs for key, case in run.cases.items()}
    frame = pd.concat([r.frame for r in rows], ignore_index=True)
    comparisons = [c for other in others for c in compare_lights(rows, a, other, source)]
    exposures = {name: e for run in runs for name, e in light_exposures(run).items() if name in (a, *others)}
    assumed = {name: _assumed(cases, frame[frame["illumination"] == name]) for name in (a, *others)}
    text = _text(comparisons, exposures, assumed)
    folder = folders[0]
    for part in ("tables", "figures"):
        (folder / part).mkdir(exist_ok=True)
    write_atomically(folder / "comparison.txt", text.encode())
    write_atomically(folder / "tables" / "comparison.csv", _table(comparisons).encode())
    with style():
        for c in comparisons:
            figure = comparison_figure(c, f"{assumed[c.a]}\n{assumed[c.b]}")
            save(figure, folder / "figures" / f"comparison_{c.b}_{c.a}_{c.localizer}".replace(" ", "-"))
    return text


def _table(comparisons: Sequence[Comparison]) -> str:
    parts = [c.table.assign(reference=c.a, light=c.b, localizer=c.localizer) for c in comparisons]
    table = pd.concat(parts, ignore_index=True)
    first = ["reference", "light", "localizer"]
    table = table[first + [c for c in table.columns if c not in first]]
    names = {name: f"{name}_mm" for name in ("median_a", "median_b", "median", "low", "high")}
    return str(table.rename(columns=names).to_csv(index=False, float_format="%.9g"))


def _assumed(cases: Cases, rows: pd.DataFrame) -> str:
    """What the numbers of a light assume, in a line."""
    return f"{rows['illumination'].iloc[0]} assumes: {assumptions(cases, pairs(rows)).sentence()}."


def _text(comparisons: Sequence[Comparison], exposures: dict[str, RetinalExposure], assumed: Mapping[str, str]) -> str:
    lines = ["Position errors, paired pose by pose; a pose counts once, with its median over the powers.", ""]
    for c in comparisons:
        lines += [c.sentence, ""]
        lines += [f"  {_line(row, c.swept)}" for row in c.table.to_dict("records")]
        lines.append("")
    lines += [*assumed.values(), ""]
    lines.append("Retinal exposure at the highest power, worst over the poses:")
    lines += [f"  {name}: {exposure.sentence}" for name, exposure in exposures.items()] or ["  not stated"]
    return "\n".join(lines) + "\n"


def _line(row: dict[Hashable, Any], swept: Sequence[str]) -> str:
    """One setting at one power."""
    setting = ", ".join(str(row[name]) for name in ("trajectory", "spotlights", "surface", *swept))
    counts = f"{row['pairs']} pairs, failed {row['failed_b']} and {row['failed_a']} of {row['poses']}"
    if not row["pairs"]:
        return f"{setting}, {row['power_w']:g} W: {counts}"
    errors = f"{1e3 * row['median_b']:.4g} against {1e3 * row['median_a']:.4g} um"
    change = f"{1e3 * row['median']:+.3g} um ({1e3 * row['low']:+.3g} to {1e3 * row['high']:+.3g})"
    return f"{setting}, {row['power_w']:g} W: {errors}, difference {change}, p = {row['p']:.2g}, {counts}"
