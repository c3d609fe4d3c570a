"""The image sensor: how radiance becomes pixel values. The exposure itself is `render.exposure`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from scene.emva import EMVA_PRESETS, Emva
from scene.model import Model, named
from scene.quantity import Radiance

_White = Annotated[Radiance, Field(gt=0.0)]


class Srgb8(Model):
    """Eight bits with the sRGB transfer; radiance `white` and above is 255 (Blender's display frame)."""

    kind: Literal["srgb8"] = "srgb8"
    white: _White = 1.0

    @property
    def full_scale(self) -> int:
        """Largest pixel value."""
        return 255


class Linear(Model):
    """Pixel values proportional to radiance; `white` and above is the largest of `bits` bits."""

    kind: Literal["linear"] = "linear"
    white: _White = 1.0
    bits: int = Field(12, ge=1, le=16)

    @property
    def full_scale(self) -> int:
        """Largest pixel value."""
        return int(2**self.bits - 1)


AnySensor = Srgb8 | Linear | Emva
SENSORS: dict[str, AnySensor] = {"srgb8": Srgb8(), "linear": Linear(), **EMVA_PRESETS}


def sensor_name(sensor: AnySensor) -> str:
    """The name of a preset, or the kind (for a camera its chip) of a sensor of one's own."""
    alike = (name for name, known in SENSORS.items() if known == sensor)
    return next(alike, sensor.chip if isinstance(sensor, Emva) else sensor.kind)


Sensor = Annotated[Annotated[AnySensor, Field(discriminator="kind")], named(SENSORS, "sensor")]
