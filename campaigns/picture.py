"""A picture by which a person judges an answer: the frame, outline predicted, edge seen, tip, axis and ellipsoid."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from conespot.campaigns.answer_row import RESEARCH, Answer
from conespot.localize.account import account
from conespot.localize.image import white_level
from conespot.localize.needle import Needle
from conespot.localize.outcome import Localization
from conespot.results.overlay import Mark, Overlay, Residual
from conespot.results.overlay_picture import draw_overlay
from conespot.scene.scene import Scene

#: the ellipsoid is drawn at least so large [px] a pixel of the frame's width, by a factor that stands beside it
_SHOWN = 0.004
#: a frame is drawn brighter if this quantile of its pixels is below this share of white
_BRIGHTEST, _DIM = 0.9999, 0.3


def draw_answer(answer: Answer, name: str, scene: Scene, localizer: str, path: Path) -> None:
    """Write the picture of an answer, on a frame of that name, as PNG. Raises InputError if it cannot be written."""
    image, found = answer.frame.image, answer.outcome
    saw = account(image, scene, localizer, found)
    lines = {"found": saw.found, "fitted": saw.fitted}
    marks = [Mark("edge seen", edge, "about Z", "dots") for edge in saw.edges if len(edge)]
    if isinstance(found, Localization):
        marks += _needle(Needle.of(found, found.seen_in(scene)), scene.camera.shape[1])
        said = f"tip {' '.join(f'{value:.4f}' for value in found.apex_mm)} mm"
        below = _distance(found)
    else:
        said, below = "refused", f"Refused: {found.reason}."  # which is long: what stands below is wrapped
    white = 1.0 if image.dtype.kind == "f" else float(white_level(image, scene.sensor))
    residuals = [Residual(p.row, p.column, p.side, p.light - p.predicted) for p in saw.patches]
    brightest = float(np.quantile(image, _BRIGHTEST))
    times = white / brightest if 0.0 < brightest < _DIM * white else 1.0
    notes = [below, {None: "", True: "Safe.", False: "NOT SAFE."}[answer.safe], RESEARCH]
    notes += ["Residual: over an even retina."] if residuals else []
    notes += [f"Drawn {times:.3g} times as bright as it is."] if times > 1.0 else []
    draw_overlay(
        Overlay(image, white / times, lines, saw.mask, residuals, marks),
        f"{localizer}, {name}: {said}",
        " ".join(note for note in notes if note),
        path,
    )


def _needle(needle: Needle, columns: int) -> list[Mark]:
    marks = [
        Mark("needle", needle.shaft, "single"),
        Mark("axis to the wall", needle.beam, "about Y"),
        Mark("nearest wall", needle.nearest, "paper"),
        Mark("tip", needle.tip, "failed", "point"),
    ]
    if needle.ellipsoid is not None:
        spread = needle.ellipsoid - needle.tip
        size, factor = float(np.max(np.abs(spread))), 1
        while 0.0 < size * factor < _SHOWN * columns and factor < 10_000:
            factor *= 10
        name = "95 % ellipsoid" + (f" x {factor}" if factor > 1 else "")
        marks.append(Mark(name, needle.tip + factor * spread, "failed", "closed"))
    return [mark for mark in marks if len(mark.points)]


def _distance(found: Localization) -> str:
    if found.distance is None:
        return ""
    sigma = found.distance.sigma_nearest_mm
    known = "" if sigma is None else f" +- {sigma:.4f}"
    return f"{found.distance.nearest_mm:.4f}{known} mm from the wall, {found.distance.along_mm:.4f} mm along the axis."
