"""What light passes on its way out of the eye: refractive indices by wavelength, and the share that comes through.

Indices of the eye's media: R. Navarro, J. Santamaria, J. Bescos, JOSA A 2:1273 (1985), who interpolate four measured
ones by Herzberger's formula, 365 to 1014 nm. PMMA: N. Sultanova et al., Acta Phys. Pol. A 116:585 (2009), 437 to
1052 nm. Transmission: J. van de Kraats, D. van Norren, JOSA A 24:1842 (2007), large field; it has no water in it.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
#: an array of numpy's or of Dr.Jit's: both know + - * /, and no type is known to both
Numbers = Any
Medium = Literal["air", "cornea", "aqueous", "lens", "vitreous", "pmma", "implant"]

#: rows a1 to a4 of Herzberger's a = A + B l^2 + C / (l^2 - 0.028) + D / (l^2 - 0.028)^2, l in um
_HERZBERGER = (
    (0.66147196, -0.40352796, -0.2804679, 0.03385979),
    (-4.20146383, 2.73508956, 1.50543784, -0.11593235),
    (6.29834237, -4.69409935, -1.5750865, 0.10293038),
    (-1.75835059, 2.36253794, 0.35011657, -0.02085782),
)
#: measured indices at 365, 486.1, 656.3 and 1014 nm
_MEASURED: dict[Medium, tuple[float, float, float, float]] = {
    "cornea": (1.3975, 1.3807, 1.37405, 1.3668),
    "aqueous": (1.3593, 1.3422, 1.3354, 1.3278),
    "lens": (1.4492, 1.42625, 1.4175, 1.4097),
    "vitreous": (1.3565, 1.3407, 1.3341, 1.3273),
}
#: of an intraocular lens of acrylic; its dispersion is not known here
IMPLANT = 1.554


def index(medium: Medium, wavelength: Numbers) -> Numbers:
    """Refractive index of a medium at wavelengths [nm], an array of any kind and shape.

    >>> [round(float(index(medium, 543.0)), 4) for medium in ("cornea", "aqueous", "lens", "vitreous", "pmma")]
    [1.3777, 1.3391, 1.4222, 1.3377, 1.493]
    """
    if medium == "air":
        return 1.0
    if medium == "implant":
        return IMPLANT
    square = wavelength * wavelength * 1e-6
    if medium == "pmma":
        return (1.0 + 1.1819 * square / (square - 0.011313)) ** 0.5
    pole = 1.0 / (square - 0.028)
    terms = ((a + b * square + c * pole + d * pole * pole) for a, b, c, d in _HERZBERGER)
    return sum(term * n for term, n in zip(terms, _MEASURED[medium], strict=True))


def transmission(wavelength: ArrayLike, age: float | None) -> Array:
    """Share of the light that the media let through once, at wavelengths [nm], any shape.

    `age` [years] is that of the eye's own lens, which yellows; None for an eye without it, of which the scatter that
    does not grow with age and the loss that is the same at all wavelengths are left.

    >>> (-np.log10(transmission([420.0, 560.0, 850.0], 50.0))).round(4).tolist()
    [0.9732, 0.2042, 0.1258]
    """
    x = np.asarray(wavelength, float)
    density = 0.111 + 0.225 * (400.0 / x) ** 4
    if age is not None:
        a2 = age * age
        density = density + 0.000031 * a2 * (400.0 / x) ** 4 + 151.5492 * np.exp(-((0.057 * (x - 273.0)) ** 2))
        density = density + (0.998 - 0.000063 * a2) * 2.13 * np.exp(-((0.029 * (x - 370.0)) ** 2))
        density = density + (0.059 + 0.000186 * a2) * 11.95 * np.exp(-((0.021 * (x - 325.0)) ** 2))
        density = density + (0.016 + 0.000132 * a2) * 1.43 * np.exp(-((0.008 * (x - 325.0)) ** 2))
    return np.asarray(10.0**-density)
