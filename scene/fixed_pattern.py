"""What differs from pixel to pixel of a sensor and stays from frame to frame (EMVA Standard 1288, release 4)."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from conespot.scene.model import Model
from conespot.scene.quantity import Share

_Few = Annotated[Share, Field(ge=0.0, le=0.1)]
_Deviation = Annotated[float, Field(ge=0.0, le=1e6)]


class Nonuniformity(Model):
    """Standard deviations over a sensor's rows, columns and single pixels, which add up in the square."""

    pixel: _Deviation = 0.0
    row: _Deviation = 0.0
    column: _Deviation = 0.0

    @property
    def total(self) -> float:
        """Standard deviation over all pixels.

        >>> Nonuniformity(pixel=2.0, row=1.0, column=2.0).total
        3.0
        """
        return math.sqrt(self.pixel**2 + self.row**2 + self.column**2)


class FixedPattern(Model):
    """A sensor's unevenness: drawn from its `serial`, and so the same in all frames of all runs.

    Electrons of a pixel = (1 + PRNU) times those of its light, plus dark current, plus DSNU. Hot pixels have so much
    dark current more, dead ones see no light. A sensor of another serial has another pattern of the same size.
    """

    serial: int = Field(1, ge=0, lt=2**63)
    dsnu: Nonuniformity = Nonuniformity()  #: dark signal nonuniformity [e-]
    prnu: Nonuniformity = Nonuniformity()  #: photo response nonuniformity, relative
    hot: _Few = 0.0  #: share of pixels that are hot
    hot_current: float = Field(1e5, ge=0.0, le=1e9)  #: their dark current on top of the sensor's [e-/s]
    dead: _Few = 0.0  #: share of pixels that are dead

    @model_validator(mode="after")
    def _relative(self) -> FixedPattern:
        if self.prnu.total > 0.5:
            raise ValueError(
                f"prnu is relative to the response: 0.01 is 1 %, 0.5 the most, got {self.prnu.total:g} in all"
            )
        return self
