"""The easel: one case of a unit measured as the bench does, with what its localizers saw drawn."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from conespot.campaigns.bench import Bench, finding
from conespot.campaigns.plan import Case, Plan, Unit, told
from conespot.campaigns.row import Record
from conespot.localize.account import account
from conespot.localize.image import AnyImage, white_level
from conespot.localize.outcome import LocalizationFailure, Outcome
from conespot.render.frame_file import write_preview
from conespot.results.overlay import Overlay, Residual


class Easel:
    """Measures one case of a plan, by its key, and draws what it sees into a folder."""

    worn = False

    def __init__(self, plan: Plan, case: str, folder: Path) -> None:
        self._bench = Bench(plan, None)
        self._plan, self._case, self._folder = plan, case, folder
        self.variant = self._bench.variant

    def measure(self, unit: Unit) -> Record:
        """The case's part of the unit's record."""
        case = next(case for case in self._plan.groups[unit.group].cases if case.key == self._case)
        image, outcomes = self._bench.look(unit, case)
        write_preview(self._folder / "frame.png", image, case.scene.sensor.full_scale)
        for localizer, outcome in outcomes.items():
            self._draw(unit, case, image, localizer, outcome)
        # without the bound, which is the scene's and not the answer's
        return Record(
            unit=unit.key, findings=tuple(finding(case, name, found, None) for name, found in outcomes.items())
        )

    def _draw(self, unit: Unit, case: Case, image: AnyImage, localizer: str, outcome: Outcome) -> None:
        from conespot.results.overlay_picture import draw_overlay  # with matplotlib, which who draws crops does without

        said = outcome.reason if isinstance(outcome, LocalizationFailure) else "localized"
        draw_overlay(
            overlay_of(self._plan, unit, case, image, localizer, outcome),
            f"{localizer}, pose {unit.pose}: {said}",
            f"Case {case.key}. {self._plan.says(unit)}, {case.scene.power.value:g} W. Residual: over an even retina.",
            self._folder / f"{re.sub(r'[^A-Za-z0-9.+_-]', '-', localizer)}.png",
        )


def overlay_of(
    plan: Plan, unit: Unit, case: Case, image: AnyImage, localizer: str, outcome: Outcome, *, residuals: bool = True
) -> Overlay:
    """What is drawn over a case's frame `[H, W]` or `[H, W, 3]`: what a localizer saw in it, and the truth.

    `residuals` take many times as long as all else.
    """
    scene, pose = case.scene, plan.groups[unit.group].pose(unit.pose)
    saw = account(image, told(unit, case), localizer, outcome)
    true = [scene.camera.project(scene.outline(pose, k)) for k in range(len(scene.spotlights))]
    lines = {
        "true": [points[np.all(np.isfinite(points), axis=1)] for points in true],
        "found": saw.found,
        "fitted": saw.fitted,
    }
    left = [Residual(p.row, p.column, p.side, p.light - p.predicted) for p in saw.patches] if residuals else []
    white = 1.0 if image.dtype.kind == "f" else float(white_level(image, scene.sensor))
    return Overlay(image, white, lines, saw.mask, left)
