"""How every figure looks, and how it becomes the same bytes again from the same data."""

from __future__ import annotations

import io
import string
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from conespot.scene.atomic import write_atomically

#: Okabe and Ito's colours, told apart by colour-blind readers too
COLOURS = {
    "x": "#D55E00",
    "y": "#009E73",
    "z": "#0072B2",
    "overall": "#222222",
    "about Y": "#E69F00",
    "about Z": "#56B4E9",
    "single": "#0072B2",
    "triple": "#D55E00",
    "other": "#009E73",
    "failed": "#CC3311",
    "paper": "#8A6FB0",
    "quiet": "#6B7280",
}
_RC: Any = {
    "text.parse_math": False,  # names come from files: a dollar sign is a dollar sign
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titley": 1.0,  # where it is anyway, without looking at all ticks for it each time
    "axes.labelsize": 9.0,
    "axes.edgecolor": "#9AA1AC",
    "axes.linewidth": 0.8,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.color": "#E3E6EA",
    "grid.linewidth": 0.6,
    "xtick.color": "#4B5563",
    "ytick.color": "#4B5563",
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.hashsalt": "conespot",
    "pdf.fonttype": 3,  # TrueType is made into subsets first, which takes longer than drawing
    "path.simplify": True,
}
_DPI = 150
_PNG_LEVEL = 3  #: in two thirds of the time of 6, and 5 % larger
_NO_DATE = {"Date": None, "Creator": None}
_UNDATED = {"CreationDate": None, "Creator": None, "Producer": None}
#: what a figure is written as
KINDS = ("png", "svg", "pdf")


@contextmanager
def style() -> Iterator[None]:
    """Within it figures are made and drawn in the house's style, whatever the user's matplotlibrc says."""
    with mpl.rc_context():
        # asking for the backend would import pyplot, which no figure needs
        mpl.rcParams.update({key: value for key, value in mpl.rcParamsDefault.items() if key != "backend"})
        mpl.rcParams.update(_RC)
        yield


def files(stem: Path) -> list[Path]:
    """What `save` writes."""
    return [stem.with_name(f"{stem.name}.{kind}") for kind in KINDS]


def save(figure: Figure, stem: Path) -> list[Path]:
    """Write `stem`.png, .svg and .pdf, without dates or versions. Call it inside `style`. Raises InputError."""
    written = dict(zip(KINDS, (io.BytesIO() for _ in KINDS), strict=True))
    figure.set_dpi(_DPI)
    canvas = FigureCanvasAgg(figure)
    renderer = canvas.get_renderer()  # type: ignore[no-untyped-call]
    layout = figure.get_layout_engine()
    if layout is not None:  # once: it costs as much as drawing, and all files then agree
        layout.execute(figure)
        figure.set_layout_engine("none")
        for axes in figure.axes:
            _pin_labels(axes, renderer)
    options = {"compress_level": _PNG_LEVEL}
    canvas.print_png(written["png"], metadata={"Software": None}, pil_kwargs=options)  # type: ignore[no-untyped-call]
    FigureCanvasSVG(figure).print_svg(written["svg"], metadata=_NO_DATE)  # type: ignore[no-untyped-call]
    FigureCanvasPdf(figure).print_pdf(written["pdf"], metadata=_UNDATED)  # type: ignore[no-untyped-call]
    for path, stream in zip(files(stem), written.values(), strict=True):
        write_atomically(path, stream.getvalue())
    return files(stem)


def _pin_labels(axes: Axes, renderer: RendererBase) -> None:
    """Leave the axes' labels where the layout put them: each file would look for their places again, by all ticks."""
    for axis in (axes.xaxis, axes.yaxis):
        axis.get_tightbbox(renderer)  # the layout's last step moves axes from under their labels
        place = axis.label.get_transform().transform(axis.label.get_position())
        axis.set_label_coords(*axes.transAxes.inverted().transform(place))


def frame(figure: Figure, title: str, caption: str) -> None:
    """The title above, and below what the figure shows and assumes, so that the file stands alone."""
    figure.suptitle(title, x=0.012, ha="left", fontsize=11.5, fontweight="bold")
    width = int(15.5 * figure.get_figwidth())
    lines = [line for part in caption.splitlines() for line in textwrap.wrap(part, width)]
    figure.supxlabel("\n".join(lines), x=0.012, ha="left", fontsize=7.5, color=COLOURS["quiet"], linespacing=1.45)


def panel_title(axes: Axes, number: int, what: str, rig: str, pad: float = 7.0) -> None:
    """A panel's letter and title, flush left above it by `pad` points."""
    spotlights = {"single": "single spotlight", "triple": "three spotlights"}.get(rig, rig)
    axes.set_title(f"({string.ascii_lowercase[number]}) {what}, {spotlights}", loc="left", pad=pad)


def paper_label(source: str, drawn: bool) -> str:
    """What a legend says of the published AE, which is not drawn where it would press our errors flat."""
    return f"AE in the paper's\n{source}{'' if drawn else ' (above the axis)'}"


def plain_numbers(axis: Axis) -> None:
    """0.01 instead of a power of ten, on logarithmic axes too."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", "\N{MINUS SIGN}")))
