"""A row of errors: the truth of a pose against what one localizer found in one frame. Nowhere else do they meet."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field, FiniteFloat, model_validator

from conespot.results.columns import TIP, TIP_ERROR, TIP_SIGMA, TRUE_TIP
from conespot.scene import Pose, Scene
from conespot.scene.model import Model

if TYPE_CHECKING:
    from conespot.campaigns.plan import Plan

Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Row = dict[str, str | float]
_NAN = math.nan


class Finding(Model):
    """What one localizer answered on one frame: a pose, or a `reason` why there is none."""

    case: str = Field(max_length=64)
    localizer: str = Field(max_length=64)
    reason: str = Field("", max_length=1000)
    apex: Vector | None = None  #: [mm]
    axis: Vector | None = None
    roll: FiniteFloat | None = None  #: [rad], of localizers that measure it
    #: of the apex [mm], the axis along two tangents [rad] and, with six rows, the roll [rad]
    covariance: Annotated[tuple[tuple[FiniteFloat, ...], ...], Field(min_length=5, max_length=6)] | None = None
    bound: Annotated[FiniteFloat, Field(ge=0.0)] | None = None  #: root mean square tip error no estimator beats [mm]

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
    """A finished unit of work: its findings, or the `error` that lost it; `by` is its maker (campaigns.maker)."""

    unit: str = Field(max_length=64)
    by: str = Field("", max_length=500)
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
    row: Row = {name: float(v) for name, v in zip(TRUE_TIP, true.apex, strict=True)}
    apex, axis = (np.array(v or (_NAN,) * 3) for v in ((found.apex, found.axis) if found else (None, None)))
    offset = apex - true.apex
    row |= {name: float(v) for name, v in zip(TIP, apex, strict=True)}
    row |= {name: float(v) for name, v in zip(TIP_ERROR, offset, strict=True)}
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


@dataclass(frozen=True)
class _Stated:
    """Which columns the estimators' own statements need: the same in every row of a run."""

    sigmas: int  #: the largest covariance, 0 if there is none
    roll: bool
    bound: bool

    @classmethod
    def among(cls, findings: Iterable[Finding]) -> _Stated:
        """The columns that these findings fill."""
        sigmas, roll, bound = 0, False, False
        for found in findings:
            sigmas = max(sigmas, len(found.covariance or ()))
            roll, bound = roll or found.roll is not None, bound or found.bound is not None
        return cls(sigmas, roll, bound)

    def row(self, true: Pose, found: Finding | None, scene: Scene) -> Row:
        """Standard deviations and how well they hold, roll and bound; NaN where there is none.

        `est_chi2_tip` is the tip's error in units of its own covariance: chi-squared of three degrees if that is
        right. `true_in_frame` is the share of the patches' true outline that the frame shows.
        """
        row: Row = {}
        if self.sigmas:
            spread, chi2 = [_NAN] * self.sigmas, _NAN
            if found is not None and found.apex is not None and found.covariance is not None:
                for i, line in enumerate(found.covariance):
                    spread[i] = math.sqrt(max(line[i], 0.0))
                error = np.array(found.apex) - true.apex
                # a covariance that cannot be inverted is one a stranger's journal holds
                with contextlib.suppress(np.linalg.LinAlgError):
                    chi2 = float(error @ np.linalg.solve(np.array([line[:3] for line in found.covariance[:3]]), error))
            row = {"true_in_frame": _in_frame(true, scene)}
            row |= dict(zip(TIP_SIGMA, spread, strict=False))
            row |= {"est_chi2_tip": chi2, "est_sigma_axis_deg": math.degrees(math.hypot(spread[3], spread[4]))}
            row |= {"est_sigma_roll_deg": math.degrees(spread[5])} if self.sigmas > 5 else {}
        if self.roll:
            off = None if found is None or found.roll is None else math.remainder(found.roll - true.roll, 2.0 * math.pi)
            row["est_roll_error_deg"] = _NAN if off is None else math.degrees(off)
        if self.bound:
            row["est_bound_mm"] = _NAN if found is None or found.bound is None else found.bound
        return row


def _in_frame(pose: Pose, scene: Scene) -> float:
    edge = np.concatenate([scene.outline(pose, k, points=64) for k in range(len(scene.spotlights))])
    pixels = scene.camera.project(edge)  # NaN where a ray misses the eye compares as outside
    return float(np.mean(np.all((pixels >= 0.0) & (pixels <= scene.camera.shape[::-1]), axis=-1)))


def rows(plan: Plan, records: Mapping[str, Record]) -> Iterator[Row]:
    """The rows of all finished units in the plan's order: case, localizer, pose. Columns: conespot.results.columns.

    The order and every value depend on the campaign alone, not on who finished a unit when.
    """
    stated = _Stated.among(f for record in records.values() for f in record.findings)
    answers = {key: {(f.case, f.localizer): f for f in record.findings} for key, record in records.items()}
    homes = {case.key: group for group in plan.groups for case in group.cases}
    for case in plan.cases:
        group = homes[case.key]
        for localizer in case.localizers:
            for pose in range(len(group.positions)):
                record = records.get(group.unit(pose))
                if record is None:
                    continue
                found = answers[record.unit].get((case.key, localizer))
                reason = record.error if found is None else found.reason
                row: Row = {"case": case.key, "frame": case.frame, **case.labels, "localizer": localizer, "pose": pose}
                row |= {"status": "failed" if reason else "ok", "reason": reason}
                row |= errors(group.pose(pose), found, case.scene.instrument.rcm)
                yield row | stated.row(group.pose(pose), found, case.scene) | case.swept
