"""Beam profiles: how radiant intensity falls from the axis to the edge of a spotlight's cone.

A profile g is relative, 1 on the axis and 0 outside the cone. `flux_factor` is its integral over solid angle
[sr], so a radiant flux Phi makes the on-axis intensity Phi / flux_factor [W/sr].
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from conespot.scene.model import Model
from conespot.scene.quantity import Angle, Length, format_quantity

Array = NDArray[np.float64]
_HalfAngle = Annotated[Angle, Field(gt=0.0, lt=math.pi / 2.0)]


class BeamProfile(Protocol):
    """What every kind of beam says of itself; how Mitsuba and the forward model make it, they know for each."""

    @property
    def half_angle(self) -> float:
        """Angle off the axis beyond which there is no light [rad]."""

    @property
    def source_diameter(self) -> float:
        """Diameter of the core that the light leaves [mm]; 0 for a point."""

    @property
    def flux_factor(self) -> float:
        """Integral of the profile over solid angle [sr]."""

    @property
    def softness(self) -> float | None:
        """Part of the cone over which the light falls; None for a profile without a ramp that could be fitted."""

    @property
    def words(self) -> str:
        """The profile in words, as tables state it."""

    def intensity(self, cos_angle: ArrayLike) -> Array:
        """Relative radiant intensity at cosines of the angle off the axis, any shape."""

    def stretched(self, half_angle: float) -> BeamProfile:
        """The same profile over another half angle [rad]."""


class _Cored(Model):
    """Light leaves a disc across the cone's axis at the tip, a fibre's core, evenly, from each point with the profile.

    The flux is that of a point, and so is all that is said of the profile alone.
    """

    source_diameter: Annotated[Length, Field(ge=0.0, le=1.0)] = 0.0  #: 0 for a point [mm]

    @model_serializer(mode="wrap")
    def _point_unsaid(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """A point source is not written, so that a swept beam is called as it was before there were cores."""
        data: dict[str, Any] = dump(self)
        if not self.source_diameter:
            data.pop("source_diameter", None)
        return data

    @property
    def _core(self) -> str:
        """The core in words, after those of the profile."""
        return f", core {format_quantity(self.source_diameter, 'length')}" if self.source_diameter else ""


class HardBeam(_Cored):
    """Uniform radiant intensity up to the half angle."""

    kind: Literal["hard"] = "hard"
    half_angle: _HalfAngle = math.radians(9.0)

    def intensity(self, cos_angle: ArrayLike) -> Array:
        """Relative radiant intensity at cosines of the angle off the axis, any shape."""
        return np.where(np.asarray(cos_angle, float) >= math.cos(self.half_angle), 1.0, 0.0)

    @property
    def words(self) -> str:
        """The profile in words, as tables state it."""
        return f"hard, half angle {format_quantity(self.half_angle, 'angle')}{self._core}"

    @property
    def softness(self) -> None:
        """No ramp whose width could be fitted."""
        return None

    def stretched(self, half_angle: float) -> HardBeam:
        """The same profile over another half angle [rad]: every angle in proportion."""
        return self.model_copy(update={"half_angle": half_angle})

    @property
    def flux_factor(self) -> float:
        """2 pi (1 - cos b) [sr].

        >>> round(HardBeam(half_angle=math.radians(9.0)).flux_factor, 6)
        0.077356
        """
        return 2.0 * math.pi * (1.0 - math.cos(self.half_angle))


class CyclesBeam(_Cored):
    """Blender Cycles' spotlight: smoothstep((cos t - cos b) / (blend (1 - cos b))); blend 1 is fully soft."""

    kind: Literal["cycles"] = "cycles"
    half_angle: _HalfAngle = math.radians(9.0)
    blend: float = Field(1.0, gt=0.0, le=1.0)

    def intensity(self, cos_angle: ArrayLike) -> Array:
        """Relative radiant intensity at cosines of the angle off the axis, any shape.

        >>> b = math.radians(9.0)
        >>> CyclesBeam(half_angle=b).intensity([1.0, (1.0 + math.cos(b)) / 2.0, math.cos(b)]).round(9).tolist()
        [1.0, 0.5, 0.0]
        """
        cos_b = math.cos(self.half_angle)
        u = np.clip((np.asarray(cos_angle, float) - cos_b) / (self.blend * (1.0 - cos_b)), 0.0, 1.0)
        return u * u * (3.0 - 2.0 * u)

    @property
    def words(self) -> str:
        """The profile in words, as tables state it."""
        soft = " (fully soft)" if self.blend == 1.0 else ""
        return f"Cycles blend {self.blend:g}{soft}, half angle {format_quantity(self.half_angle, 'angle')}{self._core}"

    @property
    def softness(self) -> float:
        """Part of the cone over which the light falls, the blend."""
        return self.blend

    def stretched(self, half_angle: float) -> CyclesBeam:
        """The same profile over another half angle [rad]: cosines off the edge in proportion."""
        return self.model_copy(update={"half_angle": half_angle})

    @property
    def flux_factor(self) -> float:
        """2 pi (1 - cos b) (1 - blend / 2) [sr]: the smoothstep's mean over its ramp is one half.

        >>> CyclesBeam().flux_factor == HardBeam().flux_factor / 2.0
        True
        """
        return 2.0 * math.pi * (1.0 - math.cos(self.half_angle)) * (1.0 - self.blend / 2.0)


