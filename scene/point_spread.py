"""Point spread: how the light of a point lies around its image, as lengths in the plane that is looked at."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from conespot.scene.csv_lines import CsvLine, csv_lines
from conespot.scene.model import Model, Text, Words
from conespot.scene.quantity import UNITS, Length, Quantity, format_quantity, parse_quantity
from conespot.scene.text_file import at_home

#: no residual spread is wider [mm]: what is more is glare
WIDEST = 1.0
_MOST_POINTS = 4096
_Radius = Annotated[Length, Field(ge=0.0, le=WIDEST)]
_Relative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class GaussianSpread(Model):
    """A Gaussian of standard deviation `sigma` along either axis."""

    kind: Literal["gaussian"] = "gaussian"
    sigma: Annotated[Length, Field(gt=0.0, le=WIDEST / 5.0)]

    @property
    def words(self) -> str:
        """The point spread in words, as tables state it."""
        return f"blur of sigma {format_quantity(1e3 * self.sigma, 'length').removesuffix(' mm')} um"


class TabulatedSpread(Model):
    """Measured: relative `values` per area at `radii` from the middle, linear between them and 0 beyond the last.

    A file has them in its first two columns, radii in um or in the unit that its header ends with.
    """

    kind: Literal["table"] = "table"
    radii: tuple[_Radius, ...] = Field(min_length=2, max_length=_MOST_POINTS)
    values: tuple[_Relative, ...] = Field(min_length=2, max_length=_MOST_POINTS)

    @model_validator(mode="after")
    def _a_profile(self) -> TabulatedSpread:
        if len(self.radii) != len(self.values):
            raise ValueError("radii and values must have the same length")
        if self.radii[0] != 0.0 or np.any(np.diff(self.radii) <= 0.0):
            raise ValueError("radii must begin at 0 and increase")
        if not max(self.values) > 0.0:
            raise ValueError("values must not be zero everywhere")
        return self

    @property
    def words(self) -> str:
        """The point spread in words, as tables state it."""
        return f"tabulated blur up to {1e3 * self.radii[-1]:.6g} um"


def _read(path: Path) -> dict[str, Any]:
    """Radii and values of a CSV file. Raises ValueError with file and line for anything else."""
    pairs: list[tuple[float, float]] = []
    header: CsvLine | None = None
    unit = 1e-3
    for line in csv_lines(path, "point spread"):
        try:
            radius, value = line.value(0), line.value(1)
        except ValueError as error:
            if pairs or header is not None:
                example = "expected a radius in um and a value, as in `2.5, 0.8`"
                raise ValueError(f"{path}:{line.number}: {example} ({error})") from None
            header, unit = line, _unit(path, line)
            continue
        if not (0.0 <= unit * radius <= WIDEST and 0.0 <= value < math.inf):
            raise ValueError(
                f"{path}:{line.number}: radii are from 0 to {format_quantity(WIDEST, 'length')} and values 0 or more,"
                f" got {', '.join(line.cells[:2])}"
            )
        pairs.append((unit * radius, value))
        if len(pairs) > _MOST_POINTS:
            raise ValueError(f"{path}:{line.number}: more than {_MOST_POINTS} lines")
    if len(pairs) < 2:
        raise ValueError(f"{path}: a point spread needs at least two lines of radius and value, got {len(pairs)}")
    radii, values = zip(*pairs, strict=True)
    return {"radii": [format_quantity(radius, "length") for radius in radii], "values": list(values)}


def _unit(path: Path, header: CsvLine) -> float:
    """Of the radii below a header [mm]: um, or what the name of its first column ends with (`radius_mm`)."""
    words = re.findall(r"[^\W\d_]+", header.cells[0])
    if len(words) < 2:
        return UNITS["length"]["um"]
    unit = words[-1].replace("\N{MICRO SIGN}", "u").replace("\N{GREEK SMALL LETTER MU}", "u")
    if unit not in UNITS["length"]:
        raise ValueError(
            f"{path}:{header.number}: {header.cells[0][:40]!r} names no length; end it with one of"
            f" {', '.join(UNITS['length'])}"
        )
    return UNITS["length"][unit]


def _spread(value: Any, info: ValidationInfo) -> Any:
    """A length alone is a Gaussian's sigma; `none` and 0 are no blur; a mapping's kind shows in its keys."""
    if value == "none":
        return None
    if isinstance(value, dict) and "kind" not in value:
        if "file" in value:
            if len(value) > 1:
                raise ValueError("a file holds the whole profile; leave the other keys out")
            folder = Path((info.context or {}).get("folder", "."))
            value = _read(folder / at_home(Path(str(value["file"]))))
        return {"kind": "table" if "radii" in value or "values" in value else "gaussian", **value}
    if isinstance(value, (str, int, float)) and not isinstance(value, bool):
        sigma = parse_quantity(value, "length", bare=not info.context)
        return None if sigma == 0.0 else {"kind": "gaussian", "sigma": value}
    return value


#: what the key of a file holds: `none`, a Gaussian's sigma, a file or a profile
PointSpread = Annotated[
    Annotated[GaussianSpread | TabulatedSpread, Field(discriminator="kind")] | None,
    BeforeValidator(_spread),
    Words(lambda: ["none"]),
    Text(Quantity("length").pattern),
]
