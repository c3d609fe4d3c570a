"""Sums over the bins of strips, and what they leave once each strip's own level and slope are eliminated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.strips import Strips

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Moments:
    """Sums over the strips of weighted products of columns: rows of a Jacobian, a level, what varies slowly, and data.

    Rows and data alone are looked at bin by bin: within a strip, all else is one of its own quantities.
    """

    strips: Strips
    rows: Array  #: `[R, N]`
    weighted: Array  #: rows and residuals, times the bins' weights `[R + 1, N]`
    levels: Array  #: of the strips' own in the data, beside the residuals `[2 or 3, S]`
    own: Array  #: products of the strips' own quantities `[2 or 3, 2 or 3, S]`
    right: Array  #: of those with all columns `[2 or 3, P + 1, S]`
    kinds: NDArray[np.intp]  #: which of its own quantities a strip has of each column but the rows and the data `[Q]`
    amounts: Array  #: and how much of it `[Q, S]`

    @classmethod
    def of(cls, strips: Strips, rows: Array, residual: Array, weights: Array, levels: Array) -> Moments:
        """Of rows `[R, N]`, weights `[N]`, and data: residuals `[N]` beside levels, slopes and odds `[S, 2 or 3]`."""
        weighted = np.concatenate([rows, residual[None]]) * weights
        columns, size = strips.own, len(weighted)
        sums = strips.sums(np.concatenate([weighted, weights * columns, *(weighted * own for own in columns[1:])]))
        # the first is 1 throughout
        right = np.stack([sums[:size], *sums[size + len(columns) :].reshape(-1, size, strips.count)])
        each = np.empty((len(columns), len(columns), strips.count))
        each[0] = sums[size : size + len(columns)]
        each[1:, 0] = each[0, 1:]
        for k in range(1, len(columns)):
            each[k, k:] = strips.sums(weights * columns[k] * columns[k:])
            each[k:, k] = each[k, k:]
        slow, amounts = strips.slow
        kinds, amounts = np.append(0, slow), np.concatenate([np.ones((1, strips.count)), amounts])
        data = right[:, -1:] + np.einsum("kls,sl->ks", each, levels)[:, None]
        every = np.concatenate([right[:, :-1], each[:, kinds] * amounts, data], axis=1)
        return cls(strips, rows, weighted, levels.T, each, every, kinds, amounts)

    def total(self) -> Array:
        """Products of all columns and the data with all columns, over all strips `[P + 1, P]`."""
        size = len(self.rows)
        found = np.empty((self.right.shape[1], self.right.shape[1] - 1))
        found[:, size:] = (self.right[self.kinds] @ self.amounts[..., None])[..., 0].T
        found[size:-1, :size] = found[:size, size:].T
        found[[*range(size), -1], :size] = self.weighted @ self.rows.T
        found[-1, :size] += np.tensordot(self.levels, self.right[:, :size], ([0, 1], [0, 2]))
        return found

    def each(self) -> Array:
        """The same strip by strip `[P + 1, P, S]`."""
        size, strips = len(self.rows), self.strips
        found = np.empty((self.right.shape[1], self.right.shape[1] - 1, strips.count))
        found[:, size:] = (self.right[self.kinds] * self.amounts[:, None]).transpose(1, 0, 2)
        found[size:-1, :size] = found[:size, size:].transpose(1, 0, 2)
        for k, row in enumerate(self.rows):
            found[k:size, k] = found[k, k:size] = strips.sums(self.weighted[k:-1] * row)
            found[-1, k] = strips.sums(self.weighted[-1] * row)
        found[-1, :size] += np.einsum("ks,kps->ps", self.levels, self.right[:, :size])
        return found

    def solved(self, spread: Array) -> tuple[Array, Array]:
        """Each strip's own for every column `[2 or 3, P + 1, S]`, and their variances; `spread` are prior sigmas."""
        if len(self.own) > 2:
            covariance = np.linalg.inv(self.own.transpose(2, 0, 1) + np.diag(spread**-2))
            return np.einsum("sij,jps->ips", covariance, self.right), np.einsum("sii->is", covariance)
        a, b, d = self.own[0, 0] + spread[0] ** -2, self.own[0, 1], self.own[1, 1] + spread[1] ** -2
        det = a * d - b * b
        flat, sloped = self.right
        return np.stack([d * flat - b * sloped, a * sloped - b * flat]) / det, np.stack([d, a]) / det


@dataclass(frozen=True)
class Eliminated:
    """Normal equations with every strip's level and slope, and its odds if it has any, eliminated."""

    information: Array  #: `[P, P]`
    gradient: Array  #: `[P]`
    own: Array  #: by the parameters and, last, without a step: how levels, slopes and odds change `[2 or 3, P + 1, S]`
    variance: Array  #: of levels, slopes and odds `[2 or 3, S]`

    def levels(self, step: Array) -> Array:
        """Level, slope and odds of every strip `[S, 2 or 3]` after `step` `[P]`."""
        return np.asarray((np.append(-step, 1.0) @ self.own).T)

    @classmethod
    def of(cls, moments: Moments, spread: Array) -> Eliminated:
        """Of parameters in the order of the moments' columns; `spread` `[2 or 3]`: prior sigmas of the strips' own."""
        own, variance = moments.solved(spread)
        size = own.shape[1] - 1
        cross = np.tensordot(moments.right, own[:, :size], ([0, 2], [0, 2]))
        left = moments.total() - cross
        return cls(left[:size], left[size], own, variance)


def strip_scores(moments: Moments, spread: Array) -> tuple[Array, Array]:
    """Each strip's own gradient `[P, S]` and information `[P, P, S]`, its level, slope and odds eliminated.

    As `Eliminated.of` has them; the levels of the moments are how far those are off their prior's mean.
    """
    own, _ = moments.solved(spread)
    left = moments.each() - np.einsum("kas,kbs->abs", moments.right, own[:, :-1])
    return left[-1], left[:-1]


def of_shared(parts: Array, reduced: Array) -> Array:
    """The strips' informations `[S, size, size]` from those of all parameters `[P, P, S]`, `reduced` `[size, P]`."""
    left = (reduced @ parts.reshape(len(parts), -1)).reshape(len(reduced), *parts.shape[1:])
    return np.ascontiguousarray((reduced @ left).transpose(2, 0, 1))
