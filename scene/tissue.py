"""The layers under the retina's surface, and the kernel by which light spreads in them.

Coefficients are known to a factor of two at best, so `scattering` multiplies all of them, and the tables carry it as an
axis. Lengths are mm; scattering falls as 1 / wavelength.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.scene import fundus
from conespot.scene.retina import Pigmentation

Array = NDArray[np.float64]

#: of all tissue; the vitreous in front has 1.336, which is nearly the same, and its boundary is left out
INDEX = 1.37
#: absorption of the choroid [1/mm] at wavelengths [nm] (M. A. Mainster et al., Bull. Math. Biophys. 32:579, 1970)
_CHOROID_ABSORPTION = ((532.0, 11.8), (660.0, 6.5), (850.0, 2.48), (940.0, 1.59))
#: melanin against the medium eye's, which Mainster's is taken for: a light fundus has a third (shared with no other
#: formula); the dark one as in the closed form, 2.1 / 1.2
_MELANIN: dict[Pigmentation, float] = {"light": 1.0 / 3.0, "medium": 1.0, "dark": 1.75}


@dataclass(frozen=True)
class Layer:
    """A homogeneous slab of tissue that scatters by Henyey and Greenstein's phase function."""

    thickness: float  #: [mm], may be infinite
    scattering: float  #: mu_s [1/mm]
    absorption: float  #: mu_a [1/mm]
    anisotropy: float  #: g, mean cosine of a scattering
    index: float = INDEX


def choroid(wavelength: float, pigmentation: Pigmentation, scattering: float = 1.0) -> Layer:
    """The choroid at a wavelength [nm]: melanin by pigmentation, and the blood of the closed form's perifovea."""
    thickness = 0.25
    path = fundus.SITES["perifovea"].blood  # [um] of blood in that thickness
    blood = float(fundus.blood_absorption(wavelength, fundus.BLOOD.choroid_saturation)) * path / thickness
    melanin = _MELANIN[pigmentation] * _between(wavelength, _CHOROID_ABSORPTION)
    return Layer(thickness, scattering * 70.0 * 550.0 / wavelength, melanin + blood, 0.94)


def sclera(wavelength: float, scattering: float = 1.0) -> Layer:
    """The sclera at a wavelength [nm].

    Its absorption is chosen: what makes it transmit 6 % at 442 nm, and little (A. Vogel et al., Lasers Surg. Med.
    11:331, 1991, measured 6 % there and 35 % at 804 nm).
    """
    return Layer(0.7, scattering * 90.0 * 550.0 / wavelength, 0.38 * (wavelength / 442.0) ** -3.4, 0.90)


def deep_layers(wavelength: float, pigmentation: Pigmentation, scattering: float = 1.0) -> tuple[Layer, ...]:
    """What lies behind the pigment epithelium: choroid and sclera, at a wavelength [nm]."""
    return choroid(wavelength, pigmentation, scattering), sclera(wavelength, scattering)


def _between(wavelength: float, points: tuple[tuple[float, float], ...]) -> float:
    """A power law between two points and beyond the last."""
    x, y = np.log(np.array(points)).T
    at = math.log(wavelength)
    i = int(np.clip(np.searchsorted(x, at), 1, len(x) - 1))
    return math.exp(y[i] + (y[i] - y[i - 1]) / (x[i] - x[i - 1]) * (at - x[i]))
