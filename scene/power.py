"""Watts, which always say their convention."""

from __future__ import annotations

import math
from typing import Literal

from pydantic import Field

from conespot.scene.beam import Beam
from conespot.scene.model import Model
from conespot.scene.quantity import Watts


class Power(Model):
    """Power of one spotlight [W].

    `isotropic` is Blender's: the on-axis radiant intensity is P / 4 pi whatever the cone, so the flux that leaves
    the tip is far below P. `flux` is the radiant flux that leaves the tip.
    """

    value: Watts = Field(1.0, ge=0.0)
    convention: Literal["isotropic", "flux"] = "isotropic"

    def axial_intensity(self, beam: Beam) -> float:
        """On-axis radiant intensity I0 [W/sr]."""
        solid_angle = 4.0 * math.pi if self.convention == "isotropic" else beam.flux_factor
        return float(self.value / solid_angle)

    def flux(self, beam: Beam) -> float:
        """Radiant flux that leaves the tip in the cone [W]."""
        return self.axial_intensity(beam) * beam.flux_factor
