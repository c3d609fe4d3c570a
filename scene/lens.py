"""The camera's lens: what it does not have in focus, does not resolve, and scatters over the frame."""

from __future__ import annotations

import math
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, model_validator

from conespot.scene.model import Model, Words
from conespot.scene.point_spread import PointSpread
from conespot.scene.quantity import Length, Share, format_quantity


class Lens(Model):
    """Depth of field, residual blur and veiling glare, each off by default.

    The entrance pupil is a disc around the camera's pinhole, across its axis: give its diameter, or the numerical
    aperture that it has seen from the working distance, which is the camera's `height`. In focus is the plane across
    the camera's axis, as it is in the air, in which the point `focus` above the posterior pole lies: through the
    eye's optics, its image.

    >>> round(Lens(numerical_aperture=0.05).pupil(180.0), 3)
    18.023
    """

    aperture: Length = Field(0.0, ge=0.0)  #: diameter of the entrance pupil [mm]; 0 is the pinhole
    numerical_aperture: float = Field(0.0, ge=0.0, lt=1.0)  #: sine of the half angle; in place of `aperture`
    focus: Length = 0.0  #: height above the posterior pole of what is sharp [mm]
    blur: PointSpread = None  #: what is left of a point in focus, beside diffraction none
    glare: Share = Field(0.0, ge=0.0, lt=1.0)  #: share of the light in the frame that is spread evenly over it

    @model_validator(mode="after")
    def _one_aperture(self) -> Lens:
        if self.aperture > 0.0 and self.numerical_aperture > 0.0:
            raise ValueError("aperture and numerical_aperture say the same; give only one of the two")
        return self

    def pupil(self, distance: float) -> float:
        """Diameter of the entrance pupil for a working distance [mm]."""
        return self.aperture or 2.0 * distance * math.tan(math.asin(self.numerical_aperture))

    def words(self, distance: float) -> str:
        """The lens in words, as tables state it, for a working distance [mm].

        >>> Lens(aperture=10.0, glare=0.02).words(110.0)
        'aperture 10 mm, focus 0 mm, glare 2 %'
        """
        parts = []
        if self.pupil(distance) > 0.0:
            parts += [f"aperture {self.pupil(distance):.4g} mm", f"focus {format_quantity(self.focus, 'length')}"]
        if self.blur is not None:
            parts.append(self.blur.words)
        if self.glare > 0.0:
            parts.append(f"glare {100.0 * self.glare:.4g} %")
        return ", ".join(parts) or "ideal lens"


def _none(value: Any) -> Any:
    return None if value == "none" else value


#: what the key of a file holds: `none`, or the lens
AnyLens = Annotated[Lens | None, BeforeValidator(_none), Words(lambda: ["none"])]
