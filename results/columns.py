"""The columns of a run's rows, declared once: who writes, reads, groups or tells of a row asks here.

A new column is a line here and its value in campaigns.row (of a label: in campaigns.labels).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Kind = Literal["text", "number", "whole"]
Group = Literal["identity", "label", "localizer", "pose", "outcome", "truth", "answer", "error", "stated"]

#: a run's rows, frames times localizers: no more are planned or read
MAX_ROWS = 1_000_000

_XYZ = ("x", "y", "z")
TRUE_TIP = tuple(f"true_{axis}_mm" for axis in _XYZ)
TIP = tuple(f"est_{axis}_mm" for axis in _XYZ)
TIP_ERROR = tuple(f"error_{axis}_mm" for axis in _XYZ)
#: how far a tip is from the wall, two ways
DISTANCE = ("nearest", "along")
TIP_SIGMA = tuple(f"est_sigma_{axis}_mm" for axis in _XYZ)


@dataclass(frozen=True)
class Column:
    """A column: its name with the `unit` at its end, what it holds, and between which bounds.

    A `label` says what a case is; labels and localizer make rows comparable. `error`s are numbers where a frame was
    localized, and what the boxes are made of. `optional` columns need not be there.
    """

    name: str
    group: Group
    kind: Kind
    meaning: str
    unit: str = ""
    least: float = -math.inf
    most: float = math.inf
    optional: bool = False


def _tip(names: tuple[str, ...], group: Group, meaning: str, *, least: float, most: float) -> tuple[Column, ...]:
    optional = group == "stated"
    return tuple(Column(name, group, "number", meaning, "mm", least, most, optional) for name in names)


def _error(name: str, unit: str, meaning: str, least: float = -1e9) -> Column:
    return Column(name, "error", "number", meaning, unit, least, 1e9)


def _stated(name: str, unit: str, meaning: str, least: float = -math.inf, most: float = math.inf) -> Column:
    return Column(name, "stated", "number", meaning, unit, least, most, optional=True)


def _distances(name: str, meaning: str, *, least: float) -> tuple[Column, ...]:
    words = {"nearest": "to the wall's nearest point", "along": "to the wall along the needle's axis"}
    return tuple(_stated(name.format(way), "mm", meaning.format(words[way]), least) for way in DISTANCE)


COLUMNS = (
    Column("case", "identity", "text", "key of the case, as in cases.jsonl"),
    Column("frame", "identity", "text", "cases with the same one look at the same images", optional=True),
    Column("trajectory", "label", "text", "the line along which the tip moves"),
    Column("spotlights", "label", "text", "how many spotlights, and how they stand"),
    Column("power_w", "label", "number", "power of each spotlight, in the case's convention", "W", 0.0),
    Column("illumination", "label", "text", "the spotlights' light"),
    Column("surface", "label", "text", "the retina's shape"),
    Column("sensor", "label", "text", "what takes the image"),
    Column("resolution_px", "label", "whole", "pixels along a row of the image", "px", 1, 2**31 - 1),
    Column("localizer", "localizer", "text", "what localized the frame"),
    Column("pose", "pose", "whole", "number of the pose along the trajectory", "", 0, 2**31 - 1),
    Column("status", "outcome", "text", "ok or failed"),
    Column("reason", "outcome", "text", "why a frame could not be localized"),
    *_tip(TRUE_TIP, "truth", "the true tip", least=-math.inf, most=math.inf),
    *_tip(TIP, "answer", "the tip that was found", least=-math.inf, most=math.inf),
    *_tip(TIP_ERROR, "error", "found minus true tip", least=-1e9, most=1e9),
    _error("position_error_mm", "mm", "distance of the found from the true tip", 0.0),
    _error("error_rot_y_deg", "deg", "error of the tilt of the line from tip to RCM"),
    _error("error_rot_z_deg", "deg", "error of that line's azimuth"),
    _error("rotation_error_deg", "deg", "root of the sum of the squares of both", 0.0),
    _error("axis_error_deg", "deg", "angle between the found and the true axis", 0.0),
    _stated("true_in_frame", "", "share of the patches' true outline that the frame shows", 0.0, 1.0),
    *_tip(TIP_SIGMA, "stated", "standard deviation of the tip", least=0.0, most=math.inf),
    _stated("est_chi2_tip", "", "the tip's error in units of its covariance: chi-squared of three degrees"),
    _stated("est_sigma_axis_deg", "deg", "standard deviation of the axis", 0.0),
    _stated("est_sigma_roll_deg", "deg", "standard deviation of the roll", 0.0),
    _stated("est_roll_error_deg", "deg", "found minus true roll"),
    *_distances("true_{}_mm", "distance of the true tip {}", least=-math.inf),
    *_distances("est_{}_mm", "distance of the found tip {}", least=-math.inf),
    *_distances("est_sigma_{}_mm", "standard deviation of the distance {}", least=0.0),
    _stated("est_source_mm", "mm", "by how much a source that is no point may pass for farther from the wall", 0.0),
    *_distances("est_error_{}_mm", "found minus true distance {}", least=-math.inf),
    _stated("est_bound_mm", "mm", "root mean square tip error that no unbiased localizer beats", 0.0),
)
_BY_NAME = {column.name: column for column in COLUMNS}


def column(name: str) -> Column:
    """The declaration of a column. Raises KeyError for a swept key's, which only its run knows."""
    return _BY_NAME[name]


def names(*groups: Group) -> tuple[str, ...]:
    """The columns of some groups, in the order of the rows."""
    return tuple(column.name for column in COLUMNS if column.group in groups)


#: what makes rows comparable; swept keys follow it
SETTING = names("label", "localizer")
#: the errors, of which boxes are made
METRICS = names("error")
