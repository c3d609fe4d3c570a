"""Spectral reflectance of the living fundus in closed form, 400 to 1000 nm.

    R(l) = 10^(-2 Dmp(l)) { rpe + (1 - rpe)^2 10^(-2 Dme (l/500)^-3.33) Rsc(l) exp(-2 mu_blood(l, 0.95) d_hb) }

A layered model with a specular-like term `rpe` in front of the melanin, a choroid of diffuse reflectance
Rsc(l) = 0.5 exp(-0.00261 (l - 675)) behind melanin and blood, and macular pigment in front of everything. The
parameters are fitted to Delori & Pflibsen, Appl. Opt. 28:1061 (1989), Table I (445-805 nm); beyond 805 nm it
extrapolates. The melanin exponent is that of Jacques, Phys. Med. Biol. 58:R37 (2013).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.scene.spectrum import tabulated

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Blood:
    """Oxygen saturations, and blood paths, single pass [um].

    Chosen, within what is known of human eyes, so that large vessels have the optical densities of `VESSELS` in
    tests/unit/scene/test_fundus.py (0.45 at 570 nm, 0.03 at 850 nm) and the disc is white.
    """

    choroid_saturation: float = 0.95
    artery_saturation: float = 0.97
    vein_saturation: float = 0.60
    artery_depth: float = 80.0  #: of a large retinal artery
    vein_depth: float = 110.0  #: of a large retinal vein
    bypass: float = 0.35  #: part of the light over a vessel that never crosses its blood
    disc: float = 7.5  #: in front of the optic disc's white tissue


BLOOD = Blood()
#: length of the vitreous on the way to the camera [mm]
VITREOUS_LENGTH = 24.0


@dataclass(frozen=True)
class Pigments:
    """What stands in the closed form at one place of the fundus."""

    melanin: float  #: Dme, optical density (base 10, single pass) at 500 nm
    blood: float  #: d_hb, choroidal blood, single pass [um]
    epithelium: float  #: rpe, reflectance in front of the melanin
    macular: float  #: Dmp, macular pigment density (base 10, single pass) at 460 nm


SITES = {
    "nasal": Pigments(1.00, 62.0, 0.026, 0.0),
    "perifovea": Pigments(1.20, 105.0, 0.020, 0.05),
    "fovea": Pigments(1.25, 105.0, 0.0155, 0.25),
}
#: melanin density of the perifovea at 500 nm in a lightly, moderately and heavily pigmented eye
MELANIN = {"light": 0.3, "medium": 1.2, "dark": 2.1}


def blood_absorption(wavelength: ArrayLike, saturation: float) -> Array:
    """Absorption of whole blood, 150 g/l haemoglobin [1/um], natural logarithm (Prahl's table)."""
    oxygenated = tabulated("hemoglobin_prahl", "eps_HbO2_per_cm_per_M")(wavelength)
    reduced = tabulated("hemoglobin_prahl", "eps_Hb_per_cm_per_M")(wavelength)
    return np.asarray(2.303 * (saturation * oxygenated + (1.0 - saturation) * reduced) * 150.0 / 64500.0 * 1e-4)


def scatter(wavelength: ArrayLike) -> Array:
    """Diffuse reflectance Rsc of the tissue behind melanin and blood."""
    return np.asarray(0.5 * np.exp(-0.00261 * (np.asarray(wavelength, float) - 675.0)))


def macular_template(wavelength: ArrayLike) -> Array:
    """Macular pigment density relative to 460 nm (Bone, Landrum & Cairns 1992)."""
    return np.asarray(tabulated("macular_pigment_bone", "optical_density")(wavelength) / 0.35)


def melanin_template(wavelength: ArrayLike) -> Array:
    """Melanin density relative to 500 nm: (l / 500)^-3.33."""
    return np.asarray((np.asarray(wavelength, float) / 500.0) ** -3.33)


def reflectance(wavelength: ArrayLike, pigments: Pigments) -> Array:
    """Reflectance R in the retinal plane at wavelengths [nm], any shape.

    >>> reflectance([500.0, 650.0, 850.0], SITES["perifovea"]).round(3).tolist()
    [0.018, 0.068, 0.125]
    """
    l = np.asarray(wavelength, float)  # noqa: E741 - the formula's own letter
    choroid = scatter(l) * np.exp(-2.0 * blood_absorption(l, BLOOD.choroid_saturation) * pigments.blood)
    behind = (1.0 - pigments.epithelium) ** 2 * 10.0 ** (-2.0 * pigments.melanin * melanin_template(l)) * choroid
    return np.asarray(10.0 ** (-2.0 * pigments.macular * macular_template(l)) * (pigments.epithelium + behind))


def vessel_transmission(wavelength: ArrayLike, saturation: float, depth: float) -> Array:
    """What a vessel of blood path `depth` [um], passed twice, leaves of the fundus' reflectance."""
    blood = np.exp(-2.0 * blood_absorption(wavelength, saturation) * depth)
    return np.asarray(BLOOD.bypass + (1.0 - BLOOD.bypass) * blood)


def vessel_density(wavelength: ArrayLike, saturation: float, depth: float) -> Array:
    """Optical density of a vessel against the fundus beside it, -log10 of its transmission."""
    return np.asarray(-np.log10(vessel_transmission(wavelength, saturation, depth)))


def disc_reflectance(wavelength: ArrayLike, blood: float = BLOOD.disc) -> Array:
    """Reflectance of the optic disc: no pigment, a little blood [um] over white tissue."""
    return np.asarray(
        scatter(wavelength) * np.exp(-2.0 * blood_absorption(wavelength, BLOOD.choroid_saturation) * blood)
    )


def lens_density(wavelength: ArrayLike, age: float = 28.0, density_420: float = 0.45) -> Array:
    """Density (base 10, single pass) of the phakic eye's media: the shape of van de Kraats & van Norren at `age`.

    J. Opt. Soc. Am. A 24:1842 (2007), large field, without their neutral term, scaled to `density_420` at 420 nm.
    """

    def shape(l: Array) -> Array:  # noqa: E741
        squared = age * age
        return np.asarray(
            (0.225 + 0.000031 * squared) * (400.0 / l) ** 4
            + 14.19 * 10.68 * np.exp(-((0.057 * (l - 273.0)) ** 2))
            + (0.998 - 0.000063 * squared) * 2.13 * np.exp(-((0.029 * (l - 370.0)) ** 2))
            + (0.059 + 0.000186 * squared) * 11.95 * np.exp(-((0.021 * (l - 325.0)) ** 2))
            + (0.016 + 0.000132 * squared) * 1.43 * np.exp(-((0.008 * (l - 325.0)) ** 2))
        )

    return density_420 * shape(np.asarray(wavelength, float)) / float(shape(np.array(420.0)))


def water_transmission(wavelength: ArrayLike, length: float = VITREOUS_LENGTH) -> Array:
    """Transmission of `length` [mm] of vitreous, taken as water (Hale & Querry, Appl. Opt. 12:555, 1973)."""
    per_cm = tabulated("water_absorption", "hale_querry_per_cm")(wavelength)
    return np.asarray(np.exp(-per_cm * length / 10.0))


def macular_profile(eccentricity_deg: ArrayLike) -> Array:
    """Macular pigment relative to its centre: 3.6028 / (e^2 + 3.6028) (Putnam & Bland 2014).

    >>> macular_profile([0.0, 3.6028**0.5]).tolist()
    [1.0, 0.5]
    """
    squared = np.square(np.asarray(eccentricity_deg, float))
    return np.asarray(3.6028 / (squared + 3.6028))


def vessel_depth(transmission: ArrayLike, wavelength: float, saturation: float) -> Array:
    """The blood path [um] that `vessel_transmission` turns into a transmission; infinite at the bypass and below."""
    t = np.asarray(transmission, float)
    crossed = (t - BLOOD.bypass) / (1.0 - BLOOD.bypass)
    mu = float(blood_absorption(wavelength, saturation))
    with np.errstate(divide="ignore"):
        return np.where(crossed > 0.0, -np.log(np.maximum(crossed, math.ulp(0.0))) / (2.0 * mu), np.inf)
