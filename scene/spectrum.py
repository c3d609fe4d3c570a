"""Spectra: curves over wavelength, the published tables they come from, and lights that integrate to their watts."""

from __future__ import annotations

import csv
import functools
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.scene.csv_lines import CsvLine, csv_lines, within

Array = NDArray[np.float64]
_MOST_PAIRS = 100_000


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity over wavelength: linear between `wavelengths` `[N]` [nm], which increase, and 0 outside them.

    >>> triangle = Curve(np.array([500.0, 550.0, 600.0]), np.array([0.0, 2.0, 0.0]))
    >>> triangle([500.0, 525.0, 700.0]).tolist()
    [0.0, 1.0, 0.0]
    >>> triangle.integral(), triangle.integral(low=550.0), round(triangle.mean_wavelength, 6)
    (100.0, 50.0, 550.0)
    """

    wavelengths: Array
    values: Array

    def __post_init__(self) -> None:
        if self.wavelengths.shape != self.values.shape or self.wavelengths.ndim != 1 or len(self.wavelengths) < 2:
            raise ValueError("a spectrum needs at least two wavelengths and as many values")
        if not (np.all(np.isfinite(self.wavelengths)) and np.all(np.isfinite(self.values))):
            raise ValueError("a spectrum's numbers must be finite")
        if np.any(np.diff(self.wavelengths) <= 0.0):
            raise ValueError("a spectrum's wavelengths must increase")

    def __call__(self, wavelength: ArrayLike) -> Array:
        """Values at wavelengths [nm], any shape."""
        return np.interp(np.asarray(wavelength, float), self.wavelengths, self.values, left=0.0, right=0.0)

    @property
    def low(self) -> float:
        """Shortest wavelength [nm]."""
        return float(self.wavelengths[0])

    @property
    def high(self) -> float:
        """Longest wavelength [nm]."""
        return float(self.wavelengths[-1])

    def integral(self, low: float | None = None, high: float | None = None) -> float:
        """Integral over wavelength [value nm], exact for the broken line, between `low` and `high` [nm]."""
        a = self.low if low is None else max(low, self.low)
        b = self.high if high is None else min(high, self.high)
        if b <= a:
            return 0.0
        inside = self.wavelengths[(self.wavelengths > a) & (self.wavelengths < b)]
        x = np.concatenate([[a], inside, [b]])
        return float(np.trapezoid(self(x), x))

    def normalised(self) -> Curve:
        """The same shape with integral 1: a power times this is a spectral power [W/nm]. Raises ValueError if dark."""
        total = self.integral()
        if np.any(self.values < 0.0) or not total > 0.0:
            raise ValueError("a light's spectrum must not be negative, nor zero everywhere")
        return Curve(self.wavelengths, self.values / total)

    def times(self, other: Curve) -> Curve:
        """The product with another curve, on a grid fine enough (0.5 nm and both curves' points) for its curvature."""
        low, high = max(self.low, other.low), min(self.high, other.high)
        if high <= low:
            return Curve(np.array([low, low + 1.0]), np.zeros(2))
        fine = np.linspace(low, high, max(2, int(np.ceil((high - low) / 0.5)) + 1))
        x = np.unique(np.concatenate([fine, self.wavelengths, other.wavelengths]))
        x = x[(x >= low) & (x <= high)]
        # a step of either curve is a pair of points closer than this; merging would smear it
        x = x[np.concatenate([[True], np.diff(x) > 1e-9])]
        return Curve(x, self(x) * other(x))

    def cut(self, low: float, high: float) -> Curve:
        """The curve between `low` and `high` [nm], with a sharp edge there, 0 outside."""
        a, b = max(low, self.low), min(high, self.high)
        if b <= a:
            return Curve(np.array([low, high]), np.zeros(2))
        inside = self.wavelengths[(self.wavelengths > a) & (self.wavelengths < b)]
        x = np.concatenate([[a], inside, [b]])
        return Curve(x, self(x))

    @property
    def mean_wavelength(self) -> float:
        """Centroid [nm]."""
        fine = self.times(Curve(self.wavelengths, self.wavelengths))
        return fine.integral() / self.integral()


def mean_of(light: Curve, quantity: Curve) -> float:
    """Mean of a quantity weighted by a light's spectrum, 0 where the quantity is not tabulated.

    >>> flat, ramp = (Curve(np.array([500.0, 600.0]), np.array(ends)) for ends in ([1.0, 1.0], [0.0, 1.0]))
    >>> round(mean_of(flat, ramp), 9)
    0.5
    """
    return light.times(quantity).integral() / light.integral()


@functools.cache
def tabulated(table: str, column: str) -> Curve:
    """A column of a table in scene/data; its source stands in the file. Rows where the column is blank are left out."""
    text = resources.files("conespot.scene").joinpath(f"data/{table}.csv").read_text("utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    pairs = np.array([(float(row["wavelength_nm"]), float(row[column])) for row in rows if row[column]])
    return Curve(pairs[:, 0], pairs[:, 1])


def read_curve(path: Path) -> list[tuple[float, float]]:
    """Wavelength [nm] and value pairs of the first two columns of a CSV file; `#` lines and a header may precede.

    Raises ValueError with file and line for anything else.
    """
    pairs: list[tuple[float, float]] = []
    header: CsvLine | None = None
    for line in csv_lines(path, "spectrum"):
        try:
            wavelength, value = line.value(0), line.value(1)
        except ValueError as error:
            if not pairs and header is None:
                header = line
                continue
            example = "expected wavelength in nm and a value, as in `532, 1.0`"
            raise ValueError(f"{path}:{line.number}: {example} ({error})") from None
        if header is not None:
            within(path, header, line)
        if not (np.isfinite(wavelength) and np.isfinite(value)):
            raise ValueError(f"{path}:{line.number}: wavelength and value must be finite numbers")
        pairs.append((wavelength, value))
        if len(pairs) > _MOST_PAIRS:
            raise ValueError(f"{path}:{line.number}: more than {_MOST_PAIRS} lines")
    if len(pairs) < 2:
        raise ValueError(f"{path}: a spectrum needs at least two lines of wavelength in nm and value")
    return pairs
