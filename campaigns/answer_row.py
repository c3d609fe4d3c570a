"""An answer on a frame from outside as a row, whose columns tables of answers share."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from conespot.localize.distance import Alarm
from conespot.localize.frames.reader import GivenFrame
from conespot.localize.outcome import Localization, LocalizationFailure, Outcome
from conespot.localize.tracking.tracker import Tracked
from conespot.results.columns import TIP_SIGMA

#: what stands beside every distance
RESEARCH = "Research, no safety device."


@dataclass(frozen=True, eq=False)
class Answer:
    """A frame, what was found in it, and whether an alarm lets it pass as safe; None without an alarm.

    `tracked` is what a tracker says of it; `dropped` a frame that came while one was busy, and was not looked at.
    """

    frame: GivenFrame
    outcome: Outcome
    safe: bool | None = None
    tracked: Tracked | None = None
    dropped: bool = False

    @classmethod
    def of(cls, frame: GivenFrame, outcome: Outcome, alarm: Alarm | None, tracked: Tracked | None = None) -> Answer:
        """The answer with what the alarm makes of it."""
        return cls(frame, outcome, None if alarm is None else alarm.safe(outcome), tracked)

    @classmethod
    def late(cls, frame: GivenFrame, alarm: Alarm | None) -> Answer:
        """That of a frame that was dropped: with an alarm, not safe."""
        reason = LocalizationFailure("came while the tracker was busy")
        return cls(frame, reason, None if alarm is None else False, dropped=True)


#: columns of a row; those of a tip and an axis are the ones that `campaign score` reads
FLAT = (
    "frame",
    "time_s",
    "status",
    "x_mm",
    "y_mm",
    "z_mm",
    "axis_x",
    "axis_y",
    "axis_z",
    *(name.removeprefix("est_") for name in TIP_SIGMA),
    "sigma_axis_deg",
    "nearest_mm",
    "sigma_nearest_mm",
    "along_mm",
    "sigma_along_mm",
    "source_mm",
    "safe",
    "reason",
)


#: what a tracker says besides: all but `latency_s` is the same whenever the same frames are replayed
TRACKED = (
    "state",
    "latency_s",
    *(f"predicted_{name}" for name in ("x_mm", "y_mm", "z_mm", "axis_x", "axis_y", "axis_z")),
    *(f"sigma_predicted_{axis}_mm" for axis in "xyz"),
)


def flat(answer: Answer) -> dict[str, Any]:
    """An answer as a row: what is not known is empty."""
    row: dict[str, Any] = dict.fromkeys(FLAT, "")
    # a name that is no UTF-8 with its bytes escaped
    row["frame"] = answer.frame.name.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    row["time_s"] = "" if answer.frame.time_s is None else round(answer.frame.time_s, 9)
    row["safe"] = "" if answer.safe is None else ("yes" if answer.safe else "no")
    if answer.dropped:
        row["state"] = "dropped"
    elif answer.tracked is not None:
        row |= _tracked(answer.tracked)
    found = answer.outcome
    if not isinstance(found, Localization):
        return row | {"status": "dropped" if answer.dropped else "refused", "reason": found.reason}
    row["status"] = "localized"
    row |= dict(zip(("x_mm", "y_mm", "z_mm"), map(float, found.apex_mm), strict=True))
    row |= dict(zip(("axis_x", "axis_y", "axis_z"), map(float, found.axis), strict=True))
    if found.covariance is not None:
        sigmas = [math.sqrt(max(float(found.covariance[i, i]), 0.0)) for i in range(5)]
        row |= {name.removeprefix("est_"): sigma for name, sigma in zip(TIP_SIGMA, sigmas, strict=False)}
        row["sigma_axis_deg"] = math.degrees(math.hypot(*sigmas[3:]))
    if found.distance is not None:
        values = {name: getattr(found.distance, name) for name in FLAT if hasattr(found.distance, name)}
        row |= {name: value for name, value in values.items() if value is not None and math.isfinite(value)}
    return row


def _tracked(tracked: Tracked) -> dict[str, Any]:
    """The tracker's columns of a row; the prediction's where there is one."""
    row = dict.fromkeys(TRACKED, "") | {"state": tracked.state.value, "latency_s": round(tracked.latency_s, 6)}
    if (before := tracked.predicted) is not None:
        values = [*map(float, before.apex_mm), *map(float, before.axis)]
        if before.covariance is not None:
            values += [math.sqrt(max(float(before.covariance[i, i]), 0.0)) for i in range(3)]
        row |= dict(zip(TRACKED[2:], values, strict=False))
    return row
