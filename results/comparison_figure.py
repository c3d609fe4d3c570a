"""The comparison of two lights as a figure: errors of both and their paired difference over power."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from conespot.results.comparison import Comparison
from conespot.results.style import COLOURS, frame, plain_numbers

_MOST_PANELS = 6


def comparison_figure(comparison: Comparison, assumed: str) -> Figure:
    """Columns: settings. Above, the medians of both lights; below, the median difference with its interval.

    `assumed` is what the numbers of both lights rest on.
    """
    table = comparison.table
    names = [c for c in ("trajectory", "spotlights", "surface") if table[c].nunique() > 1] or ["trajectory"]
    parts = list(table.groupby(names, sort=False))[:_MOST_PANELS]
    figure = Figure(figsize=(1.5 + 4.0 * max(len(parts), 2), 6.4), layout="constrained")
    frame(figure, f"{comparison.b} against {comparison.a}, {comparison.localizer}", f"{comparison.sentence}\n{assumed}")
    grid = figure.subplots(2, len(parts), sharex=True, sharey="row", squeeze=False)
    colours = {comparison.a: COLOURS["about Y"], comparison.b: COLOURS["failed"]}
    for column, (values, part) in enumerate(parts):
        part = part.sort_values("power_w")
        at = np.arange(len(part))
        above, below = grid[:, column]
        for name, side in ((comparison.a, "a"), (comparison.b, "b")):
            above.plot(at, 1e3 * part[f"median_{side}"], "o-", color=colours[name], label=name)
            for x, failed in zip(at, part[f"failed_{side}"], strict=True):
                if failed:
                    place = (x, 1.0 if side == "a" else 0.93)
                    above.annotate(
                        str(failed), place, xycoords=above.get_xaxis_transform(), color=colours[name], ha="center"
                    )
        error = 1e3 * np.abs(np.stack([part["median"] - part["low"], part["high"] - part["median"]]))
        below.errorbar(at, 1e3 * part["median"], yerr=error, fmt="s", color=COLOURS["overall"], capsize=3.0)
        below.axhline(0.0, color=COLOURS["quiet"], linewidth=0.8)
        above.set_title(", ".join(map(str, values)), loc="left", pad=14.0)
        below.set_xticks(at, [f"{power:g}" for power in part["power_w"]])
        below.set_xlabel("light power [W]")
    medians = 1e3 * table[["median_a", "median_b"]].to_numpy()
    if np.nanmax(medians, initial=0.0) > 10.0 * np.nanmin(medians, initial=np.inf):
        grid[0, 0].set_yscale("log")
        plain_numbers(grid[0, 0].yaxis)
    else:
        grid[0, 0].set_ylim(bottom=0.0)
    grid[0, 0].set_ylabel("median position error [um]\n(numbers above: failed frames)")
    grid[1, 0].set_ylabel(f"{comparison.b} minus {comparison.a} [um]\nmedian, 95 % interval")
    grid[0, -1].legend()
    return figure
