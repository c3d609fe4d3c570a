"""The gallery: the worst frames of a run with what was seen in them, and what their rows say."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from conespot.results.crops import Crop, Crops
from conespot.results.report.words import rig_words, um
from conespot.results.run import Run
from conespot.results.variants import named

#: what is drawn over a picture, in words
LINES = {"true": "true outline", "found": "outline that was cut out", "fitted": "outline of the answer"}
_LABELS = ("trajectory", "surface", "power_w", "illumination", "resolution_px")


@dataclass(frozen=True)
class Picture:
    """A crop beside its row: `error` in words, `about` where it stands, `paths` its lines as an SVG's."""

    crop: Crop
    error: str
    about: str
    order: float

    @property
    def paths(self) -> dict[str, list[str]]:
        """The outlines, closed, as an SVG path's data by what they are."""
        return {what: [_path(line) for line in self.crop.lines.get(what, ()) if line] for what in LINES}


def gallery(run: Run, crops: Crops) -> list[Picture]:
    """The crops that a row stands for, the worst first; what could not be localized before them."""
    if run.rows is None or not crops.crops:
        return []
    frame = run.rows.frame
    mine = frame[frame["case"].isin({crop.case for crop in crops.crops})]
    rows = {
        (row["case"], row["localizer"], row["pose"]): row
        for row in mine[mine["pose"].isin({crop.pose for crop in crops.crops})].to_dict("records")
    }
    found = []
    for crop in crops.crops:
        row = rows.get((crop.case, crop.localizer, crop.pose))
        if row is not None:
            failed = row["status"] != "ok"
            said = f"not localized: {row['reason']}" if failed else (
                f"{um(row['position_error_mm'])}, {row['rotation_error_deg']:.3g} deg off")  # fmt: skip
            told = [named(name, row[name]) for name in (*_LABELS, *run.rows.swept) if _tells(frame, name)]
            about = ", ".join([crop.localizer, rig_words(row["spotlights"]), *told, f"pose {crop.pose}"])
            found.append(Picture(crop, said, about, -1.0 if failed else -float(row["position_error_mm"])))
    return sorted(found, key=lambda picture: (picture.order != -1.0, picture.order))


def _tells(frame: pd.DataFrame, name: str) -> bool:
    return name == "power_w" or (name in frame and frame[name].nunique() > 1)


def _path(points: tuple[tuple[float, float], ...]) -> str:
    return "M" + "L".join(f"{x:g} {y:g}" for x, y in points) + "Z"
