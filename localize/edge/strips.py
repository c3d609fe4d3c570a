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
#: harmonics above which what neighbouring strips share falls, with their square, and with their fourth power
_KNEES = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])
_STEEP = np.array([1.0, 2.0, 4.0, 8.0])


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

    @property
    def count(self) -> int:
        """How many strips there are."""
        return len(self.first)

    def sums(self, values: Array) -> Array:
        """Sums over the strips `[..., S]` of values of the bins `[..., N]`."""
        return np.asarray(np.add.reduceat(values, self.first, axis=-1))

    @cached_property
    def own(self) -> Array:
        """What a strip's own level, slope and odds, if it has any, do to the log light of its bins `[2 or 3, N]`."""
        return np.stack([np.ones_like(self.offset), self.offset, *([] if self.odds is None else [self.odds])])

    @cached_property
    def slow(self) -> tuple[NDArray[np.intp], Array]:
        """What varies with harmonics 0 to 2 around each outline, the pose's: slopes, levels and odds.

        Which of a strip's own quantities each is `[Q]`, and how much of it the strips have `[Q, S]`: `10 T` of them,
        with odds `15 T`. To a prior of strips which know nothing of each other one wave of levels is as unlikely as
        noise of their size, and a turned axis likelier: it left a part of a living retina's smooth levels to the edge.
        """
        kinds = np.array([1, 0, 2][: 1 + self.slow_levels], np.intp)
        return np.repeat(kinds, len(self.waves)), np.tile(self.waves, (len(kinds), 1))

    @property
    def slow_levels(self) -> int:
        """How many quantities beside the slopes vary slowly: levels, or levels and odds."""
        return 1 if self.odds is None else 2

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

    def log_albedo(self, levels: Array, slow: Array) -> Array:
        """What levels, slopes and odds, strips' own `[S, 2 or 3]` and `slow` ones `[Q]`, do to the log light `[N]`."""
        kinds, amounts = self.slow
        own = levels.copy()
        for kind in set(kinds.tolist()):
            own[:, kind] += (slow * (kinds == kind)) @ amounts
        return np.asarray(np.einsum("kn,kn->n", self.own, own.T.take(self.index, axis=1)))


@lru_cache(maxsize=64)
def _harmonics(count: int) -> Array:
    """Harmonics 0 to 2 at so many strips around an outline `[5, count]`."""
    angle = np.arange(count) * (2.0 * np.pi / count)
    return np.stack([np.ones(count), *(wave(m * angle) for m in (1, 2) for wave in (np.cos, np.sin))])


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
        each = np.ascontiguousarray(waves.transpose(1, 0, 2)).reshape(len(total), -1).view(np.float64)
        total += each @ each.T / len(size)
    return np.asarray(total * np.outer(scale, scale))


@lru_cache(maxsize=64)
def _edges(count: int) -> NDArray[np.intp]:
    """The first of the harmonics that are taken together, of so many."""
    return np.unique(np.geomspace(_FITTED, count, 24).astype(np.intp))


def _power(series: Array) -> Array:
    """The power spectra of series around the outline `[D, n]` at `[D, n // 2 + 1]` harmonics, smooth in frequency.

    1 for independent values of sigma 1; both signs of a frequency count. White noise and a part that falls, as what an
    albedo does to edges does: the mean over such spectra, each by its likelihood (Whittle's).
    """
    count = series.shape[1]
    harmonic = np.arange(count // 2 + 1)
    twice = np.where((harmonic == 0) | (2 * harmonic == count), 1.0, 2.0)
    raw = np.square(np.abs(np.fft.rfft(series))) / count + 1e-12
    # a handful of frequencies tells as much as all of them
    edges = _edges(len(harmonic))
    if len(edges) < 5:
        return np.tile(twice, (len(series), 1))
    number = np.diff(edges)
    observed = (np.add.reduceat(raw[:, : edges[-1]], edges[:-1], axis=1) / number)[:, None]
    middle = 0.5 * (edges[1:] + edges[:-1] - 1)
    shape = _laws(middle)
    both = np.stack([np.ones_like(shape), shape], axis=1)
    amounts = 0.5 * observed.mean(axis=2)[..., None] / both.mean(axis=2)
    sides = np.empty((*amounts.shape[:2], 2, len(number)))  # what is seen, and the model, weighed by that
    for _ in range(20):
        model = (amounts[:, :, None] @ both)[:, :, 0]
        np.divide(number, model, out=sides[:, :, 1])
        np.multiply(sides[:, :, 1], observed / model, out=sides[:, :, 0])
        seen, expected = np.moveaxis(sides @ both.transpose(0, 2, 1), 2, 0)
        amounts = amounts * seen / expected
    cost = np.sum(number * (np.log(model) + observed / model), axis=2)
    # before any frame is seen, that strips err alone is as likely as all laws together; and a second parameter has
    # to be worth what it can fit of noise (Schwarz, Estimating the dimension of a model, Annals of Statistics 6, 1978)
    cost[:, :-1] += 0.5 * np.log(number.sum()) + np.log(len(shape) - 1.0)
    share = np.exp(cost.min(axis=1, keepdims=True) - cost)
    white, red = np.moveaxis(amounts, 2, 0) * share / share.sum(axis=1, keepdims=True)
    # a law that is seen from the third harmonic on tells nothing of how much more the mean has than the first one
    smooth = white.sum(axis=1)[:, None] + red @ _laws(np.maximum(harmonic, 1))
    return np.asarray(twice * np.maximum(smooth, 1e-9))


def _laws(harmonic: NDArray[np.generic]) -> Array:
    """How the power that neighbouring strips share may fall with the `harmonic` `[M]`; the last, not at all `[L, M]`.

    A smooth albedo's falls so steeply that the harmonics which the fit takes away have most of it.
    """
    squared = 1.0 / (1.0 + np.square(harmonic / _KNEES[:, None]))
    fourth = 1.0 / np.square(1.0 + np.square(harmonic / _STEEP[:, None]))
    return np.concatenate([squared, fourth, np.ones((1, len(harmonic)))])
