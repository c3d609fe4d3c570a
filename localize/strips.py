"""Strips across an edge: each with an albedo of its own, and what their residuals say about the fit's covariance."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
#: harmonics of the outline that the pose changes: what a fit leaves of them says nothing of what they were
_FITTED = 3
_KNEES = (2.0, 5.0, 12.0, 30.0)  # harmonics above which neighbouring strips err independently


@dataclass(frozen=True)
class Strips:
    """Bins sorted by the strip they belong to; no strip is empty."""

    index: NDArray[np.intp]  #: strip of each bin, increasing `[N]`
    offset: Array  #: distance of each bin from the outline, positive outside `[N]` [bins]
    first: NDArray[np.intp]  #: each strip's first bin `[S]`
    turns: tuple[slice, ...]  #: the strips of each outline, in order around it

    @property
    def count(self) -> int:
        """How many strips there are."""
        return len(self.first)

    def sums(self, values: Array) -> Array:
        """Sums over the strips `[..., S]` of values of the bins `[..., N]`."""
        return np.asarray(np.add.reduceat(values, self.first, axis=-1))

    def log_albedo(self, levels: Array) -> Array:
        """Level plus slope `[S, 2]` at each bin `[N]`."""
        return np.asarray(levels[self.index, 0] + levels[self.index, 1] * self.offset)


@dataclass(frozen=True)
class Eliminated:
    """Normal equations with every strip's level and slope eliminated."""

    information: Array  #: `[P, P]`
    gradient: Array  #: `[P]`
    start: Array  #: levels and slopes without a step `[S, 2]`
    gain: Array  #: and how the parameters change them `[S, 2, P]`
    variance: Array  #: of levels and slopes `[S, 2]`

    def levels(self, step: Array) -> Array:
        """Level and slope of every strip `[S, 2]` after `step` `[P]`."""
        return np.asarray(self.start - self.gain @ step)

    @classmethod
    def of(cls, strips: Strips, jacobian: Array, data: Array, weights: Array, spread: Array) -> Eliminated:
        """From a Jacobian `[P, N]`, data and weights `[N]`; `spread` `[2]` is the prior sigma of level and slope."""
        weighted = np.concatenate([jacobian, data[None]]) * weights
        right, solved, variance = _strip_equations(strips, weighted, weights, spread)
        cross = np.tensordot(right, solved, ([0, 2], [0, 2]))
        size = len(jacobian)
        normal = weighted @ jacobian.T
        return cls(
            normal[:size] - cross[:size, :size],
            normal[size] - cross[size, :size],
            solved[:, size].T,
            np.moveaxis(solved[:, :size], 2, 0),
            variance,
        )


def _strip_equations(strips: Strips, weighted: Array, weights: Array, spread: Array) -> tuple[Array, Array, Array]:
    """Sums of weighted columns `[2, P, S]`, the same solved for level and slope, and those' variances `[S, 2]`."""
    wo = weights * strips.offset
    a, b, d = strips.sums(np.stack([weights, wo, wo * strips.offset]))
    a, d = a + spread[0] ** -2, d + spread[1] ** -2
    det = a * d - b * b
    right = np.stack([strips.sums(weighted), strips.sums(weighted * strips.offset)])
    solved = np.stack([d * right[0] - b * right[1], a * right[1] - b * right[0]]) / det
    return right, solved, np.stack([d, a], axis=1) / det[:, None]


def strip_scores(
    strips: Strips, jacobian: Array, residual: Array, weights: Array, levels: Array, spread: Array
) -> tuple[Array, Array]:
    """Each strip's own gradient `[S, P]` and information `[S, P, P]`, its level and slope eliminated.

    `levels` `[S, 2]` are how far the strips' level and slope are off their prior's mean.
    """
    weighted = np.concatenate([jacobian, (residual + strips.log_albedo(levels))[None]]) * weights
    right, solved, _ = _strip_equations(strips, weighted, weights, spread)
    size = len(jacobian)
    gradient = strips.sums(jacobian * weighted[size]) - np.einsum("cps,cs->ps", right[:, :size], solved[:, size])
    squares = np.stack([strips.sums(jacobian * row) for row in weighted[:size]])
    information = squares - np.einsum("cps,cqs->pqs", right[:, :size], solved[:, :size])
    return gradient.T, np.moveaxis(information, 2, 0)


def score_covariance(strips: Strips, scores: Array, parts: Array, outward: Array) -> Array:
    """Covariance `[P, P]` of the sum of the strips' gradients `[S, P]`, estimated from what they are.

    A strip knows one thing, how far its edge is displaced. These displacements over their own sigma are a series
    around the outline, whose power in each harmonic tells how far neighbours err together. `parts` `[S, P, P]` are
    the strips' informations, `outward` `[P]` a change of the parameters that widens every outline.
    """
    scale = np.sqrt(np.maximum(np.einsum("spp->p", parts), 1e-300))
    value, vector = np.linalg.eigh(parts / np.outer(scale, scale))
    value, vector = np.maximum(value[:, -1], 0.0), vector[:, :, -1]
    vector = vector * np.where(vector @ (outward * scale) < 0.0, -1.0, 1.0)[:, None]
    share = np.sqrt(value)[:, None] * vector
    series = np.einsum("sp,sp->s", scores / scale, vector) / np.sqrt(np.maximum(value, 1e-12 * value.max()))
    total = np.zeros_like(parts[0])
    for turn in strips.turns:
        power = _power(series[turn])
        waves = np.fft.fft(share[turn], axis=0)
        total += np.real(np.einsum("m,mp,mq->pq", power, waves, waves.conj())) / len(power)
    return np.asarray(total * np.outer(scale, scale))


def _power(series: Array) -> Array:
    """The power spectrum of a series around the outline, 1 for independent values of sigma 1, smooth in frequency."""
    count = len(series)
    harmonic = np.minimum(np.arange(count), count - np.arange(count))
    raw = np.square(np.abs(np.fft.fft(series))) / count
    free = harmonic >= _FITTED
    if np.count_nonzero(free) < 8:
        return np.ones(count)
    # white noise and a part that falls above a frequency, as what an albedo does to edges does (Whittle's likelihood)
    best, found = math.inf, np.ones(count)
    for knee in _KNEES:
        columns = np.stack([np.ones(count), 1.0 / (1.0 + np.square(harmonic / knee))], axis=1)
        amounts = 0.5 * np.mean(raw[free]) / np.mean(columns[free], axis=0)
        for _ in range(20):
            model = columns @ amounts
            weight = columns[free].T / np.square(model[free])
            amounts = amounts * (weight @ raw[free]) / np.maximum(weight @ model[free], 1e-300)
        model = np.maximum(columns @ amounts, 1e-9)
        cost = float(np.sum(np.log(model[free]) + raw[free] / model[free]))
        if cost < best:
            best, found = cost, model
    return found
