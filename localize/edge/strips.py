"""Strips across an edge: each with an albedo of its own, and what their residuals say about the fit's covariance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WIDTH = 2.0  # of a strip along the outline [bins]
#: harmonics of the outline that the pose changes: what a fit leaves of them says nothing of what they were
_FITTED = 3
#: harmonics above which neighbouring strips err independently; the last: all do
_KNEES = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, np.inf])


@dataclass(frozen=True)
class Strips:
    """Bins sorted by the strip they belong to; no strip is empty."""

    index: NDArray[np.intp]  #: strip of each bin, increasing `[N]`
    offset: Array  #: distance of each bin from the outline, positive outside `[N]` [bins]
    first: NDArray[np.intp]  #: each strip's first bin `[S]`
    turns: tuple[slice, ...]  #: the strips of each outline, in order around it
    #: how the log light changes with the log odds of the light from under the retina `[N]`, where there is any: a strip
    #: has odds of its own, since what lies before the pigment reflects and what lies behind it are not one albedo
    odds: Array | None = None
    sloping: bool = False  #: whether the edge is a slope rather than a step

    @property
    def count(self) -> int:
        """How many strips there are."""
        return len(self.first)

    def sums(self, values: Array) -> Array:
        """Sums over the strips `[..., S]` of values of the bins `[..., N]`."""
        return np.asarray(np.add.reduceat(values, self.first, axis=-1))

    @property
    def slow(self) -> Array:
        """What varies with harmonics 0 to 2 around each outline, the pose's, at each bin: slopes, levels and odds.

        `[5 T, N]`, along a slope `[10 T, N]` and with odds `[15 T, N]`. Without them a step in the light is so high
        that what a prior of strips which know nothing of each other leaves of smooth levels moves no edge. A slope it
        moves: to such a prior one wave of levels is as unlikely as noise of their size, and a turned axis likelier.
        """
        if not self.slow_levels:
            return self._slow_slopes
        levels = self.waves[:, self.index]
        if self.odds is None:
            return np.concatenate([self._slow_slopes, levels])
        return np.concatenate([self._slow_slopes, levels, levels * self.odds])

    @property
    def slow_levels(self) -> int:
        """How many quantities beside the slopes vary slowly: none, levels, or levels and odds."""
        return int(self.sloping) if self.odds is None else 2

    @cached_property
    def _slow_slopes(self) -> Array:
        return np.asarray(self.waves[:, self.index] * self.offset)

    def gradient(self, levels: Array) -> float:
        """Rms by which levels `[S]` of width `WIDTH` change along the outlines [1/bin]."""
        steps = np.concatenate([np.diff(levels[turn]) for turn in self.turns])
        return float(np.sqrt(np.mean(np.square(steps)))) / WIDTH

    @cached_property
    def waves(self) -> Array:
        """Harmonics 0 to 2 around each outline at every strip `[5 T, S]`."""
        waves = np.zeros((5 * len(self.turns), self.count))
        for number, turn in enumerate(self.turns):
            waves[5 * number : 5 * number + 5, turn] = _harmonics(turn.stop - turn.start)
        return waves

    @property
    def around(self) -> Array:
        """The same, of all outlines alike `[5, S]`."""
        return np.asarray(self.waves.reshape(len(self.turns), 5, -1).sum(axis=0))

    def slow_gradient(self, levels: Array) -> float:
        """Rms by which levels `[S]` of width `WIDTH` change slowly along the outlines, of one wave [1/bin]."""
        found = []
        for turn in self.turns:
            count = turn.stop - turn.start
            waves = np.abs(np.fft.rfft(levels[turn]))[1:4] * (2.0 / count)
            rise = waves * np.arange(1, len(waves) + 1) * (2.0 * np.pi / (count * WIDTH))
            found.append(float(np.mean(np.square(rise)) / 2.0))
        return float(np.sqrt(np.mean(found)))

    def log_albedo(self, levels: Array) -> Array:
        """What the strips' own `[S, 2 or 3]`, level, slope and odds, do to the log light of each bin `[N]`."""
        found = levels[self.index, 0] + levels[self.index, 1] * self.offset
        return np.asarray(found if self.odds is None else found + levels[self.index, 2] * self.odds)


@lru_cache(maxsize=64)
def _harmonics(count: int) -> Array:
    """Harmonics 0 to 2 at so many strips around an outline `[5, count]`."""
    angle = np.arange(count) * (2.0 * np.pi / count)
    return np.stack([np.ones(count), *(wave(m * angle) for m in (1, 2) for wave in (np.cos, np.sin))])