class LinearBeam(_Cored):
    """Mitsuba's `spot`: full intensity up to `beam_width`, then linear in the angle down to 0 at the half angle."""

    kind: Literal["linear"] = "linear"
    half_angle: _HalfAngle = math.radians(9.0)
    beam_width: Annotated[Angle, Field(ge=0.0)] = math.radians(6.75)

    @model_validator(mode="after")
    def _narrower(self) -> LinearBeam:
        if self.beam_width >= self.half_angle:
            raise ValueError("beam_width must be smaller than half_angle")
        return self

    def intensity(self, cos_angle: ArrayLike) -> Array:
        """Relative radiant intensity at cosines of the angle off the axis, any shape.

        >>> LinearBeam(half_angle=0.2, beam_width=0.1).intensity(np.cos([0.05, 0.15, 0.25])).round(9).tolist()
        [1.0, 0.5, 0.0]
        """
        angle = np.arccos(np.clip(np.asarray(cos_angle, float), -1.0, 1.0))
        return np.clip((self.half_angle - angle) / (self.half_angle - self.beam_width), 0.0, 1.0)

    @property
    def words(self) -> str:
        """The profile in words, as tables state it."""
        width, half_angle = (format_quantity(angle, "angle") for angle in (self.beam_width, self.half_angle))
        return f"linear from {width}, half angle {half_angle}{self._core}"

    @property
    def softness(self) -> None:
        """No ramp whose width could be fitted."""
        return None

    def stretched(self, half_angle: float) -> LinearBeam:
        """The same profile over another half angle [rad]: every angle in proportion."""
        width = self.beam_width * half_angle / self.half_angle
        return self.model_copy(update={"half_angle": half_angle, "beam_width": width})

    @property
    def flux_factor(self) -> float:
        """2 pi [1 - cos w + integral over the ramp] = 2 pi [1 - (sin b - sin w) / (b - w)] [sr]."""
        b, w = self.half_angle, self.beam_width
        return 2.0 * math.pi * (1.0 - (math.sin(b) - math.sin(w)) / (b - w))


class TabulatedBeam(_Cored):
    """Measured profile: relative `intensities` at `angles`, linear in the angle between them, 0 beyond the last."""

    kind: Literal["table"] = "table"
    angles: tuple[Angle, ...] = Field(min_length=2, max_length=4096)
    intensities: tuple[Annotated[float, Field(ge=0.0, le=1.0)], ...] = Field(min_length=2, max_length=4096)

    @model_validator(mode="after")
    def _a_profile(self) -> TabulatedBeam:
        if len(self.angles) != len(self.intensities):
            raise ValueError("angles and intensities must have the same length")
        if self.angles[0] != 0.0 or self.intensities[0] != 1.0:
            raise ValueError("the table must begin on the axis: angle 0 with intensity 1")
        if np.any(np.diff(self.angles) <= 0.0):
            raise ValueError("angles must increase")
        if not self.angles[-1] < math.pi / 2.0:
            raise ValueError("the last angle must be below 90 deg")
        return self

    @property
    def half_angle(self) -> float:
        """The last tabulated angle [rad]."""
        return float(self.angles[-1])

    def intensity(self, cos_angle: ArrayLike) -> Array:
        """Relative radiant intensity at cosines of the angle off the axis, any shape."""
        angle = np.arccos(np.clip(np.asarray(cos_angle, float), -1.0, 1.0))
        return np.interp(angle, self.angles, self.intensities, right=0.0)

    @property
    def words(self) -> str:
        """The profile in words, as tables state it."""
        return f"tabulated, half angle {format_quantity(self.half_angle, 'angle')}{self._core}"

    @property
    def softness(self) -> None:
        """No ramp whose width could be fitted."""
        return None

    def stretched(self, half_angle: float) -> TabulatedBeam:
        """The same profile over another half angle [rad]: every angle in proportion."""
        return self.model_copy(update={"angles": tuple(a * half_angle / self.half_angle for a in self.angles)})

    @property
    def flux_factor(self) -> float:
        """2 pi sum of the exact integrals of (linear in t) sin t over the table's intervals [sr]."""
        t, g = np.asarray(self.angles), np.asarray(self.intensities)
        slope = np.diff(g) / np.diff(t)
        # integral of (a + s t) sin t = -(a + s t) cos t + s sin t
        ends = [-g[i] * np.cos(t[i]) + slope * np.sin(t[i]) for i in (slice(None, -1), slice(1, None))]
        return float(2.0 * math.pi * np.sum(ends[1] - ends[0]))


Beam = Annotated[HardBeam | CyclesBeam | LinearBeam | TabulatedBeam, Field(discriminator="kind")]
