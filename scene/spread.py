"""How far light spreads under the retina before it comes back: a Monte Carlo's table as sums of Gaussians.

The table gives the share of the light that comes back within some distances (data/tissue_spread.csv). A sum of
Gaussians of fixed widths has shares as near to them as it can, and is smooth between; it goes over into another
wavelength by its parts alone.
"""

from __future__ import annotations

import csv
import functools
from dataclasses import dataclass
from importlib import resources

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.scene.retina import Pigmentation

Array = NDArray[np.float64]

#: standard deviations of the Gaussians [mm], from a third of the table's first radius on: the density of what comes
#: back grows as 1 / distance towards where it entered
WIDTHS = 0.003 * 1.5 ** np.arange(17)


@dataclass(frozen=True, eq=False)
class Kernel:
    """Radiant flux [1/mm2] by distance from where it entered, all of which comes back: sum a exp(-r2 / 2 s2) / 2 pi s2.

    >>> kernel = Kernel(np.eye(len(WIDTHS))[0])
    >>> kernel.enclosed([0.0, 1.0]).tolist()
    [0.0, 1.0]
    """

    parts: Array  #: a of each of the `WIDTHS`, sum 1
    length: float = 1.0  #: by which all of the `WIDTHS` are multiplied

    @property
    def widths(self) -> Array:
        """Standard deviation of each Gaussian [mm]."""
        return np.asarray(self.length * WIDTHS, float)

    def __call__(self, distance: ArrayLike) -> Array:
        """Density [1/mm2] at distances [mm], any shape."""
        ratio = np.asarray(distance, float)[..., None] / self.widths
        return np.asarray(np.exp(-0.5 * ratio**2) @ (self.parts / (2.0 * np.pi * self.widths**2)))

    def enclosed(self, radius: ArrayLike) -> Array:
        """Share that comes back within radii [mm], any shape."""
        ratio = np.asarray(radius, float)[..., None] / self.widths
        return np.asarray(-np.expm1(-0.5 * ratio**2) @ self.parts)

    def reach(self, lost: float) -> float:
        """The radius [mm] outside which no more than the share `lost` comes back."""
        radii = np.geomspace(self.widths[0] / 10.0, self.widths[-1] * 10.0, 2000)
        return float(radii[np.argmax(self.enclosed(radii) >= 1.0 - lost)])


def spread_kernel(
    wavelength: float, pigmentation: Pigmentation, scattering: float = 1.0, length: float = 1.0
) -> Kernel:
    """The kernel of deep light at a wavelength [nm]; `scattering` multiplies every layer's coefficient, 0.5 to 2.

    All of its distances are multiplied by `length`.
    Between the table's wavelengths its parts go in proportion, between its coefficients in proportion to their
    logarithm; beyond its first and last wavelength it stays as it is. Raises ValueError for other coefficients.
    """
    wavelengths, factors, parts = _parts(pigmentation)
    if not factors[0] <= scattering <= factors[-1]:
        raise ValueError(f"scattering {scattering:g} is not within the table's {factors[0]:g} to {factors[-1]:g}")
    across = np.stack([[np.interp(wavelength, wavelengths, column) for column in rows.T] for rows in parts])
    at, known = np.log(scattering), np.log(factors)
    return Kernel(np.array([np.interp(at, known, column) for column in across.T]), length)


@dataclass(frozen=True, eq=False)
class Table:
    """What the Monte Carlo found for one pigmentation."""

    wavelengths: Array  #: `[W]` [nm]
    scattering: Array  #: factors on the coefficients `[S]`
    radii: Array  #: `[K]` [mm]
    reflectance: Array  #: of choroid and sclera alone `[S, W]`
    enclosed: Array  #: share within each radius `[S, W, K]`


@functools.cache
def spread_table(pigmentation: Pigmentation) -> Table:
    """The rows of data/tissue_spread.csv for a pigmentation."""
    text = resources.files("conespot.scene").joinpath("data/tissue_spread.csv").read_text("utf-8")
    rows = list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))
    own = [row for row in rows if row["pigmentation"] == pigmentation]
    names = [name for name in rows[0] if name.replace(".", "").isdigit()]
    found = {
        (float(row["scattering"]), float(row["wavelength_nm"])): [float(row[n]) for n in ("reflectance", *names)]
        for row in own
    }
    factors, wavelengths = (sorted({key[i] for key in found}) for i in (0, 1))
    values = np.array([[found[factor, wavelength] for wavelength in wavelengths] for factor in factors])
    radii = 1e-3 * np.array([float(name) for name in names])
    return Table(np.array(wavelengths), np.array(factors), radii, values[..., 0], values[..., 1:])


@functools.cache
def _parts(pigmentation: Pigmentation) -> tuple[Array, Array, Array]:
    """Wavelengths `[W]`, factors `[S]`, and the parts of the Gaussians `[S, W, G]` that have the table's shares."""
    from scipy.optimize import nnls  # every process of a campaign would wait for it

    table = spread_table(pigmentation)
    rings = np.diff(-np.expm1(-0.5 * (table.radii[:, None] / WIDTHS) ** 2), axis=0, prepend=0.0)
    found = np.empty((*table.enclosed.shape[:2], len(WIDTHS)))
    for place in np.ndindex(found.shape[:2]):
        shares = np.diff(table.enclosed[place], prepend=0.0)
        # every ring to the same part of itself, but for those that hold next to nothing
        weight = 1.0 / np.maximum(shares, 2e-3)
        parts, _ = nnls(weight[:, None] * rings, weight * shares)
        found[place] = parts / parts.sum()
    return table.wavelengths, table.scattering, found
