"""The image sensor: how radiance becomes pixel values. The exposure itself is `render.exposure`."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from typing import Annotated, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from conespot.scene import jpeg, srgb
from conespot.scene.emva import EMVA_PRESETS, Emva, Metering
from conespot.scene.model import Model, named
from conespot.scene.noise import SensorNoise
from conespot.scene.quantity import Radiance, format_quantity
from conespot.scene.spectrum import Curve

Array = NDArray[np.float64]
_White = Annotated[Radiance, Field(gt=0.0)]


class ImageSensor(Hashable, Protocol):
    """What every kind of sensor says of itself; how it is exposed, `render.exposure` knows for each.

    A share of 1 is the largest pixel value, a signal of 1 is white: the light that just shows as that.
    """

    @property
    def camera(self) -> SingleFrame:
        """What exposes the frames: itself, or what a recorder records."""

    @property
    def full_scale(self) -> int:
        """Largest pixel value."""

    @property
    def black_level(self) -> float:
        """Pixel value without any light."""

    @property
    def clips_from(self) -> float:
        """Share from which on a pixel is only a lower bound of its light."""

    @property
    def noise(self) -> SensorNoise:
        """How noisy a pixel is."""

    @property
    def responses(self) -> dict[str, Curve] | None:
        """Response of each channel over wavelength; None for one channel that weighs all light alike."""

    @property
    def metering(self) -> Metering | None:
        """How the exposure time is found from the light, where it is."""

    @property
    def exposure_time(self) -> float | None:
        """How long a frame takes [s]; None for a sensor of radiances, which does not say."""

    @property
    def words(self) -> str:
        """How radiance becomes values, in words as tables state it."""

    def decode(self, share: Array) -> Array:
        """Signals [white] of shares, any shape."""


#: thirds of the visible range as a renderer of three colours takes them: a flat band shows equally in all
_THIRDS = {"red": (600.0, 700.0), "green": (500.0, 600.0), "blue": (400.0, 500.0)}


class Srgb8(Model):
    """Eight bits with the sRGB transfer; radiance `white` and above is 255 (Blender's display frame).

    One grey channel; with `colour` red, green and blue, each the radiance of a third of 400 to 700 nm times three, so
    that a grey retina in flat white light shows the same in all of them.
    """

    kind: Literal["srgb8"] = "srgb8"
    white: _White = 1.0
    colour: bool = Field(False, strict=True)

    @property
    def camera(self) -> Srgb8:
        """Itself: nothing records it."""
        return self

    @property
    def full_scale(self) -> int:
        """Largest pixel value."""
        return 255

    @property
    def words(self) -> str:
        """How radiance becomes values, in words as tables state it."""
        channels = ", colour" if self.colour else ""
        return f"sRGB, 8 bit, white {format_quantity(self.white, 'radiance')}{channels}"

    @property
    def responses(self) -> dict[str, Curve] | None:
        """Relative response of each channel; None for the grey one, which weighs all light alike."""
        if not self.colour:
            return None
        return {name: Curve(np.array(band), np.full(2, 3.0)) for name, band in _THIRDS.items()}

    @property
    def black_level(self) -> float:
        """Pixel value without any light."""
        return 0.0

    @property
    def clips_from(self) -> float:
        """Share from which on a pixel is only a lower bound of its light."""
        return 1.0

    @property
    def noise(self) -> SensorNoise:
        """Quantization alone: the exposure is noiseless."""
        return SensorNoise(levels=self.full_scale, srgb=True)

    @property
    def metering(self) -> None:
        """No exposure time, so nothing to meter."""
        return None

    @property
    def exposure_time(self) -> None:
        """None: radiances alone count."""
        return None

    def decode(self, share: Array) -> Array:
        """Signals [white] of shares of the largest value, any shape.

        >>> Srgb8().decode(np.array([0.0, 0.5, 1.0])).round(4).tolist()
        [0.0, 0.214, 1.0]
        """
        return srgb.decoded(share)


class Linear(Model):
    """Pixel values proportional to radiance; `white` and above is the largest of `bits` bits."""

    kind: Literal["linear"] = "linear"
    white: _White = 1.0
    bits: int = Field(12, ge=1, le=16)

    @property
    def camera(self) -> Linear:
        """Itself: nothing records it."""
        return self

    @property
    def full_scale(self) -> int:
        """Largest pixel value."""
        return int(2**self.bits - 1)

    @property
    def words(self) -> str:
        """How radiance becomes values, in words as tables state it."""
        return f"linear, {self.bits} bit, white {format_quantity(self.white, 'radiance')}"

    @property
    def responses(self) -> None:
        """One channel that weighs all light alike."""
        return None

    @property
    def black_level(self) -> float:
        """Pixel value without any light."""
        return 0.0

    @property
    def clips_from(self) -> float:
        """Share from which on a pixel is only a lower bound of its light."""
        return 1.0

    @property
    def noise(self) -> SensorNoise:
        """Quantization alone: the exposure is noiseless."""
        return SensorNoise(levels=self.full_scale)

    @property
    def metering(self) -> None:
        """No exposure time, so nothing to meter."""
        return None

    @property
    def exposure_time(self) -> None:
        """None: radiances alone count."""
        return None

    def decode(self, share: Array) -> Array:
        """Signals [white] of shares of the largest value, any shape: the same."""
        return share


SingleFrame = Srgb8 | Linear | Emva
SENSORS: dict[str, SingleFrame] = {
    "srgb8": Srgb8(),
    "srgb8-colour": Srgb8(colour=True),
    "linear": Linear(),
    **EMVA_PRESETS,
}
#: levels that compression may move a clipped value down
_RINGING = 2.0


class Recorded(Model):
    """A camera whose frames went through a video recorder: eight bits, and JPEG of a `quality`.

    Values of a linear camera get the sRGB transfer first. In `limited` range black is 16 and white 235, and a frame
    shows these codes as they are. `chroma` says whether colours keep their resolution (4:4:4) or half of it (4:2:0).
    """

    kind: Literal["recorded"] = "recorded"
    camera: Annotated[Annotated[SingleFrame, Field(discriminator="kind")], named(SENSORS, "sensor")]
    quality: int = Field(90, ge=1, le=100)  #: libjpeg's
    chroma: Literal["4:2:0", "4:4:4"] = "4:2:0"
    range: Literal["full", "limited"] = "full"

    @property
    def full_scale(self) -> int:
        """Largest pixel value that a file can hold."""
        return 255

    @property
    def black_code(self) -> int:
        """Code of the camera's value 0."""
        return 16 if self.range == "limited" else 0

    @property
    def codes(self) -> int:
        """Codes from the camera's value 0 to its largest."""
        return 219 if self.range == "limited" else 255

    def code(self, share: Array) -> Array:
        """Codes, not rounded, of shares of the camera's largest value, any shape."""
        light = share if isinstance(self.camera, Srgb8) else srgb.encoded(np.asarray(share, float))
        return np.asarray(self.black_code + self.codes * light)

    @property
    def black_level(self) -> float:
        """Pixel value without any light."""
        return float(self.code(np.array(self.camera.black_level / self.camera.full_scale)))

    @property
    def clips_from(self) -> float:
        """Share from which on a pixel is only a lower bound of its light: compression may have darkened it a little."""
        return (float(self.code(np.array(self.camera.clips_from))) - _RINGING) / self.full_scale

    @property
    def noise(self) -> SensorNoise:
        """The camera's, the codes' and what the compression rounds where an image is busy."""
        return replace(self.camera.noise, levels=self.codes, srgb=True, compression=jpeg.rounding_error(self.quality))

    @property
    def responses(self) -> dict[str, Curve] | None:
        """The camera's."""
        return self.camera.responses

    @property
    def metering(self) -> Metering | None:
        """The camera's."""
        return self.camera.metering

    @property
    def exposure_time(self) -> float | None:
        """The camera's [s]."""
        return self.camera.exposure_time

    @property
    def words(self) -> str:
        """How radiance becomes values, in words as tables state it."""
        chroma = f" {self.chroma}" if self.responses and len(self.responses) > 1 else ""
        return f"{self.camera.words}, recorded as JPEG {self.quality}{chroma}, {self.range} range"

    def decode(self, share: Array) -> Array:
        """Signals [white] of shares of the largest code, any shape.

        >>> Recorded(camera=Linear(), range="limited").decode(np.array([16.0, 235.0]) / 255.0).round(12).tolist()
        [0.0, 1.0]
        """
        value = (share * self.full_scale - self.black_code) / self.codes
        return self.camera.decode(value if isinstance(self.camera, Srgb8) else srgb.decoded(value))


AnySensor = SingleFrame | Recorded


def sensor_name(sensor: AnySensor) -> str:
    """The name of a preset, or the kind (a camera's chip) of a sensor of one's own; for a recorder its camera's."""
    if isinstance(sensor, Recorded):
        return f"{sensor_name(sensor.camera)}, JPEG {sensor.quality}"
    alike = (name for name, known in SENSORS.items() if known == sensor)
    return next(alike, sensor.chip if sensor.kind == "emva" else sensor.kind)


Sensor = Annotated[Annotated[AnySensor, Field(discriminator="kind")], named(SENSORS, "sensor")]
