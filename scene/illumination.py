"""Light: the spotlights' spectrum, and the ambient light of the microscope."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from scene.model import Model
from scene.quantity import Angle, Irradiance, Wavelength

_Visible = Annotated[Wavelength, Field(ge=300.0, le=1100.0)]


class FlatBand(Model):
    """Constant spectral power between two wavelengths, nothing outside; it integrates to the stated watts."""

    kind: Literal["flat"] = "flat"
    name: str = Field("white", pattern=r"^[\w .+-]{1,40}$")
    low: _Visible = 400.0
    high: _Visible = 700.0

    @model_validator(mode="after")
    def _ordered(self) -> FlatBand:
        if self.high <= self.low:
            raise ValueError("high must be above low")
        return self


class Ambient(Model):
    """The microscope's own light: collimated, from above, `tilt` off the camera's axis towards `azimuth`.

    `irradiance` is on a plane across the beam, so a Lambertian retina of albedo a shows the radiance
    a / pi * irradiance * cos(incidence).
    """

    irradiance: Irradiance = Field(0.23 * math.pi, ge=0.0)
    tilt: Annotated[Angle, Field(ge=0.0, lt=math.pi / 4.0)] = 0.0
    azimuth: Angle = 0.0
    illumination: FlatBand = FlatBand()
