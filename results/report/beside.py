"""Runs side by side: one page with their numbers in the same lines and their boxes in the same panels."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import pandas as pd

from conespot.results.boxes import box_table
from conespot.results.columns import SETTING, Column, column
from conespot.results.paper_values import CITATION
from conespot.results.power_figure import PANELS, shown_powers
from conespot.results.report.chart import Chart, Json, axes, numbers, panels, plain, subplots, tone
from conespot.results.report.page import fill
from conespot.results.report.words import rig_words, share
from conespot.results.run import Run
from conespot.results.side_by_side import SideBySide, side_by_side
from conespot.results.table import Block, number
from conespot.results.variants import named, ordered
from conespot.scene import InputError

FILE = "side_by_side.html"
MOST_RUNS = 6
_SHADES = ("single", "triple", "y", "paper", "about-y", "about-z")
_MOST_LINES, _MOST_CHARTS, _MOST_RIGS = 400, 12, 3
_MOST_WORD = 120
#: of a resolved campaign, what says nothing of the experiment
_ASIDE = ("name", "description", "made_with", "expect")


def lay_beside(runs: Sequence[Run]) -> tuple[bytes, list[str]]:
    """Runs as one page, the first the reference, and its sentences.

    Raises InputError for too many, and where no setting is in both.
    """
    if len(runs) > MOST_RUNS:
        raise InputError(
            f"report: {len(runs)} run folders are more than {MOST_RUNS}, beside which nobody finds a thing"
        )
    names = _names(runs)
    found = [side_by_side(runs[0], run) for run in runs[1:]]
    sentences = [one.sentence(names[0], name) for one, name in zip(found, names[1:], strict=True)]
    page = fill(
        "beside.html",
        name=" beside ".join(names),
        names=names,
        summary=sentences,
        whole=_whole(runs, names),
        differing=_differing(runs, names),
        tables=[_block(one, names[0], name) for one, name in zip(found, names[1:], strict=True)],
        charts=list(_charts(runs, names, found[0].keys)),
        citation=CITATION,
    )
    return page, sentences


def _names(runs: Sequence[Run]) -> list[str]:
    """The runs' names, or their folders' where names are equal."""
    names = [run.name for run in runs]
    if len(set(names)) == len(names):
        return names
    folders = [run.folder.resolve().name for run in runs]
    return folders if len(set(folders)) == len(folders) else [f"{name} ({i})" for i, name in enumerate(names, 1)]


def _whole(runs: Sequence[Run], names: Sequence[str]) -> Block:
    """A line for each run: over all its settings."""
    lines = []
    for run, name in zip(runs, names, strict=True):
        assert run.rows is not None
        frame = run.rows.frame
        ok = frame["status"] == "ok"
        errors = frame.loc[ok, "position_error_mm"]
        told = [number(1e3 * value) for value in (errors.mean(), errors.median(), errors.max())]
        poses = frame["pose"].nunique()
        lines.append((name, str(len(frame)), str(poses), share(int(ok.sum()), len(frame)), *told))
    header = ("run", "answers", "poses", "localized", "mean [um]", "median [um]", "largest [um]")
    return Block("", header, tuple(lines), ())


def _differing(runs: Sequence[Run], names: Sequence[str]) -> Block | None:
    """The keys in which the resolved campaigns differ."""
    told = [dict(_flat({k: v for k, v in run.document.data.items() if k not in _ASIDE})) for run in runs]
    keys = dict.fromkeys(key for one in told for key in one)
    lines = [(key, *(one.get(key, "–")[:_MOST_WORD] for one in told)) for key in keys]
    lines = [line for line in lines if len(set(line[1:])) > 1]
    more = len(lines) - _MOST_LINES
    notes = (f"{more} more keys differ.",) if more > 0 else ()
    return Block("", ("key", *names), tuple(lines[:_MOST_LINES]), notes) if lines else None


def _flat(data: Any, path: str = "") -> Iterator[tuple[str, str]]:
    if isinstance(data, dict) and data:
        for key, value in data.items():
            yield from _flat(value, f"{path}.{key}" if path else str(key))
    else:
        yield path[:_MOST_WORD], str(data)


def _block(one: SideBySide, a: str, b: str) -> Block:
    """The settings of both, a line each; position errors in um."""
    lines = []
    for row in one.table.head(_MOST_LINES).to_dict("records"):
        setting = tuple(f"{v:g}" if isinstance(v := row[name], float) else str(v) for name in one.keys)
        failed = f"{row['failed_a']} / {row['failed_b']}"
        errors = (number(1e3 * row[name]) for name in ("mean_a", "mean_b", "median_a", "median_b"))
        difference = f"{1e3 * row['difference']:+.3g}" if math.isfinite(row["difference"]) else "–"
        z = f"{row['z']:+.3g}" if math.isfinite(row["z"]) else "–"
        paired = "paired" if row["paired"] else "apart"
        tells = "yes" if abs(row["z"]) > one.bar else "no"
        counts = f"{row['n_a']} / {row['n_b']}"
        mean_a, mean_b, *medians = errors
        change = (number(row["ratio"]), difference, z, tells)
        lines.append((*setting, mean_a, mean_b, *change, paired, counts, failed, " / ".join(medians)))
    columns = {name: column(name) for name in SETTING}
    setting = tuple(_heading(name, columns.get(name)) for name in one.keys)
    header = (*setting, f"mean, {a}", f"mean, {b}", "ratio", "difference", "z", "differs", "poses", "n", "failed",
              "medians")  # fmt: skip
    notes = [
        f"Tip errors in um; n, failed and medians: {a} / {b}. Ratio and difference are those of the means, {b} "
        f"over and minus {a}. 'paired': the "
        "same poses, z of the mean difference over those that both localized; 'apart': Welch's z. A setting differs "
        f"where |z| > {one.bar:.2f}, which one of {len(one.table)} passes by chance in 5 % (Sidak)."
    ]
    for count, name in zip(one.alone, (a, b), strict=True):
        notes += [f"{count} more settings stand in {name} alone."] if count > 0 else []
    if len(one.table) > _MOST_LINES:
        notes.append(f"{len(one.table) - _MOST_LINES} more settings are left out.")
    return Block(f"{b} beside {a}", header, tuple(lines), tuple(notes))


def _heading(name: str, known: Column | None) -> str:
    """A column of the settings, with its unit."""
    if known is None or not known.unit:
        return name.removeprefix("scene.")
    return f"{name.removesuffix(f'_{known.unit.lower()}')} [{known.unit}]"


def _charts(runs: Sequence[Run], names: Sequence[str], keys: tuple[str, ...]) -> Iterator[Chart]:
    """Boxes of the errors over power, of all runs in the same panels; a chart for each setting of the rest."""
    boxes = [box_table(run.rows) for run in runs if run.rows is not None]
    apart = [name for name in keys if name not in ("power_w", "spotlights") and all(name in one for one in boxes)]
    whole = pd.concat([one.assign(run=i) for i, one in enumerate(boxes)], ignore_index=True)
    parts = whole.groupby(apart, sort=True) if apart else [((), whole)]
    shown = 0
    for values, part in parts:
        if part["run"].nunique() < 2 or shown == _MOST_CHARTS:
            continue
        setting = ", ".join(named(name, value) for name, value in zip(apart, values, strict=True))
        yield _chart(f"beside-{shown}", setting or "Errors over light power", part, names)
        shown += 1


def _chart(name: str, title: str, boxes: pd.DataFrame, names: Sequence[str]) -> Chart:
    rigs, powers = [str(rig) for rig in ordered(boxes["spotlights"])][:_MOST_RIGS], shown_powers(boxes)
    titles = [[f"{what}, {plain(rig_words(rig))}" for rig in rigs] for what, _ in PANELS]
    units = [f"{what.lower()} error [{column(metric).unit}]" for what, metric in PANELS]
    layout = panels(titles, "light power [W]", units)
    traces: list[Json] = []
    for row, (_, metric) in enumerate(PANELS):
        most = boxes.loc[(boxes["metric"] == metric) & boxes["spotlights"].isin(rigs), "whisker_high"].max()
        for k, rig in enumerate(rigs):
            at = row * len(rigs) + k
            if math.isfinite(most):  # the plotting library sees no extent of boxes that come as quartiles
                layout[f"yaxis{at + 1 if at else ''}"] |= {"range": [0.0, 1.06 * most]}
            here = boxes[(boxes["metric"] == metric) & (boxes["spotlights"] == rig) & (boxes["n"] > 0)]
            for i, told in enumerate(names):
                mine = here[(here["run"] == i) & here["power_w"].isin(powers)]
                # settings that differ in what only one of the runs varies stand in one place: the first is drawn
                mine = mine.drop_duplicates("power_w")
                x = [powers.index(power) + (i - (len(names) - 1) / 2.0) * 0.8 / len(names) for power in mine["power_w"]]
                traces.append({**_boxes(mine, x, told, i, 0.7 / len(names), at == 0), **axes(at)})
    for key in [key for key in layout if key.startswith("xaxis")]:
        ticks = {"tickvals": list(range(len(powers))), "ticktext": [f"{power:g}" for power in powers]}
        layout[key] |= {**ticks, "range": [-0.6, len(powers) - 0.4], "showgrid": False}
    words = f"Boxes of position and rotation errors over light power, {' and '.join(names)} beside each other."
    caption = "Boxes show the quartiles, whiskers end within 1.5 interquartile ranges (Tukey); dashed lines are means."
    return Chart(name, title, caption, words, traces, layout, grid=subplots(len(PANELS), len(rigs)))


def _boxes(boxes: pd.DataFrame, x: list[float], name: str, shade: int, width: float, legend: bool) -> Json:
    colour = _SHADES[shade % len(_SHADES)]
    return {
        "type": "box", "x": x, "q1": numbers(boxes["q1"]), "median": numbers(boxes["median"]),
        "q3": numbers(boxes["q3"]), "lowerfence": numbers(boxes["whisker_low"]),
        "upperfence": numbers(boxes["whisker_high"]), "mean": numbers(boxes["mean"]), "boxmean": True, "width": width,
        "name": plain(name), "legendgroup": str(shade), "showlegend": legend, "hoverinfo": "y+name",
        "line": {"color": tone(colour), "width": 1.4}, "fillcolor": tone(colour, 0.2),
    }  # fmt: skip
