"""A machine-vision camera as EMVA 1288 describes a linear one, with the optical filters in front of it."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from conespot.scene.fixed_pattern import FixedPattern
from conespot.scene.model import Model
from conespot.scene.noise import SensorNoise
from conespot.scene.quantity import Length, Seconds, Wavelength, format_quantity
from conespot.scene.spectrum import Curve, tabulated

#: elementary charge [C], and h c / e [V nm]: a quantum efficiency times wavelength over it is a responsivity [A/W]
ELEMENTARY_CHARGE = 1.602176634e-19
_VOLT_NM = 1239.841984
_Edge = Annotated[Wavelength, Field(ge=300.0, le=1100.0)]
#: share of the range of signals from which on a pixel counts as clipped. The noise of a pixel near the full well is cut
#: off on one side: at 11,250 e- this is two sigmas of shot noise below it
_NEAR_FULL = 0.98
_Fraction = Annotated[float, Field(gt=0.0, le=1.0)]


class LongPass(Model):
    """Passes wavelengths from `edge` on, and nothing below."""

    kind: Literal["longpass"] = "longpass"
    edge: _Edge = 800.0
    transmission: _Fraction = 1.0

    @property
    def words(self) -> str:
        """The filter in words."""
        return f"long pass {format_quantity(self.edge, 'wavelength')}"

    def of(self, curve: Curve) -> Curve:
        """What the filter leaves of a curve."""
        return Curve(curve.wavelengths, curve.values * self.transmission).cut(self.edge, 1200.0)


class BandPass(Model):
    """Passes wavelengths from `low` to `high`, and nothing outside."""

    kind: Literal["bandpass"] = "bandpass"
    low: _Edge = 830.0
    high: _Edge = 870.0
    transmission: _Fraction = 1.0

    @model_validator(mode="after")
    def _ordered(self) -> BandPass:
        if self.high <= self.low:
            raise ValueError("high must be above low")
        return self

    @property
    def words(self) -> str:
        """The filter in words."""
        return f"band pass {self.low:g} to {format_quantity(self.high, 'wavelength')}"

    def of(self, curve: Curve) -> Curve:
        """What the filter leaves of a curve."""
        return Curve(curve.wavelengths, curve.values * self.transmission).cut(self.low, self.high)


Filter = Annotated[LongPass | BandPass, Field(discriminator="kind")]


class Metering(Model):
    """Exposure time from the light: `percentile` of the pixels that the spotlights reach gets `level` of saturation.

    Set once for a campaign, from its brightest power, and kept; or anew for each `frame`.
    """

    percentile: float = Field(99.5, gt=0.0, le=100.0)
    level: _Fraction = 0.8
    each: Literal["campaign", "frame"] = "campaign"

    @property
    def words(self) -> str:
        """The rule in words."""
        when = "once" if self.each == "campaign" else "every frame"
        return f"metered {when} to {100.0 * self.level:g} % of saturation"


#: columns of camera_qe_cmv12000.csv (averaged) of each channel of each chip
CHIPS: dict[str, dict[str, tuple[str, ...]]] = {
    "cmv12000-mono": {"mono": ("qe_mono",)},
    "cmv12000-nir": {"mono": ("qe_nir",)},
    "cmv12000-rgb": {"red": ("qe_red",), "green": ("qe_green_r", "qe_green_b"), "blue": ("qe_blue",)},
}


class Emva(Model):
    """Linear sensor of EMVA Standard 1288, release 4: photons to electrons to digital numbers, with their noise.

    Electrons = response of the chip to the image's irradiance pi L T / (4 N^2) over the pixel's area and the exposure
    time, plus dark current; clipped at `full_well`; value = `gain` times electrons plus `black_level`, rounded and
    clipped at 2^bits - 1. Variance of the value = gain^2 (read_noise^2 + electrons) + 1/12. The defaults are the data
    sheet's of the ams CMV12000 (DS000603), with a gain that lets the full well clip before the converter does.
    """

    kind: Literal["emva"] = "emva"
    chip: Literal["cmv12000-mono", "cmv12000-nir", "cmv12000-rgb"] = "cmv12000-mono"
    exposure_time: Annotated[Seconds, Field(gt=0.0, le=10.0)] = 10e-3
    metering: Metering | None = None
    f_number: float = Field(4.0, ge=0.5, le=64.0)  #: working f-number, on the image's side
    lens_transmission: _Fraction = 0.8
    pixel_pitch: Annotated[Length, Field(gt=0.0, le=0.1)] = 5.5e-3
    read_noise: float = Field(13.0, ge=0.0, le=1e4)  #: temporal noise in the dark [e-]
    dark_current: float = Field(70.0, ge=0.0, le=1e6)  #: [e-/s]
    full_well: float = Field(13500.0, gt=0.0, le=1e7)  #: [e-]
    bits: int = Field(12, ge=8, le=16)
    gain: float = Field(0.3, gt=0.0, le=1e3)  #: K [DN/e-]
    black_level: float = Field(32.0, ge=0.0)  #: [DN]
    filters: tuple[Filter, ...] = Field((), max_length=8)
    fixed_pattern: FixedPattern | None = None

    @model_validator(mode="after")
    def _room_for_signal(self) -> Emva:
        if self.black_level >= self.full_scale:
            raise ValueError(f"black_level {self.black_level:g} leaves no room below {self.full_scale}")
        return self

    @property
    def camera(self) -> Emva:
        """Itself: nothing records it."""
        return self

    @property
    def full_scale(self) -> int:
        """Largest pixel value."""
        return int(2**self.bits - 1)

    @property
    def words(self) -> str:
        """How radiance becomes values, in words as tables state it."""
        exposed = self.metering.words if self.metering else f"exposed {1e3 * self.exposure_time:g} ms"
        filters = "".join(f", {optical.words}" for optical in self.filters)
        pattern = "" if self.fixed_pattern is None else f", fixed pattern of serial {self.fixed_pattern.serial}"
        return f"{self.chip} (EMVA 1288), linear, {self.bits} bit, f/{self.f_number:g}, {exposed}{filters}{pattern}"

    @property
    def saturation(self) -> float:
        """Electrons at which the pixel clips: the full well or the converter, whichever comes first [e-]."""
        return min(self.full_well, (self.full_scale - self.black_level) / self.gain)

    @property
    def clips_from(self) -> float:
        """Share of the largest value from which on a pixel is only a lower bound of its light."""
        black = self.black_level / self.full_scale
        return black + _NEAR_FULL * min(1.0 - black, self.saturation * self.gain / self.full_scale)

    @property
    def noise(self) -> SensorNoise:
        """Shot and read noise where the largest value is white; to who has one frame a fixed pattern is noise too."""
        levels, pattern = self.full_scale, self.fixed_pattern or FixedPattern()
        read = math.hypot(self.read_noise, pattern.dsnu.total)
        return SensorNoise(levels=levels, electrons=levels / self.gain, read=read, uneven=pattern.prnu.total)

    def decode(self, share: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signals [white] of shares of the largest value, any shape: without the black level."""
        return share - self.black_level / self.full_scale

    @property
    def electrons_per_signal(self) -> float:
        """Electrons in a pixel per response-weighted radiance of 1 A m-2 sr-1.

        >>> camera = Emva(exposure_time=1e-3, f_number=2.0, lens_transmission=1.0, pixel_pitch=4e-3)
        >>> round(camera.electrons_per_signal * ELEMENTARY_CHARGE / (16e-12 * 1e-3 * math.pi / 16.0), 12)
        1.0
        """
        etendue = (self.pixel_pitch * 1e-3) ** 2 * math.pi * self.lens_transmission / (4.0 * self.f_number**2)
        return etendue * self.exposure_time / ELEMENTARY_CHARGE

    @property
    def responses(self) -> dict[str, Curve]:
        """Responsivity of each channel behind the filters [A/W]: quantum efficiency times wavelength e / (h c)."""
        found = {}
        for channel, columns in CHIPS[self.chip].items():
            curves = [tabulated("camera_qe_cmv12000", column) for column in columns]
            efficiency = np.mean([curve.values for curve in curves], axis=0)
            # lambda times a broken line is no broken line; a product on a fine grid is one to 1e-5
            wavelengths = Curve(np.array([300.0, 1100.0]), np.array([300.0, 1100.0]) / _VOLT_NM)
            curve = Curve(curves[0].wavelengths, efficiency).times(wavelengths)
            for optical in self.filters:
                curve = optical.of(curve)
            found[channel] = curve
        return found


#: cameras by name: their exposure time is set once, from the campaign's brightest power
EMVA_PRESETS: dict[str, Emva] = {
    "cmv12000-mono": Emva(metering=Metering()),
    "cmv12000-nir": Emva(chip="cmv12000-nir", metering=Metering()),
    "cmv12000-nir-longpass800": Emva(chip="cmv12000-nir", filters=(LongPass(edge=800.0),), metering=Metering()),
    "cmv12000-rgb": Emva(chip="cmv12000-rgb", metering=Metering()),
}