@dataclass(frozen=True)
class Eliminated:
    """Normal equations with every strip's level and slope, and its odds if it has any, eliminated."""

    information: Array  #: `[P, P]`
    gradient: Array  #: `[P]`
    start: Array  #: levels, slopes and odds without a step `[S, 2 or 3]`
    gain: Array  #: and how the parameters change them `[S, 2 or 3, P]`
    variance: Array  #: of levels, slopes and odds `[S, 2 or 3]`

    def levels(self, step: Array) -> Array:
        """Level, slope and odds of every strip `[S, 2 or 3]` after `step` `[P]`."""
        return np.asarray(self.start - self.gain @ step)

    @classmethod
    def of(cls, strips: Strips, jacobian: Array, data: Array, weights: Array, spread: Array) -> Eliminated:
        """From a Jacobian `[P, N]`, data and weights `[N]`; `spread` `[2 or 3]`: prior sigmas of the strips' own."""
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
    """Sums of weighted columns `[2, P, S]`, the same solved for level and slope, and those' variances `[S, 2]`.

    With odds of their own strips have three of all.
    """
    if strips.odds is not None:
        own = np.stack([np.ones_like(strips.offset), strips.offset, strips.odds])
        system = strips.sums(own * (weights * own)[:, None]).transpose(2, 0, 1) + np.diag(spread**-2)
        right = np.stack([strips.sums(weighted * column) for column in own])
        covariance = np.linalg.inv(system)
        solved = np.einsum("sij,jps->ips", covariance, right)
        return right, solved, np.einsum("sii->si", covariance)
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
    """Each strip's own gradient `[S, P]` and information `[S, P, P]`, its level, slope and odds eliminated.

    `levels` `[S, 2 or 3]` are how far those are off their prior's mean.
    """
    weighted = np.concatenate([jacobian, (residual + strips.log_albedo(levels))[None]]) * weights
    right, solved, _ = _strip_equations(strips, weighted, weights, spread)
    size = len(jacobian)
    gradient = strips.sums(jacobian * weighted[size]) - np.einsum("cps,cs->ps", right[:, :size], solved[:, size])
    squares = np.stack([strips.sums(jacobian * row) for row in weighted[:size]])
    information = squares - np.einsum("cps,cqs->pqs", right[:, :size], solved[:, :size])
    return gradient.T, np.moveaxis(information, 2, 0)


def score_covariance(strips: Strips, scores: Array, parts: Array) -> Array:
    """Covariance `[P, P]` of the sum of the strips' gradients `[S, P]`, estimated from what they are.

    A strip knows first of all how far its edge is displaced, then how wide it is: the principal directions of its
    information, one of `parts` `[S, P, P]`. What it says in each over its own sigma is a series around the outline,
    whose power in each harmonic tells how far neighbours err together.
    """
    if not (np.isfinite(parts).all() and np.isfinite(scores).all()):
        return np.full_like(parts[0], np.inf)  # a bin that looks past the wall or the lens is no witness
    scale = np.sqrt(np.maximum(np.einsum("spp->p", parts), 1e-300))
    values, vectors = np.linalg.eigh(parts / np.outer(scale, scale))
    values = np.maximum(values, 1e-12 * values.max())
    total = np.zeros_like(parts[0])
    for turn in strips.turns:
        size, along = np.sqrt(values[turn]), np.array(vectors[turn])
        # directions have no sign of their own: neighbours' are alike
        turned = np.einsum("spj,spj->sj", along[1:], along[:-1]) < 0.0
        along[1:] *= np.cumprod(np.where(turned, -1.0, 1.0), axis=0)[:, None]
        power = _power(np.einsum("sp,spj->js", scores[turn] / scale, along) / size.T)
        waves = np.fft.rfft(along * size[:, None], axis=0) * np.sqrt(power).T[:, None]
        total += np.real(np.einsum("mpj,mqj->pq", waves, waves.conj())) / len(size)
    return np.asarray(total * np.outer(scale, scale))


def _power(series: Array) -> Array:
    """The power spectra of series around the outline `[D, n]` at `[D, n // 2 + 1]` harmonics, smooth in frequency.

    1 for independent values of sigma 1; both signs of a frequency count. White noise and a part that falls above some
    frequency, as what an albedo does to edges does: the mean over such spectra, each by its likelihood (Whittle's).
    """
    count = series.shape[1]
    harmonic = np.arange(count // 2 + 1)
    twice = np.where((harmonic == 0) | (2 * harmonic == count), 1.0, 2.0)
    raw = np.square(np.abs(np.fft.rfft(series))) / count + 1e-12
    # a handful of frequencies tells as much as all of them
    edges = np.unique(np.geomspace(_FITTED, len(harmonic), 24).astype(int))
    if len(edges) < 5:
        return np.tile(twice, (len(series), 1))
    number = np.diff(edges)
    observed = (np.add.reduceat(raw[:, : edges[-1]], edges[:-1], axis=1) / number)[:, None]
    middle = 0.5 * (edges[1:] + edges[:-1] - 1)
    shape = 1.0 / (1.0 + np.square(middle / _KNEES[:, None]))
    both = np.stack([np.ones_like(shape), shape])[:, None]
    amounts = 0.5 * observed.mean(axis=2) / both.mean(axis=3)
    for _ in range(20):
        model = np.einsum("adk,akb->dkb", amounts, both[:, 0])
        weight = number / np.square(model)
        amounts = amounts * (weight * observed * both).sum(axis=3) / (weight * model * both).sum(axis=3)
    cost = np.sum(number * (np.log(model) + observed / model), axis=2)
    # before any frame is seen, that strips err alone is as likely as all knees together; and a second parameter has
    # to be worth what it can fit of noise (Schwarz, Estimating the dimension of a model, Annals of Statistics 6, 1978)
    cost = cost + np.isfinite(_KNEES) * (0.5 * np.log(number.sum()) + np.log(len(_KNEES) - 1.0))
    share = np.exp(cost.min(axis=1, keepdims=True) - cost)
    white, red = amounts * share / share.sum(axis=1, keepdims=True)
    smooth = white.sum(axis=1)[:, None] + red @ (1.0 / (1.0 + np.square(harmonic / _KNEES[:, None])))
    return np.asarray(twice * np.maximum(smooth, 1e-9))
