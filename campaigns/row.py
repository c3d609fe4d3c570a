"""A row of errors: the truth of a pose against what one localizer found in one frame. Nowhere else do they meet."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from conespot.results.columns import DISTANCE, TIP, TIP_ERROR, TIP_SIGMA, TRUE_TIP
from conespot.scene import Pose, Scene
from conespot.scene.wall import Wall

if TYPE_CHECKING:
    pass

Vector = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
#: a tip farther than this [mm] is no answer: rows hold errors up to ten times that
FARTHEST = 1e8
_Coordinate = Annotated[FiniteFloat, Field(ge=-FARTHEST, le=FARTHEST)]
_Sigma = Annotated[FiniteFloat, Field(ge=0.0)]
Row = dict[str, float]
_NAN = math.nan
#: a distance from the wall's nearest point and one along the axis [mm]
Ways = tuple[float, float]
_NOWHERE = (_NAN, _NAN, _NAN)


class _Line(BaseModel):
    """What stands in a journal, a million times: read without Python's help, since nobody misspells its keys."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Finding(_Line):
    """What one localizer answered on one frame: a pose, or a `reason` why there is none."""

    case: str = Field(max_length=64)
    localizer: str = Field(max_length=64)
    reason: str = Field("", max_length=1000)
    apex: tuple[_Coordinate, _Coordinate, _Coordinate] | None = None  #: [mm]
    axis: Vector | None = None
    roll: FiniteFloat | None = None  #: [rad], of localizers that measure it
    #: of the apex [mm], the axis along two tangents [rad] and, with six rows, the roll [rad]
    covariance: Annotated[tuple[tuple[FiniteFloat, ...], ...], Field(min_length=5, max_length=6)] | None = None
    #: from the wall's nearest point and along the axis [mm], and their standard deviations [mm] where they are known
    distance: tuple[FiniteFloat, FiniteFloat] | None = None
    distance_sigma: tuple[_Sigma, _Sigma] | None = None
    distance_source: _Sigma = 0.0  #: by which a source that is no point may pass for farther away [mm]
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


class Record(_Line):
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
    (x, y, z), apex, axis = true.apex.tolist(), _NOWHERE, _NOWHERE
    if found is not None and found.apex is not None and found.axis is not None:
        apex, axis = found.apex, found.axis
    offset = apex[0] - x, apex[1] - y, apex[2] - z
    tilt = azimuth = _NAN
    if apex is not _NOWHERE and apex != tuple(rcm):
        line = Pose.through(apex, rcm)
        tilt = math.degrees(line.tilt - true.tilt)
        azimuth = math.degrees(math.remainder(line.azimuth - true.azimuth, 2.0 * math.pi))
    # from the chord, which keeps its digits where the cosine loses half of them
    u, v, w = true.axis.tolist()
    chord = _length(axis[0] - u, axis[1] - v, axis[2] - w)
    return {
        **dict(zip(TRUE_TIP, (x, y, z), strict=True)),
        **dict(zip(TIP, apex, strict=True)),
        **dict(zip(TIP_ERROR, offset, strict=True)),
        "position_error_mm": _length(*offset),
        "error_rot_y_deg": tilt,
        "error_rot_z_deg": azimuth,
        "rotation_error_deg": math.hypot(tilt, azimuth),
        "axis_error_deg": math.degrees(2.0 * math.asin(chord / 2.0 if not chord > 2.0 else 1.0)),
    }


def _length(x: float, y: float, z: float) -> float:
    """Of a vector, in scalars: a campaign has a million rows."""
    return math.sqrt(x * x + y * y + z * z)


@dataclass(frozen=True)
class Stated:
    """Which columns the estimators' own statements need: the same in every row of a run."""

    sigmas: int = 0  #: the largest covariance, 0 if there is none
    roll: bool = False
    bound: bool = False
    distance: bool = False

    @classmethod
    def among(cls, findings: Iterable[Finding]) -> Stated:
        """The columns that these findings fill."""
        sigmas, roll, bound, distance = 0, False, False, False
        for found in findings:
            sigmas = max(sigmas, len(found.covariance or ()))
            roll, bound = roll or found.roll is not None, bound or found.bound is not None
            distance = distance or found.distance is not None
        return cls(sigmas, roll, bound, distance)

    @classmethod
    def by(cls, several: Iterable[Stated]) -> Stated:
        """The columns that any of them fills."""
        kinds = set(several)
        return cls(
            max((k.sigmas for k in kinds), default=0),
            any(k.roll for k in kinds),
            any(k.bound for k in kinds),
            any(k.distance for k in kinds),
        )

    def row(self, true: Pose, found: Finding | None, visible: float | None, wall: Ways | None = None) -> Row:
        """Standard deviations and how well they hold, roll and bound; NaN where there is none.

        `est_chi2_tip` is the tip's error in units of its own covariance: chi-squared of three degrees if that is
        right. `visible` is the share of the patches' true outline that the frame shows, `wall` the true distances.
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
            row = {"true_in_frame": _NAN if visible is None else visible}
            row |= dict(zip(TIP_SIGMA, spread, strict=False))
            row |= {"est_chi2_tip": chi2, "est_sigma_axis_deg": math.degrees(math.hypot(spread[3], spread[4]))}
            row |= {"est_sigma_roll_deg": math.degrees(spread[5])} if self.sigmas > 5 else {}
        if self.roll:
            off = None if found is None or found.roll is None else math.remainder(found.roll - true.roll, 2.0 * math.pi)
            row["est_roll_error_deg"] = _NAN if off is None else math.degrees(off)
        if self.distance:
            nearest, along = (found and found.distance) or (_NAN, _NAN)
            sigmas = (found and found.distance_sigma) or (_NAN, _NAN)
            row["est_source_mm"] = _NAN if found is None or found.distance is None else found.distance_source
            true_nearest, true_along = wall or (_NAN, _NAN)
            for name, pair in {
                "true_{}_mm": (true_nearest, true_along),
                "est_{}_mm": (nearest, along),
                "est_sigma_{}_mm": sigmas,
                "est_error_{}_mm": (nearest - true_nearest, along - true_along),
            }.items():
                row |= {name.format(way): value for way, value in zip(DISTANCE, pair, strict=True)}
        if self.bound:
            row["est_bound_mm"] = _NAN if found is None or found.bound is None else found.bound
        return row


def wall_distances(pose: Pose, scene: Scene) -> Ways:
    """The true distances of a pose's tip from a scene's wall [mm]: from its nearest point, and along the axis."""
    along, nearest = Wall.about(scene, pose.apex, pose.axis).distances
    return float(nearest), float(along)


def in_frame(pose: Pose, scene: Scene) -> float:
    """The share of the patches' outline at a pose that a scene's frame shows."""
    edge = np.concatenate([scene.outline(pose, k, points=64) for k in range(len(scene.spotlights))])
    pixels = scene.camera.project(edge)  # NaN where a ray misses the eye compares as outside
    return float(np.mean(scene.camera.shows(pixels)))
