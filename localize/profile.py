"""Beam profiles averaged over a pixel: the profile's two antiderivatives, piecewise polynomials.

`w` is the variable in which the profile is a piecewise polynomial and which grows towards the axis: the cosine of the
angle off the axis for hard and Cycles beams, minus the angle for linear and tabulated ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scene.beam import Beam, CyclesBeam, HardBeam, LinearBeam, TabulatedBeam

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Profile:
    """A beam profile g(w) as polynomials between knots: 0 before the first, the last one beyond the last."""

    knots: Array  #: increasing `[S]`
    coefficients: Array  #: of g in (w - knot), constant first `[S, D]`
    cosine: bool  #: whether w is the cosine; otherwise minus the angle [rad]
    half_angle: float  #: [rad]

    def __post_init__(self) -> None:
        """Integrate g twice, piece by piece."""
        once = _integrate(self.knots, self.coefficients)
        object.__setattr__(self, "_once", once)
        object.__setattr__(self, "_twice", _integrate(self.knots, once))

    @classmethod
    def of(cls, beam: Beam) -> Profile:
        """The profile of a beam."""
        b = beam.half_angle
        if isinstance(beam, HardBeam):
            return cls(np.array([math.cos(b)]), np.array([[1.0]]), True, b)
        if isinstance(beam, CyclesBeam):
            low = math.cos(b)
            ramp = beam.blend * (1.0 - low)
            pieces = np.array([[0.0, 0.0, 3.0 / ramp**2, -2.0 / ramp**3], [1.0, 0.0, 0.0, 0.0]])
            return cls(np.array([low, low + ramp]), pieces, True, b)
        if isinstance(beam, LinearBeam):
            angles, values = np.array([beam.beam_width, beam.half_angle]), np.array([1.0, 0.0])
        else:
            assert isinstance(beam, TabulatedBeam)
            angles, values = np.asarray(beam.angles), np.asarray(beam.intensities)
        w = -angles[::-1]
        g = values[::-1]
        slopes = np.append(np.diff(g) / np.diff(w), 0.0)
        return cls(w, np.stack([g, slopes], axis=1), False, b)

    def variable(self, cosine: Array) -> tuple[Array, Array | float]:
        """w at cosines of the angle off the axis, and |dw / dcosine|."""
        if self.cosine:
            return cosine, 1.0
        c = np.clip(cosine, -1.0, 1.0)
        return -np.arccos(c), 1.0 / np.sqrt(np.maximum(1.0 - c * c, 1e-12))

    def angle_at(self, level: float) -> float:
        """The largest angle off the axis [rad] at which the profile reaches `level` (0..1)."""
        angles = np.linspace(self.half_angle, 0.0, 2001)
        w = np.cos(angles) if self.cosine else -angles
        reached = np.flatnonzero(self._piecewise(self.coefficients, w) >= level)
        return float(angles[reached[0]]) if len(reached) else 0.0

    def value(self, w: Array) -> Array:
        """g(w), any shape."""
        return self._piecewise(self.coefficients, w)

    def mean(self, w: Array, px: Array, py: Array) -> tuple[Array, Array]:
        """Mean of g over a pixel, and its derivative by w, where w rises by 2 px and 2 py along the pixel's two sides.

        [H(w+p+q) - H(w+p-q) - H(w-p+q) + H(w-p-q)] / 4pq with H'' = g; px, py are half rises, not negative.
        """
        largest = np.maximum(px, py)
        floor = np.maximum(1e-3 * largest, 1e-9)
        p, q = np.maximum(px, floor), np.maximum(py, floor)
        mean, slope = np.empty_like(w), np.zeros_like(w)
        reach = p + q
        # beyond the last knot every profile is constant
        flat = w > self.knots[-1] + reach
        dark = w < self.knots[0] - reach
        mean[flat] = self._piecewise(self.coefficients, w[flat])
        mean[dark] = 0.0
        edge = np.flatnonzero(~(flat | dark))
        a, b, c = w[edge], p[edge], q[edge]
        twice: Array = self._twice  # type: ignore[attr-defined]
        once: Array = self._once  # type: ignore[attr-defined]
        area = 4.0 * b * c
        corners = (a + b + c, a + b - c, a - b + c, a - b - c)
        h = [self._piecewise(twice, x) for x in corners]
        mean[edge] = (h[0] - h[1] - h[2] + h[3]) / area
        h = [self._piecewise(once, x) for x in corners]
        slope[edge] = (h[0] - h[1] - h[2] + h[3]) / area
        return mean, slope

    def _piecewise(self, coefficients: Array, w: Array) -> Array:
        if len(self.knots) == 1:
            x = np.maximum(w - self.knots[0], 0.0)
            lit = w >= self.knots[0]
            return _polynomial(coefficients[0][:, None], x) * lit
        piece = np.searchsorted(self.knots, w, side="right") - 1
        x = w - self.knots[np.maximum(piece, 0)]
        return np.where(piece >= 0, _polynomial(coefficients[np.maximum(piece, 0)].T, x), 0.0)


def _polynomial(coefficients: Array, x: Array) -> Array:
    result = np.broadcast_to(coefficients[-1], x.shape)
    for row in coefficients[-2::-1]:
        result = result * x + row
    return np.asarray(result)


def _integrate(knots: Array, coefficients: Array) -> Array:
    """Antiderivative, 0 at the first knot and continuous, as polynomials between the same knots."""
    degree = np.arange(1, coefficients.shape[1] + 1)
    result = np.concatenate([np.zeros((len(knots), 1)), coefficients / degree], axis=1)
    for i in range(1, len(knots)):
        result[i, 0] = np.polyval(result[i - 1, ::-1], knots[i] - knots[i - 1])
    return result
