"""Light: the spotlights' spectrum, and the ambient light of the microscope.

Every spectrum integrates to 1 over wavelength, so that a power in watts (or an irradiance) is its integral.
"""

from __future__ import annotations

import math
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationError, ValidationInfo, model_validator

from conespot.scene.document import InputError
from conespot.scene.installed import described, loaded, offered, sentence
from conespot.scene.model import Model, Words, unknown_name
from conespot.scene.quantity import Angle, Irradiance, Wavelength
from conespot.scene.spectrum import Curve, read_curve, tabulated
from conespot.scene.text_file import at_home

_Visible = Annotated[Wavelength, Field(ge=300.0, le=1100.0)]
_Name = Annotated[str, Field(pattern=r"^[\w .+-]{1,40}$")]


#: entry points by which other packages offer lamps
GROUP = "conespot.illuminants"


class Illuminant(Protocol):
    """What every kind of light says of itself."""

    @property
    def spectrum(self) -> Curve:
        """Spectral density [1/nm]; what other packages offer is scaled to integral 1."""


class FlatBand(Model):
    """Constant spectral power between two wavelengths, nothing outside; it integrates to the stated watts."""

    kind: Literal["flat"] = "flat"
    name: _Name = "white"
    low: _Visible = 400.0
    high: _Visible = 700.0

    @model_validator(mode="after")
    def _ordered(self) -> FlatBand:
        if self.high <= self.low:
            raise ValueError("high must be above low")
        return self

    @property
    def spectrum(self) -> Curve:
        """Spectral density with integral 1 [1/nm]."""
        return Curve(np.array([self.low, self.high]), np.full(2, 1.0 / (self.high - self.low)))


#: tabulated lamps: the column of light_sources.csv, and the band that the lamp is used over [nm]
LAMPS: dict[str, tuple[str, float, float]] = {
    "led-b1": ("led_B1_2733K", 380.0, 780.0),
    "led-b3": ("led_B3_4103K", 380.0, 780.0),
    "led-b5": ("led_B5_6598K", 380.0, 780.0),
    "led-v1": ("led_V1_violet", 380.0, 780.0),
    "xenon": ("xenon_arc", 380.0, 730.0),
    "halogen": ("halogen_3200K", 380.0, 1100.0),
    "ir850": ("ir850", 780.0, 930.0),
    "ir940": ("ir940", 820.0, 1030.0),
}


class Lamp(Model):
    """A published spectrum: `led-b3` is a phosphor white LED, `halogen` a 3200 K black body, `ir850` an IR LED.

    Each is cut to the band its source covers, or for the IR LEDs to where it falls below 1e-4 of its peak.
    """

    kind: Literal["lamp"] = "lamp"
    name: Literal["led-b1", "led-b3", "led-b5", "led-v1", "xenon", "halogen", "ir850", "ir940"] = "led-b3"

    @property
    def spectrum(self) -> Curve:
        """Spectral density with integral 1 [1/nm]."""
        column, low, high = LAMPS[self.name]
        return tabulated("light_sources", column).cut(low, high).normalised()


class Line(Model):
    """A laser line: a triangle of full width at half maximum `width` about `wavelength`."""

    kind: Literal["line"] = "line"
    name: _Name = "line"
    wavelength: _Visible = 532.0
    width: Annotated[Wavelength, Field(gt=0.0, le=50.0)] = 1.0

    @property
    def spectrum(self) -> Curve:
        """Spectral density with integral 1 [1/nm].

        >>> spectrum = Line(wavelength=532.0, width=2.0).spectrum
        >>> spectrum([530.0, 531.0, 532.0]).tolist(), spectrum.integral()
        ([0.0, 0.25, 0.5], 1.0)
        """
        x = self.wavelength + self.width * np.array([-1.0, 0.0, 1.0])
        return Curve(x, np.array([0.0, 1.0, 0.0]) / self.width)


class MeasuredLight(Model):
    """A spectrum from the first two columns (wavelength in nm, spectral power in any unit) of a CSV file."""

    kind: Literal["csv"] = "csv"
    name: _Name = "measured"
    file: str
    points: tuple[tuple[float, float], ...] = Field((), max_length=100_000, validate_default=False)

    @model_validator(mode="after")
    def _a_light(self) -> MeasuredLight:
        spectrum = self.spectrum
        if spectrum.low < 300.0 or spectrum.high > 1100.0:
            raise ValueError(f"{self.file}: wavelengths must lie in 300 to 1100 nm")
        return self

    @property
    def spectrum(self) -> Curve:
        """Spectral density with integral 1 [1/nm]."""
        if not self.points:
            raise ValueError(f"{self.file}: holds no spectrum")
        pairs = np.array(self.points)
        return Curve(pairs[:, 0], pairs[:, 1]).normalised()


