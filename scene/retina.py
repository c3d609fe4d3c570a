"""What the retina reflects."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from scene.model import Model

_Albedo = Annotated[float, Field(gt=0.0, le=1.0)]


class UniformRetina(Model):
    """Lambertian, the same grey everywhere."""

    kind: Literal["uniform"] = "uniform"
    albedo: _Albedo = 0.1


class PhotoRetina(Model):
    """Lambertian grey albedo with the pattern of a fundus photograph.

    `mean` is the mean albedo; `contrast` bounds the albedo to that many times the mean, from below and above. The
    defaults are measured on the authors' released frame without spotlight: linear mean luminance of their texture
    0.083, grey values 25 to 45 around 37 (1 to 99 %), so no optic disc above the fixed threshold of 50.
    """

    kind: Literal["photo"] = "photo"
    mean: _Albedo = 0.083
    contrast: tuple[Annotated[float, Field(gt=0.0, le=1.0)], Annotated[float, Field(ge=1.0)]] = (0.52, 1.42)

    @model_validator(mode="after")
    def _physical(self) -> PhotoRetina:
        if self.mean * self.contrast[1] > 1.0:
            raise ValueError(f"mean {self.mean} times contrast {self.contrast[1]} is an albedo above 1")
        return self


Retina = Annotated[UniformRetina | PhotoRetina, Field(discriminator="kind")]
