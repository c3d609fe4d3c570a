"""Beam profiles averaged over a pixel: the profile's two antiderivatives, piecewise polynomials.

`w` is the variable in which the profile is a piecewise polynomial and which grows towards the axis: the cosine of the
angle off the axis for hard and Cycles beams, minus the angle for linear and tabulated ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import assert_never

import numpy as np
from numpy.typing import NDArray

from conespot.scene.beam import Beam, CyclesBeam, HardBeam, LinearBeam, TabulatedBeam

Array = NDArray[np.float64]
#: knots from which on it takes longer to look at one after the other
_FEW = 4


@dataclass(frozen=True)
class Profile:
    """A beam profile g(w) as polynomials between knots: 0 before the first, the last one beyond the last."""

    knots: Array  #: increasing `[S]`
    coefficients: Array  #: of g in (w - knot), constant first, cubic at most `[S, D]`
    cosine: bool  #: whether w is the cosine; otherwise minus the angle [rad]
    half_angle: float  #: [rad]

    @staticmethod
    @lru_cache(maxsize=16)
    def of(beam: Beam) -> Profile:
        """The profile of a beam: one for all steps of a fit, with its antiderivatives."""
        match beam:
            case HardBeam():
                return Profile(np.array([math.cos(beam.half_angle)]), np.array([[1.0]]), True, beam.half_angle)
            case CyclesBeam():
                low = math.cos(beam.half_angle)
                ramp = beam.blend * (1.0 - low)
                pieces = np.array([[0.0, 0.0, 3.0 / ramp**2, -2.0 / ramp**3], [1.0, 0.0, 0.0, 0.0]])
                return Profile(np.array([low, low + ramp]), pieces, True, beam.half_angle)
            case LinearBeam():
                return Profile._broken_line([beam.beam_width, beam.half_angle], [1.0, 0.0])
            case TabulatedBeam():
                return Profile._broken_line(beam.angles, beam.intensities)
            case unknown:
                assert_never(unknown)

    @classmethod
    def _broken_line(cls, angles: Sequence[float], intensities: Sequence[float]) -> Profile:
        """The profile that is linear in the angle off the axis [rad] between a table's."""
        w, g = -np.asarray(angles)[::-1], np.asarray(intensities)[::-1]
        slopes = np.append(np.diff(g) / np.diff(w), 0.0)
        return cls(w, np.stack([g, slopes], axis=1), False, angles[-1])

    @property
    def begins_with_a_step(self) -> bool:
        """Whether the light jumps at the edge of the cone."""
        return bool(self.coefficients[0, 0] > 0.0)

    @property
    def is_a_step(self) -> bool:
        """Whether it is nothing but that jump."""
        return self.begins_with_a_step and len(self.knots) == 1 and not self.coefficients[0, 1:].any()

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
        mean, slope = np.zeros_like(w), np.zeros_like(w)
        reach = px + py
        # beyond the last knot every profile is constant, before the first it is dark
        mean[w > self.knots[-1] + reach] = self.coefficients[-1, 0]
        near = np.flatnonzero((w >= self.knots[0] - reach) & (w <= self.knots[-1] + reach))
        a, p, q, r = w[near], px[near], py[near], reach[near]
        piece = self._pieces(a - r)
        within = piece == self._pieces(a + r)
        inside, at = near[within], piece[within] - 1
        # a pixel inside one piece: of a cubic's Taylor series only the second derivative adds to the mean
        spread = (np.square(p[within]) + np.square(q[within])) / 6.0
        x = a[within] - self.knots.take(at)
        c = self._cubic.take(at, axis=1)
        mean[inside] = ((c[3] * x + c[2]) * x + c[1]) * x + c[0] + spread * (2.0 * c[2] + 6.0 * c[3] * x)
        slope[inside] = (3.0 * c[3] * x + 2.0 * c[2]) * x + c[1] + spread * 6.0 * c[3]
        across = ~within
        edge, a, p, q = near[across], a[across], p[across], q[across]
        floor = np.maximum(1e-3 * np.maximum(p, q), 1e-9)
        p, q = np.maximum(p, floor), np.maximum(q, floor)
        corners, area = _corners(a, p, q), 4.0 * p * q
        mean[edge] = _difference(self._piecewise(self._twice, corners)) / area
        slope[edge] = _difference(self._piecewise(self._once, corners)) / area
        return mean, slope

    def curvature(self, w: Array, px: Array, py: Array) -> Array:
        """The second derivative by w of the mean over a pixel, as `mean` takes it."""
        found = np.zeros_like(w)
        at = np.flatnonzero((w >= self.knots[0] - px - py) & (w <= self.knots[-1] + px + py))
        a, p, q = w[at], px[at], py[at]
        floor = np.maximum(1e-3 * np.maximum(p, q), 1e-9)
        p, q = np.maximum(p, floor), np.maximum(q, floor)
        found[at] = _difference(self._piecewise(self.coefficients, _corners(a, p, q))) / (4.0 * p * q)
        return found

    @cached_property
    def jumps(self) -> Array:
        """Coefficients of (w - knot) to the powers 0, 1, ... that each knot adds, the profile being their sum."""
        found = self.coefficients.copy()
        for i in range(1, len(self.knots)):
            gone = self.coefficients[i - 1]
            between = self.knots[i] - self.knots[i - 1]
            for d in range(found.shape[1]):
                powers = [math.comb(n, d) * between ** (n - d) * gone[n] for n in range(d, len(gone))]
                found[i, d] -= math.fsum(powers)
        # what is left of a continuous profile's own value is rounding
        found[1:][np.abs(found[1:]) < 1e-12 * np.abs(self.coefficients).max(axis=0)] = 0.0
        return found

    @cached_property
    def powers(self) -> list[tuple[int, Array]]:
        """The powers n that there are, and what each knot adds `[S]` of (w - knot)^n / n!."""
        degrees = np.flatnonzero(self.jumps.any(axis=0)).tolist()
        return [(n, self.jumps[:, n] * math.factorial(n)) for n in degrees]

    @cached_property
    def _once(self) -> Array:
        return _integrate(self.knots, self.coefficients)

    @cached_property
    def _twice(self) -> Array:
        return _integrate(self.knots, self._once)

    @cached_property
    def _cubic(self) -> Array:
        """Coefficients of the pieces, constant first `[4, S]`."""
        return np.pad(self.coefficients, ((0, 0), (0, 4 - self.coefficients.shape[1]))).T

    def _pieces(self, w: Array) -> NDArray[np.intp]:
        """How many knots are not beyond w `[N]`."""
        if len(self.knots) < _FEW:
            return np.asarray(sum((w >= knot).astype(np.intp) for knot in self.knots.tolist()))
        return np.searchsorted(self.knots, w, side="right")

    def _piecewise(self, coefficients: Array, w: Array) -> Array:
        if len(self.knots) < _FEW:
            found = np.zeros_like(w)
            for knot, piece in zip(self.knots.tolist(), coefficients.tolist(), strict=True):
                np.copyto(found, _polynomial(piece, w - knot), where=w >= knot)
            return found
        at = np.searchsorted(self.knots, w, side="right") - 1
        x = w - self.knots[np.maximum(at, 0)]
        return np.where(at >= 0, _polynomial(np.moveaxis(coefficients[np.maximum(at, 0)], -1, 0), x), 0.0)


def _polynomial(coefficients: Sequence[float] | Array, x: Array) -> Array:
    result = coefficients[-1] + np.zeros_like(x)
    for row in coefficients[-2::-1]:
        result *= x
        result += row
    return np.asarray(result)


def _corners(w: Array, p: Array, q: Array) -> Array:
    """The variable at a pixel's corners `[4, N]`."""
    diagonal, other = p + q, p - q
    return np.stack([w + diagonal, w + other, w - other, w - diagonal])


def _difference(values: Array) -> Array:
    """The second difference `[N]` of values at the corners `[4, N]`."""
    return np.asarray(values[0] - values[1] - values[2] + values[3])


def _integrate(knots: Array, coefficients: Array) -> Array:
    """Antiderivative, 0 at the first knot and continuous, as polynomials between the same knots."""
    degree = np.arange(1, coefficients.shape[1] + 1)
    result = np.concatenate([np.zeros((len(knots), 1)), coefficients / degree], axis=1)
    for i in range(1, len(knots)):
        result[i, 0] = np.polyval(result[i - 1, ::-1], knots[i] - knots[i - 1])
    return result
