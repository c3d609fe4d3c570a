"""Which figures a run has. A new kind is a class in a module of its own and its name in `FIGURES`."""

from __future__ import annotations

import contextlib
import itertools
import multiprocessing
import os
import signal
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing.process import BaseProcess
from pathlib import Path

import pandas as pd

from conespot.results.figure_kind import Cut, FigureKind
from conespot.results.pose_figure import AlongTrajectory
from conespot.results.power_figure import OverPower
from conespot.results.reality_figure import RealityGap
from conespot.results.run import Run
from conespot.results.style import files, save, style
from conespot.results.variants import Variant, ordered, paired

FIGURES: dict[str, FigureKind] = {kind.name: kind for kind in (AlongTrajectory(), OverPower(), RealityGap())}
_MOST_FIGURES = 60


@dataclass(frozen=True)
class Drawing:
    """A figure to be drawn: `name` is its file's."""

    name: str
    title: str
    caption: str
    kind: FigureKind
    cut: Cut


def plan_figures(run: Run, boxes: pd.DataFrame | None) -> tuple[list[Drawing], int]:
    """The figures the run has rows for, one for each variant, surface and trajectory; the paper's come first.

    Returns at most sixty, and how many are left out.
    """
    found: dict[str, Drawing] = {}
    for kinds, cut in _parts(run, boxes) if boxes is not None else ():
        for kind in kinds:
            if kind.suits(cut):
                stem = kind.stem(cut)  # long names may only differ in what a file name leaves out
                name = f"{stem}-{len(found) + 1}" if stem in found else stem
                found[name] = Drawing(name, kind.title(cut), kind.caption(cut), kind, cut)
    variants = list(dict.fromkeys(drawing.cut.variant.slug for drawing in found.values()))

    def place(drawing: Drawing) -> tuple[bool, int, int]:  # a variant's figures as the paper numbers them
        kind = list(FIGURES).index(drawing.kind.name)
        return not drawing.name.startswith("figure"), variants.index(drawing.cut.variant.slug), kind

    drawings = sorted(found.values(), key=place)
    return drawings[:_MOST_FIGURES], max(len(drawings) - _MOST_FIGURES, 0)


def draw_figures(drawings: list[Drawing], folder: Path) -> list[Path]:
    """Draw them as PNG, SVG and PDF into the folder, on all cores where the system can fork. Raises InputError."""
    with drawn_meanwhile(drawings, folder) as paths:
        pass
    return paths


@contextlib.contextmanager
def drawn_meanwhile(drawings: list[Drawing], folder: Path) -> Iterator[list[Path]]:
    """The files of `draw_figures`, drawn while something else is done, and there when the context ends."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    shares = [drawings[i::cores] for i in range(cores) if drawings[i::cores]]
    helpers: list[BaseProcess] = []
    for share in shares if cores > 1 else ():
        helpers.append(multiprocessing.get_context("fork").Process(target=_help, args=(share, folder), daemon=True))
        with warnings.catch_warnings():
            # of threads that might hold what drawing needs: those of Arrow and BLAS do not
            warnings.simplefilter("ignore", DeprecationWarning)
            helpers[-1].start()
    yield [path for drawing in drawings for path in files(folder / drawing.name)]
    for share, helper in itertools.zip_longest(shares, helpers):
        if helper is not None:
            helper.join()
        if helper is None or helper.exitcode:
            _draw(share, folder)  # says what is wrong, or has memory enough now


def _draw(drawings: list[Drawing], folder: Path) -> None:
    for drawing in drawings:
        with style():
            save(drawing.kind.draw(drawing.cut, drawing.title, drawing.caption), folder / drawing.name)


def _help(drawings: list[Drawing], folder: Path) -> None:
    """Draw in a process of its own, which says nothing of signals or of what is wrong: its parent does."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_DFL)
    try:
        _draw(drawings, folder)
    except BaseException:
        os._exit(1)


def _parts(run: Run, boxes: pd.DataFrame) -> Iterator[tuple[list[FigureKind], Cut]]:
    """What is drawn of a run: figures of all its rows or, where there are none, of each part."""
    if run.rows is not None:
        whole = Cut(run, Variant({}, "all localizers", "all"), "", "", run.rows.frame, boxes)
        of_run = [kind for kind in FIGURES.values() if kind.of_run and kind.suits(whole)]
        if of_run:
            yield of_run, whole
            return
    of_parts = [kind for kind in FIGURES.values() if not kind.of_run]
    for cut in _cuts(run, boxes):
        yield of_parts, cut


def _cuts(run: Run, boxes: pd.DataFrame) -> Iterator[Cut]:
    for variant, rows, stored in paired(run, boxes):
        for surface in ordered(rows["surface"]):
            for trajectory in ordered(rows["trajectory"]):
                here, there = (
                    frame[(frame["surface"] == surface) & (frame["trajectory"] == trajectory)]
                    for frame in (rows, stored)
                )
                yield Cut(run, variant, surface, trajectory, here, there)
