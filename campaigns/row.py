"""A row of errors: the truth of a pose against what one localizer found in one frame. Nowhere else do they meet."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, FiniteFloat, model_validator

from scene import Pose
from scene.model import Model

if TYPE_CHECKING:
    from campaigns.plan import Plan

Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Row = dict[str, str | float]
_NAN = math.nan
_XYZ = ("x", "y", "z")


class Finding(Model):
    """What one localizer answered on one frame: a pose, or a `reason` why there is none."""

    case: str = Field(max_length=64)
    localizer: str = Field(max_length=64)
    reason: str = Field("", max_length=1000)
    apex: Vector | None = None  #: [mm]
    axis: Vector | None = None
    #: of the apex [mm], the axis along two tangents [rad] and, with six rows, the roll [rad]
    covariance: Annotated[tuple[tuple[FiniteFloat, ...], ...], Field(min_length=5, max_length=6)] | None = None

    @model_validator(mode="after")
    def _whole(self) -> Finding:
        if (self.apex is None) != (self.axis is None) or (self.apex is None) != bool(self.reason):
            raise ValueError("a finding has either apex and axis or a reason")
        if self.axis is not None and abs(math.hypot(*self.axis) - 1.0) > 1e-6:
            raise ValueError("axis must be a unit vector")
        if self.covariance is not None and any(len(row) != len(self.covariance) for row in self.covariance):
            raise ValueError("covariance must be square")
        return self


class Record(Model):
    """A finished unit of work: its findings, or the `error` that lost it."""

    unit: str = Field(max_length=64)
    error: str = Field("", max_length=1000)
    findings: tuple[Finding, ...] = ()

    @model_validator(mode="after")
    def _either(self) -> Record:
        if bool(self.error) == bool(self.findings):
            raise ValueError("a record has either findings or an error")
        return self


def errors(true: Pose, found: Finding | None, rcm: Vector) -> Row:
    """Errors of a finding, NaN where it failed or there is none.

    Tilt and azimuth are the paper's: those of the line from the tip to the remote centre of motion `rcm` [mm], as a
    rotation about Y and about Z, and `rotation_error_deg` is the root of the sum of the squares of their errors.
    `axis_error_deg` is the angle between the true axis and the one that was found.
    """
    row: Row = {f"true_{c}_mm": float(v) for c, v in zip(_XYZ, true.apex, strict=True)}
    apex, axis = (np.array(v or (_NAN,) * 3) for v in ((found.apex, found.axis) if found else (None, None)))
    offset = apex - true.apex
    row |= {f"est_{c}_mm": float(v) for c, v in zip(_XYZ, apex, strict=True)}
    row |= {f"error_{c}_mm": float(v) for c, v in zip(_XYZ, offset, strict=True)}
    row["position_error_mm"] = float(np.linalg.norm(offset))
    tilt = azimuth = _NAN
    if found and found.apex and found.apex != tuple(rcm):
        line = Pose.through(apex, rcm)
        tilt = math.degrees(line.tilt - true.tilt)
        azimuth = math.degrees(math.remainder(line.azimuth - true.azimuth, 2.0 * math.pi))
    row |= {"error_rot_y_deg": tilt, "error_rot_z_deg": azimuth, "rotation_error_deg": math.hypot(tilt, azimuth)}
    # from the chord, which keeps its digits where the cosine loses half of them
    chord = float(np.linalg.norm(axis - true.axis))
    row["axis_error_deg"] = math.degrees(2.0 * math.asin(chord / 2.0 if not chord > 2.0 else 1.0))
    return row


def _sigmas(found: Finding | None, most: int) -> Row:
    """Standard deviations where there is a covariance, else NaN; no columns at all if the largest, `most`, is 0."""
    covariance = found.covariance if found is not None else None
    spread = [_NAN] * most
    for i, row in enumerate(covariance or ()):
        spread[i] = math.sqrt(max(row[i], 0.0))
    named: Row = {f"est_sigma_{c}_mm": sigma for c, sigma in zip(_XYZ, spread, strict=False)}
    if most > 3:
        named["est_sigma_axis_deg"] = math.degrees(math.hypot(spread[3], spread[4]))
    return named | ({"est_sigma_roll_deg": math.degrees(spread[5])} if most > 5 else {})


def rows(plan: Plan, records: Mapping[str, Record]) -> Iterator[Row]:
    """The rows of all finished units in the plan's order: case, localizer, pose.

    The order and every value depend on the campaign alone, not on who finished a unit when.
    """
    most = max((len(f.covariance or ()) for record in records.values() for f in record.findings), default=0)
    homes = {}
    for group in plan.groups:
        first = 0
        for case in group.cases:
            homes[case.key] = group, first
            first += len(case.localizers)
    for case in plan.cases:
        group, first = homes[case.key]
        for k, localizer in enumerate(case.localizers, start=first):
            for pose in range(len(group.positions)):
                record = records.get(group.unit(pose))
                if record is None:
                    continue
                found = record.findings[k] if record.findings else None
                reason = record.error if found is None else found.reason
                row: Row = {"case": case.key, **case.labels, "localizer": localizer, "pose": pose}
                row |= {"status": "failed" if reason else "ok", "reason": reason}
                row |= errors(group.pose(pose), found, case.scene.instrument.rcm)
                yield row | _sigmas(found, most) | case.swept
