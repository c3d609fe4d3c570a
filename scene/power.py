"""Watts, which always say their convention."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, assert_never

from pydantic import Field

from conespot.scene.beam import BeamProfile
from conespot.scene.model import Model
from conespot.scene.quantity import Watts


@dataclass(frozen=True)
class BothConventions:
    """A spotlight's power as Blender's watts and as those that leave the tip, and the radiant intensity they mean."""

    isotropic_w: float
    flux_w: float
    axial_intensity: float  #: on the axis [W/sr]

    @property
    def words(self) -> str:
        """Both, such as "1 W isotropic (3.08 mW flux)"."""
        return f"{self.isotropic_w:.4g} W isotropic ({1e3 * self.flux_w:.3g} mW flux)"


class Power(Model):
    """Power of one spotlight [W].

    `isotropic` is Blender's: the on-axis radiant intensity is P / 4 pi whatever the cone, so the flux that leaves
    the tip is far below P. `flux` is the radiant flux that leaves the tip.

    >>> from conespot.scene.beam import CyclesBeam, HardBeam
    >>> round(Power(value=1.0).axial_intensity(CyclesBeam()), 6) == round(1.0 / (4.0 * math.pi), 6)
    True
    >>> round(1e3 * Power(value=1.0).flux(CyclesBeam()), 3)  # of 1 W only so many mW leave the tip
    3.078
    >>> Power(value=2.0, convention="flux").flux(HardBeam())
    2.0
    """

    value: Watts = Field(1.0, ge=0.0)
    convention: Literal["isotropic", "flux"] = "isotropic"

    def axial_intensity(self, beam: BeamProfile) -> float:
        """On-axis radiant intensity I0 [W/sr]."""
        solid_angle = 4.0 * math.pi if self.convention == "isotropic" else beam.flux_factor
        return float(self.value / solid_angle)

    def flux(self, beam: BeamProfile) -> float:
        """Radiant flux that leaves the tip in the cone [W]."""
        return self.axial_intensity(beam) * beam.flux_factor

    def both(self, beam: BeamProfile) -> BothConventions:
        """The power in both conventions."""
        intensity = self.axial_intensity(beam)
        return BothConventions(4.0 * math.pi * intensity, intensity * beam.flux_factor, intensity)

    @property
    def words(self) -> str:
        """The convention in words, as tables state it."""
        match self.convention:
            case "isotropic":
                return "isotropic (I0 = P / 4 pi)"
            case "flux":
                return "flux (P leaves the tip)"
            case never:
                assert_never(never)
