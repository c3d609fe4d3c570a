"""The paper's published numbers, as data.

Source: Zhou, Hennerkes et al., "Theoretical error analysis of spotlight-based instrument localization for retinal
surgery", Robotica 2023: Tables I, IV and V, abstract, conclusion, and the text on light power (Figs. 10, 11).
The frames of Tables IV and V are taken to be those at 1 W, the last power of Figs. 10 and 11.
"""

from __future__ import annotations

import csv
import functools
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import resources

CITATION = (
    'Zhou, Hennerkes et al., "Theoretical error analysis of spotlight-based instrument localization for retinal '
    'surgery", Robotica 2023'
)
#: "the error falls until about 0.25 W and is steady above" [W, isotropic convention]
STEADY_ABOVE_W = 0.25
#: what Tables IV and V were rendered at [W, isotropic convention]
REFERENCE_POWER_W = 1.0
#: the number that the white level of the preset `paper-code` was fitted to, by the campaign `white`
FITTED = ("Table IV", "helix", "single", "AE", "position_error_mm")
#: what the column `trajectory` says for a mean over both of the paper's trajectories
BOTH = "box and helix"
NOTES = {
    "Table I": (
        "Published: the in-plane difference |y - y'| at equal x, for a vertical axis, apex 5 mm above the pole and "
        "x0 = 4.45 mm. The distance between the curves in 3D is larger and stands beside it, there and at its greatest "
        "over the volume of interest with the axis through the RCM."
    ),
    "Table IV": (
        "AE is the mean and ME the maximum over the poses that were localized. The abstract's means over both "
        "trajectories differ from the conclusion's (0.028 and 0.024 mm). The white level of the preset "
        "paper-code was fitted to the number with an asterisk (campaign white); with that preset and the localizer "
        "paper-code, every other number here and in Table V is a prediction."
    ),
    "Table V": "The text gives 0.133 mm for the three-spotlight ME where the table prints 0.080 mm.",
    "Figs. 10, 11": "The text: the error falls until about 0.25 W and is steady above.",
}


@dataclass(frozen=True)
class PaperValue:
    """One published number: AE (mean) or ME (maximum) of `metric` [mm or deg, as the metric's name says]."""

    source: str
    surface: str
    trajectory: str
    spotlights: str
    power_w: float
    quantity: str
    metric: str
    value: float
    note: str


def _read(name: str) -> list[dict[str, str]]:
    with (resources.files("conespot.results") / "data" / name).open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


@functools.cache
def paper_errors() -> tuple[PaperValue, ...]:
    """Tables IV and V, abstract and conclusion."""
    return tuple(
        PaperValue(**{**row, "power_w": float(row["power_w"]), "value": float(row["value"])})  # type: ignore[arg-type]
        for row in _read("paper_errors.csv")
    )


@functools.cache
def paper_table_1() -> dict[float, float]:
    """Table I: the largest in-plane difference [um] between cone-sphere curve and ellipse, by half angle [deg]."""
    return {float(row["half_angle_deg"]): float(row["in_plane_um"]) for row in _read("paper_table_1.csv")}


def paper_value(source: str, trajectory: str, spotlights: str, quantity: str, metric: str) -> float | None:
    """The published number [mm or deg], or None where the paper gives none."""
    wanted = (source, trajectory, spotlights, quantity, metric)
    for row in paper_errors():
        if (row.source, row.trajectory, row.spotlights, row.quantity, row.metric) == wanted:
            return row.value
    return None


def paper_table(surface: str, trajectory: str) -> str | None:
    """The paper's table of errors on a surface along a trajectory, or None where it has none."""
    return next(
        (
            row.source
            for row in paper_errors()
            if row.source.startswith("Table") and (row.surface, row.trajectory) == (surface, trajectory)
        ),
        None,
    )


def purpose(source: str, trajectory: str, spotlights: str, quantity: str, metric: str) -> str:
    """What a published number is used for: the `fit` of the white level, or what is `predicted` from it."""
    if (source, trajectory, spotlights, quantity, metric) == FITTED:
        return "fit"
    if trajectory == BOTH and (spotlights, quantity, metric) == FITTED[2:]:
        return "fit in part"
    return "predicted"


@functools.cache
def paper_released() -> dict[str, float]:
    """What the authors' 100 released estimates come to (a spiral, one spotlight), by statistic [mm]."""
    return {row["statistic"]: float(row["value"]) for row in _read("paper_released.csv")}


def paper_means(
    source: str | None, trajectory: str, rigs: Iterable[str], metric: str, largest: float
) -> dict[str, float]:
    """The published AE by spotlight rig, where the paper has one and it lies among our errors, up to the `largest`.

    More than three times the largest, it would only press them flat in a figure.
    """
    found: dict[str, float] = {}
    for rig in rigs if source else ():
        known = paper_value(str(source), trajectory, rig, "AE", metric)
        if known is not None and not known > 3.0 * largest:  # true for NaN: every frame failed
            found[rig] = known
    return found
