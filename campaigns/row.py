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


def errors(true: Pose, found: Finding, rcm: Vector) -> Row:
    """Errors of a finding, NaN where it failed.

    Tilt and azimuth are the paper's: those of the line from the tip to the remote centre of motion `rcm` [mm], as a
    rotation about Y and about Z, and `rotation_error_deg` is the root of the sum of the squares of their errors.
    `axis_error_deg` is the angle between the true axis and the one that was found.
    """
    row: Row = {f"true_{c}_mm": float(v) for c, v in zip(_XYZ, true.apex, strict=True)}
    apex = np.array(found.apex if found.apex is not None else (_NAN,) * 3)
    axis = np.array(found.axis if found.axis is not None else (_NAN,) * 3)
    offset = apex - true.apex
    row |= {f"est_{c}_mm": float(v) for c, v in zip(_XYZ, apex, strict=True)}
    row |= {f"error_{c}_mm": float(v) for c, v in zip(_XYZ, offset, strict=True)}
    row["position_error_mm"] = float(np.linalg.norm(offset))
    tilt = azimuth = _NAN
    if found.apex is not None and found.apex != tuple(rcm):
        line = Pose.through(apex, rcm)
        tilt = math.degrees(line.tilt - true.tilt)
        azimuth = math.degrees(math.remainder(line.azimuth - true.azimuth, 2.0 * math.pi))
    row |= {"error_rot_y_deg": tilt, "error_rot_z_deg": azimuth, "rotation_error_deg": math.hypot(tilt, azimuth)}
    # from the chord, which keeps its digits where the cosine loses half of them
    chord = float(np.linalg.norm(axis - true.axis))
    row["axis_error_deg"] = math.degrees(2.0 * math.asin(min(chord / 2.0, 1.0))) if found.axis is not None else _NAN
    return row


def _sigmas(found: Finding | None) -> Row:
    if found is None or found.covariance is None:
        return {}
    variance = [max(found.covariance[i][i], 0.0) for i in range(len(found.covariance))]
    row: Row = {f"est_sigma_{c}_mm": math.sqrt(variance[i]) for i, c in enumerate(_XYZ)}
    row["est_sigma_axis_deg"] = math.degrees(math.hypot(math.sqrt(variance[3]), math.sqrt(variance[4])))
    return row | ({"est_sigma_roll_deg": math.degrees(math.sqrt(variance[5]))} if len(variance) > 5 else {})


def rows(plan: Plan, records: Mapping[str, Record]) -> Iterator[Row]:
    """The rows of all finished units in the plan's order: case, localizer, pose.

    The order and every value depend on the campaign alone, not on who finished a unit when.
    """
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
                missing = Finding(case=case.key, localizer=localizer, reason=reason or "lost")
                row: Row = {"case": case.key, **case.labels, "localizer": localizer, "pose": pose}
                row |= {"status": "failed" if reason else "ok", "reason": reason}
                row |= errors(group.pose(pose), found or missing, case.scene.instrument.rcm)
                yield row | _sigmas(found) | case.swept
