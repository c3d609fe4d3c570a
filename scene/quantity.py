"""Physical quantities as they are written ("9 deg", "0.25 W") and as they are held (radians, mm, W, nm).

In a file a number must carry its unit; in Python a bare float is taken in the unit held inside. The held unit
of every kind is the one listed first in `UNITS`.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, GetJsonSchemaHandler, PlainSerializer, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

#: context key that marks data read from a file, where a bare number is refused
FROM_FILE = "from_file"

UNITS: dict[str, dict[str, float]] = {
    "length": {"mm": 1.0, "um": 1e-3, "cm": 10.0, "m": 1000.0},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0},
    "power": {"W": 1.0, "mW": 1e-3, "uW": 1e-6},
    "wavelength": {"nm": 1.0, "um": 1e3},
    "radiance": {"W/m2/sr": 1.0, "mW/m2/sr": 1e-3},
    "irradiance": {"W/m2": 1.0, "mW/m2": 1e-3, "mW/cm2": 10.0, "uW/cm2": 1e-2},
    "pixels": {"px": 1.0},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
    "refraction": {"D": 1.0},
    "speed": {"mm/s": 1.0, "um/s": 1e-3, "m/s": 1e3},
    "frequency": {"Hz": 1.0},
}
#: the unit a quantity is written back with
WRITTEN = {
    "length": "mm",
    "angle": "deg",
    "power": "W",
    "wavelength": "nm",
    "radiance": "W/m2/sr",
    "irradiance": "W/m2",
    "pixels": "px",
    "time": "s",
    "refraction": "D",
    "speed": "mm/s",
    "frequency": "Hz",
}
_PERCENT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*%\s*", re.ASCII)
#: a value of a kind, where that is not "a" and its name
_A = {"angle": "an angle", "irradiance": "an irradiance", "pixels": "a number of pixels"}
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z/0-9]+)\s*", re.ASCII)


def parse_quantity(value: object, kind: str, *, bare: bool = True) -> float:
    """The value in the unit held inside for `kind`.

    >>> parse_quantity("0.5 mW", "power"), round(parse_quantity("180 deg", "angle"), 6)
    (0.0005, 3.141593)

    Raises ValueError, in a sentence that says how to write it, for a wrong or missing unit, a bare number where
    `bare` is False, and anything that is not finite.
    """
    units = UNITS[kind]
    what = _A.get(kind, f"a {kind}")
    example = f"'{1 if kind == 'power' else 9} {WRITTEN[kind]}'"
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"expected {what} such as {example}, got {value!r}")
    if isinstance(value, str):
        match = _QUANTITY.fullmatch(value)
        if match is None or match[2] not in units:
            raise ValueError(f"expected {what} such as {example} (units: {', '.join(units)}), got {value!r}")
        number = float(match[1]) * units[match[2]]
    elif bare:
        number = float(value)
    else:
        raise ValueError(f"{value!r} has no unit; write {what} such as {example} (units: {', '.join(units)})")
    if not math.isfinite(number):
        raise ValueError(f"{what} must be finite, got {value!r}")
    return number


def format_quantity(value: float, kind: str) -> str:
    """The quantity as a file holds it, such as "9 deg"."""
    unit = WRITTEN[kind]
    return f"{value / UNITS[kind][unit]:.12g} {unit}"


def in_unit_of(written: str, value: float) -> str:
    """A held `value` in the unit of a quantity as `written`: pi / 2 beside "9 deg" is "90 deg"."""
    match = _QUANTITY.fullmatch(written)
    factors = {units[match[2]] for units in UNITS.values() if match[2] in units} if match else set()
    return f"{value / factors.pop():.12g} {match[2]}" if match and len(factors) == 1 else f"{value:g}"


@dataclass(frozen=True)
class Quantity:
    """Marks a type as a quantity of a kind, for whoever describes the types: a JSON Schema, `campaign explain`."""

    kind: str

    @property
    def pattern(self) -> str:
        """A regular expression, as JSON Schema has them, for how it is written."""
        number = r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"
        return rf"^\s*{number}\s*({'|'.join(UNITS[self.kind])})\s*$"

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """In a file it is a text with a unit."""
        return {"type": "string", "pattern": self.pattern, "examples": [f"1 {WRITTEN[self.kind]}"]}


def _share(value: object) -> object:
    match = _PERCENT.fullmatch(value) if isinstance(value, str) else None
    return float(match[1]) / 100.0 if match else value


def _quantity(kind: str) -> Any:
    def parse(value: object, info: ValidationInfo) -> float:
        from_file = bool(info.context and info.context.get(FROM_FILE))
        try:
            return parse_quantity(value, kind, bare=not from_file)
        except ValueError as error:
            raise PydanticCustomError("quantity", "{reason}", {"reason": str(error)}) from None

    def write(value: float) -> str:
        return format_quantity(value, kind)

    written = PlainSerializer(write, return_type=str, when_used="json")
    return Annotated[float, BeforeValidator(parse), written, Quantity(kind)]


if TYPE_CHECKING:
    Length = float
    Angle = float
    Watts = float
    Wavelength = float
    Radiance = float
    Irradiance = float
    Seconds = float
    Dioptres = float
    Speed = float
    Hertz = float
    Share = float
else:
    Length = _quantity("length")  #: [mm]
    Angle = _quantity("angle")  #: [rad]
    Watts = _quantity("power")  #: [W]
    Wavelength = _quantity("wavelength")  #: [nm]
    Radiance = _quantity("radiance")  #: [W m-2 sr-1]
    Irradiance = _quantity("irradiance")  #: [W m-2]
    Seconds = _quantity("time")  #: [s]
    Dioptres = _quantity("refraction")  #: [1/m]
    Speed = _quantity("speed")  #: [mm/s]
    Hertz = _quantity("frequency")  #: [1/s]
    Share = Annotated[float, BeforeValidator(_share)]  #: 0.02, or in a file "2 %"