class InstalledLight(Model):
    """A lamp that another installed package offers: an entry point of the group `conespot.illuminants`.

    Its value is an `Illuminant`. A file names it; the resolved scene holds its spectrum, so that a run can be repeated
    whatever becomes of the package.
    """

    kind: Literal["installed"] = "installed"
    name: _Name
    package: str  #: and its version
    points: tuple[tuple[float, float], ...] = Field(min_length=2, max_length=100_000)

    @classmethod
    def of(cls, entry: EntryPoint) -> InstalledLight:
        """The lamp of an entry point. Raises InputError, naming the package, if it cannot be loaded or is none."""
        value = loaded(entry, "light")
        try:
            curve = getattr(value, "spectrum", None)
            if not isinstance(curve, Curve):
                raise TypeError("its spectrum is no conespot.scene.spectrum.Curve")
            pairs = zip(curve.wavelengths.tolist(), curve.values.tolist(), strict=True)
            package = f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value
            return cls(name=entry.name, package=package, points=tuple(pairs))
        except (Exception, SystemExit) as error:
            reason = error.errors()[0]["msg"] if isinstance(error, ValidationError) else sentence(error)
            raise InputError(f"light {described(entry)} is none: {reason}; mend or uninstall that package") from None

    @model_validator(mode="after")
    def _a_light(self) -> InstalledLight:
        if self.spectrum.low < 300.0 or self.spectrum.high > 1100.0:
            raise ValueError("wavelengths must lie in 300 to 1100 nm")
        return self

    @property
    def spectrum(self) -> Curve:
        """Spectral density with integral 1 [1/nm]."""
        return Curve(*np.array(self.points).T).normalised()


Light = FlatBand | Lamp | Line | MeasuredLight | InstalledLight
LIGHTS: dict[str, Light] = {
    "white": FlatBand(),
    **{name: Lamp.model_validate({"name": name}) for name in LAMPS},
    "line532": Line(name="line532", wavelength=532.0),
    "line660": Line(name="line660", wavelength=660.0),
}


def light_name(light: Light) -> str:
    """The name of a preset or the one its user gave; the wavelengths of a band or line that has neither.

    >>> light_name(FlatBand()), light_name(FlatBand(low=500.0, high=600.0)), light_name(Line(wavelength=589.3))
    ('white', '500-600 nm', 'line 589.3 nm')
    """
    if light.name in LIGHTS and light == LIGHTS[light.name]:
        return light.name
    unnamed = light.name in LIGHTS or light.name == type(light).model_fields["name"].default
    if unnamed and isinstance(light, FlatBand):
        return f"{light.low:.12g}-{light.high:.12g} nm"
    if unnamed and isinstance(light, Line):
        wide = "" if light.width == 1.0 else f", {light.width:.12g} nm wide"
        return f"line {light.wavelength:.12g} nm{wide}"
    return light.name


def _lights() -> list[str]:
    return [*LIGHTS, *offered(GROUP)]


def _named_light(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, str):
        if value in LIGHTS:
            return LIGHTS[value]
        others = offered(GROUP)
        if value not in others:
            raise unknown_name(value, [*LIGHTS, *others], "light")
        try:
            return InstalledLight.of(others[value])
        except InputError as error:
            raise ValueError(str(error)) from None
    if isinstance(value, dict) and value.get("kind") == "csv" and "points" not in value and "file" in value:
        folder = Path((info.context or {}).get("folder", "."))
        value = {**value, "points": read_curve(folder / at_home(Path(str(value["file"]))))}
    return value


Illumination = Annotated[Annotated[Light, Field(discriminator="kind")], BeforeValidator(_named_light), Words(_lights)]


class Ambient(Model):
    """The microscope's own light: collimated, from above, `tilt` off the camera's axis towards `azimuth`.

    `irradiance` is on a plane across the beam, so a Lambertian retina of albedo a shows the radiance
    a / pi * irradiance * cos(incidence).
    """

    irradiance: Irradiance = Field(0.23 * math.pi, ge=0.0)
    tilt: Annotated[Angle, Field(ge=0.0, lt=math.pi / 4.0)] = 0.0
    azimuth: Angle = 0.0
    illumination: Illumination = FlatBand()

    @property
    def towards(self) -> NDArray[np.float64]:
        """Unit direction `[3]` from the retina to the light."""
        across = math.sin(self.tilt)
        return np.array([across * math.cos(self.azimuth), across * math.sin(self.azimuth), math.cos(self.tilt)])
