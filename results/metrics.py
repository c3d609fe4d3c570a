"""What a run's tables hold a number of, by the names that a campaign's `expect:` and its checks use.

A new metric is a line here; `results.check` knows the lines of each table.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

AnyTable = Literal["errors", "table_1", "white"]
Statistic = Literal["mean", "max", "share", "value"]


@dataclass(frozen=True)
class Metric:
    """A number: the `statistic` of a `column` over lines of a `table`; its unit is the last word of its name.

    Of errors the `mean` and `max` are those of the localized frames, `share` is that of the lines whose column says
    "failed"; `value` is what the one line holds.
    """

    table: AnyTable
    column: str
    statistic: Statistic
    meaning: str


METRICS: dict[str, Metric] = {
    "AE mm": Metric("errors", "position_error_mm", "mean", "mean position error"),
    "ME mm": Metric("errors", "position_error_mm", "max", "largest position error"),
    "AE deg": Metric("errors", "rotation_error_deg", "mean", "mean rotation error"),
    "ME deg": Metric("errors", "rotation_error_deg", "max", "largest rotation error"),
    "failed share": Metric("errors", "status", "share", "frames that could not be localized, of all"),
    "Table I um": Metric("table_1", "in_plane_um", "value", "greatest in-plane distance of curve and ellipse"),
    "white W/m2/sr": Metric("white", "white_w_m2_sr", "value", "white level that explains a published error"),
    "least white W/m2/sr": Metric("white", "poses_low", "value", "lower end of 68 % of it over draws of poses"),
    "most white W/m2/sr": Metric("white", "poses_high", "value", "upper end of 68 % of it over draws of poses"),
}
