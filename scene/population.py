"""Eyes of a population: how large retinas are and how their shapes scatter.

Semi-axes over refraction are D. A. Atchison's (Optical models for human myopic eyes, Vision Res. 46:2236, 2006). That
shapes vary considerably among eyes of like refraction is said by D. A. Atchison et al. (Shape of the retinal surface
in emmetropia and myopia, IOVS 46:2698, 2005; 87 eyes), in an abstract without a figure: their scatter here, and that
of refractions, are assumptions.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: semi-axes along x, y and z [mm] of an eye without refraction, and their growth [mm/D]
_EMMETROPIC, _PER_DIOPTRE = np.array([11.455, 11.365, 10.148]), np.array([-0.043, -0.090, -0.163])
#: mean and standard deviation of refractions, and their range [D]; an assumption
_REFRACTION, _REFRACTIONS = (-1.0, 2.5), (-8.0, 4.0)
#: standard deviation of each semi-axis among eyes of one refraction [mm]; an assumption
_SCATTER = 0.4
#: standard deviation of a semi-axis over the population [mm], that of the longest scatter: what `Knowns` may say of any
SEMI_AXES_SIGMA_MM = float(np.hypot(_SCATTER, _REFRACTION[1] * abs(_PER_DIOPTRE).max()))


def mean_semi_axes() -> Array:
    """The mean eye's semi-axes along x, y and z `[3]` [mm].

    >>> mean_semi_axes().round(3).tolist()
    [11.498, 11.455, 10.311]
    """
    return np.asarray(_EMMETROPIC + _REFRACTION[0] * _PER_DIOPTRE)


def semi_axes_of(eye: int | Literal["mean"]) -> tuple[float, float, float]:
    """An eye's semi-axes along x, y and z in units of the mean eye's along z, which is the radius to go with them."""
    mean = mean_semi_axes()
    x, y, z = (mean if eye == "mean" else drawn_semi_axes(eye)) / mean[2]
    return float(x), float(y), float(z)


def drawn_semi_axes(number: int) -> Array:
    """The semi-axes along x, y and z `[3]` [mm] of one eye of the population; the same for the same `number`."""
    rng = np.random.default_rng(np.random.SeedSequence([0x0E7E, number]))
    refraction = float(np.clip(rng.normal(*_REFRACTION), *_REFRACTIONS))
    return np.asarray(_EMMETROPIC + refraction * _PER_DIOPTRE + _SCATTER * rng.standard_normal(3))
