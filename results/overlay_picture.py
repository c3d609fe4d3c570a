"""An overlay as a picture: the frame, its patches, mask and residual side by side. Plain arrays in, PNG out."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from conespot.results.overlay import Overlay, anything_seen, window
from conespot.results.style import COLOURS, frame, style
from conespot.scene.atomic import write_atomically

#: pixels a side that are drawn at most: more would not show
_MOST = 1200
_DPI = 130
#: what is drawn over a frame, in the order of drawing: its colour and line
LINES: dict[str, tuple[str, Any]] = {
    "true": (COLOURS["y"], "-"),
    "found": (COLOURS["about Y"], "-"),
    "fitted": (COLOURS["x"], (0, (4, 3))),
}


def draw_overlay(overlay: Overlay, title: str, caption: str, path: Path) -> Path:
    """Write a PNG with a panel each for the frame, its patches, the mask and the residual, as far as there are any.

    Where nothing was seen the frame stands alone.

    Raises InputError for a file that cannot be written.
    """
    panels = [_whole, _near] if anything_seen(overlay) else [_whole]
    panels += [_masked] if overlay.mask is not None else []
    panels += [_left_over] if overlay.residuals else []
    with style():
        figure = Figure(figsize=(4.4 * max(2, len(panels)), 5.2), layout="constrained")
        frame(figure, title, caption)
        for axes, draw in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
            axes.grid(False)
            draw(axes, overlay)
        figure.set_dpi(_DPI)
        stream = io.BytesIO()
        FigureCanvasAgg(figure).print_png(stream, metadata={"Software": None})  # type: ignore[no-untyped-call]
    write_atomically(path, stream.getvalue())
    return path


def _whole(axes: Axes, overlay: Overlay) -> None:
    height, width = overlay.image.shape[:2]
    _show(axes, overlay, (0, 0, width, height))
    axes.set_title("frame", loc="left")
    _draw_lines(axes, overlay)


def _near(axes: Axes, overlay: Overlay) -> None:
    _show(axes, overlay, window(overlay))
    axes.set_title("outlines", loc="left")
    left, top, right, bottom = window(overlay)
    _draw_lines(axes, overlay)
    axes.set_xlim(left, right)  # a needle may lead out of what is shown
    axes.set_ylim(bottom, top)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc="upper right", labelcolor="white", frameon=True, facecolor="black", framealpha=0.6)


def _masked(axes: Axes, overlay: Overlay) -> None:
    assert overlay.mask is not None
    box = left, top, right, bottom = window(overlay)
    step = _step(box)
    shown = overlay.mask[top:bottom:step, left:right:step]
    axes.imshow(shown, cmap="gray", vmin=0, vmax=1, extent=(left, right, bottom, top), interpolation="nearest")
    axes.set_title("taken for light", loc="left")
    _draw_lines(axes, overlay)


def _left_over(axes: Axes, overlay: Overlay) -> None:
    left, top, right, bottom = window(overlay)
    most = max(float(np.nanquantile(np.abs(r.values), 0.99)) for r in overlay.residuals) or 1.0
    for r in overlay.residuals:
        height, width = r.values.shape
        extent = (r.column, r.column + width * r.side, r.row + height * r.side, r.row)
        drawn = axes.imshow(r.values, cmap="RdBu_r", vmin=-most, vmax=most, extent=extent, interpolation="nearest")
    axes.figure.colorbar(drawn, ax=axes, shrink=0.6, label="seen - predicted [white]")
    axes.set_xlim(left, right)
    axes.set_ylim(bottom, top)
    axes.set_title("residual", loc="left")


def _draw_lines(axes: Axes, overlay: Overlay) -> None:
    for what, (colour, line) in LINES.items():
        for number, points in enumerate(overlay.lines.get(what, ())):
            closed = np.concatenate([points, points[:1]])
            axes.plot(*closed.T, color=colour, linestyle=line, linewidth=1.0, label=None if number else what)
    for mark in overlay.marks:
        points = np.concatenate([mark.points, mark.points[:1]]) if mark.how == "closed" else mark.points
        colour = COLOURS[mark.colour]
        if mark.how == "point":  # with a rim, to be seen on light, dark and lines
            axes.plot(*points.T, "o", color=colour, markersize=5.0, markeredgecolor="white", zorder=5, label=mark.name)
            continue
        line, dot = ("none", ".") if mark.how == "dots" else ("-", "none")
        axes.plot(*points.T, color=colour, linestyle=line, marker=dot, markersize=2.5, linewidth=1.0, label=mark.name)


def _show(axes: Axes, overlay: Overlay, box: tuple[int, int, int, int]) -> None:
    left, top, right, bottom = box
    step = _step(box)
    shown = np.clip(overlay.image[top:bottom:step, left:right:step] / overlay.white, 0.0, 1.0)
    axes.imshow(shown, cmap="gray", vmin=0, vmax=1, extent=(left, right, bottom, top), interpolation="nearest")


def _step(box: tuple[int, int, int, int]) -> int:
    left, top, right, bottom = box
    return max(1, -(-max(right - left, bottom - top) // _MOST))
