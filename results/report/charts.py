"""Every chart of a report: the paper's figures first, in the order in which the run's figures are drawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pandas as pd

from conespot.results.figure_kind import Cut
from conespot.results.figures import Drawing
from conespot.results.report.along import along
from conespot.results.report.bounds import beside_bounds, error_budget
from conespot.results.report.chart import Chart, Json
from conespot.results.report.gap import gap
from conespot.results.report.over_power import over_power, table_of
from conespot.results.report.path import paths, space
from conespot.results.report.survey import accuracy, coverage
from conespot.results.run import Run
from conespot.results.style import KINDS
from conespot.results.table import Block, Table

#: how a kind of figure is drawn to be touched; another kind is shown as the picture it is
_TOUCHED: dict[str, Callable[[Cut], tuple[list[Json], Json, list[list[str]]]]] = {
    "power": over_power,
    "along": along,
    "reality_gap": gap,
}


def figure_charts(drawings: Sequence[Drawing]) -> list[Chart]:
    """The run's figures that can be touched."""
    found = []
    for number, drawing in enumerate(drawings):
        draw = _TOUCHED.get(drawing.kind.name)
        if draw is not None:
            traces, layout, grid = draw(drawing.cut)
            files = [f"figures/{drawing.name}.{kind}" for kind in KINDS]
            shown, _, _ = drawing.caption.partition("\n")  # below it stands what is assumed, which the page tells once
            found.append(Chart(f"figure-{number}", drawing.title, shown, _words(drawing), traces, layout, files, grid))
    return found


def pictures(drawings: Sequence[Drawing]) -> list[Drawing]:
    """The figures of kinds that cannot be touched."""
    return [drawing for drawing in drawings if drawing.kind.name not in _TOUCHED]


def survey_charts(run: Run) -> dict[str, Chart]:
    """Charts of the whole run, by what they show: `power`, `exposure`, `coverage`."""
    found: dict[str, Chart] = {}
    said = {
        "power": (
            "Accuracy over light power",
            "Medians of the frames that were localized; power as its case states it.",
        ),
        "exposure": (
            "Accuracy over the exposure limit",
            "The worst place of the path, spotlights alone, over the nearer of the photochemical and the thermal limit "
            "of ISO 15004-2 (2007). A research estimate, not a safety assessment.",
        ),
    }
    for name, (traces, layout) in accuracy(run).items():
        if not traces:  # each setting has one power
            continue
        title, caption = said[name]
        words = f"{title}: {len(traces)} lines of median position errors. The tables hold the numbers."
        found[name] = Chart(f"survey-{name}", title, caption, words, traces, layout)
    covered = coverage(run)
    if covered is not None:
        traces, layout, left_out = covered
        title = "How many frames were localized, and why not the others"
        words = "Bars of the shares of frames. The table of refusals holds the numbers."
        caption = (
            f"{left_out} more settings, of which none or no larger share was refused, are not drawn."
            if left_out
            else ""
        )
        found["coverage"] = Chart("survey-coverage", title, caption, words, traces, layout)
    return found


def theory_charts(run: Run, theory: Sequence[Table]) -> list[Chart]:
    """Bounds beside errors, and the error budget, as far as the run's rows or its folder's tables have them."""
    found = []
    said = (
        (
            beside_bounds(run, theory),
            "bounds",
            "Errors beside their Cramer-Rao bound",
            "No unbiased localizer has a smaller root mean square error. Errors are those at the reference power; "
            "bounds of the same frames hold over even albedo with what the localizer knows; those of campaign theory "
            "are of one frame each, with the tip at two heights.",
        ),
        (
            error_budget(theory),
            "budget",
            "Error budget",
            "By how much an outline fit is off when one quantity is by the tolerance beside its name.",
        ),
    )
    for drawn, name, title, caption in said:
        if drawn is not None:
            words = f"{title}, in micrometres. The tables hold the numbers."
            found.append(Chart(f"theory-{name}", title, caption, words, *drawn))
    return found


def path_charts(run: Run) -> list[Chart]:
    """The paths in space."""
    found = []
    for number, (name, traces) in enumerate(paths(run)):
        words = f"The path of the tip in space, {name}: true and found tips, and the ends of the needles."
        found.append(Chart(f"path-{number}", name, "", words, traces, space(traces)))
    return found


def numbers_of(drawings: Sequence[Drawing]) -> dict[str, Block]:
    """The numbers of the box charts as tables, by the chart's name."""
    return {
        f"figure-{number}": Block("", tuple(header), tuple(lines), ())
        for number, drawing in enumerate(drawings)
        if drawing.kind.name == "power"
        for header, lines in [table_of(_shown(drawing.cut.boxes))]
    }


def _shown(boxes: pd.DataFrame) -> pd.DataFrame:
    return boxes.sort_values(["spotlights", "power_w"], kind="stable").iloc[:400]


def _words(drawing: Drawing) -> str:
    return f"{drawing.title}. {drawing.caption.partition(chr(10))[0]}"
