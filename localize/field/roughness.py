"""The albedo beyond the modes: noise whose size depends on the place and that neighbouring bins share.

A fundus is smooth between its vessels, and the modes cannot follow a vessel or the rim of the disc. So the rest's
variance is measured around every bin; where it is large the bins count for little.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from conespot.localize.field.settings import FIELD
from conespot.localize.model.residual import rest

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Roughness:
    """The log albedo beyond the modes in one channel."""

    scatter: float = FIELD.scatter  #: rms where nothing special is
    area: float = 1.0  #: bins that share their rest

    def measured(
        self, residual: Array, sensor: Array, use: NDArray[np.bool_], lit: NDArray[np.bool_]
    ) -> tuple[Roughness, Array]:
        """What residuals `[h, w]` with the sensor's variances show in the bins to `use`; the rest's variances `[h, w]`.

        What is left of longer waves belongs to the modes, and is taken off before anything is measured.
        """
        size = (FIELD.near, FIELD.near)
        trust = use / (sensor + self.scatter**2)
        high = residual - cv2.blur(trust * residual, size) / np.maximum(cv2.blur(trust, size), 1e-9)
        high = np.where(use, high, 0.0)
        scatter = rest(high[lit], sensor[lit], self.scatter) if np.count_nonzero(lit) > 30 else self.scatter
        excess = np.where(use, np.minimum(np.square(high), FIELD.largest_excess) - sensor, 0.0)
        near = FIELD.near**2 * cv2.blur(np.stack([excess, use.astype(float)], axis=2), size)
        local = (near[..., 0] + FIELD.elsewhere * scatter**2) / (near[..., 1] + FIELD.elsewhere)
        local = np.maximum(local, FIELD.least_local * scatter**2)
        return Roughness(scatter, _shared(np.where(lit, high / np.sqrt(sensor + local), 0.0), lit)), local

    def variance(self, local: Array) -> Array:
        """What bins with the `local` variance of the rest count for, as if none shared it with a neighbour."""
        return local * self.area


def _shared(residuals: Array, lit: NDArray[np.bool_]) -> float:
    """How many bins share one rest: the sum of whitened residuals' autocorrelation over all distances [bins].

    Up to where it first is no longer positive: the modes, and the mean that was taken off, have what is longer, and
    leave waves that are turned round. A sum of n such bins has this many times the variance of n that share nothing.
    """
    residuals = np.where(lit, np.clip(residuals, -FIELD.largest_shared, FIELD.largest_shared), 0.0)
    if np.count_nonzero(lit) < 2 * FIELD.near**2:
        return 1.0
    reach = FIELD.near
    box = tuple(slice(at[0], at[-1] + 1) for at in (np.flatnonzero(lit.any(axis=axis)) for axis in (1, 0)))
    residuals, lit = residuals[box], lit[box]
    shape = tuple(scipy.fft.next_fast_len(side + reach, real=True) for side in lit.shape)
    products, pairs = (
        scipy.fft.irfft2(np.square(np.abs(scipy.fft.rfft2(plane, shape))), shape)[:reach, :reach]
        for plane in (residuals.astype(np.float32), lit.astype(np.float32))
    )
    distance = np.hypot(*np.mgrid[:reach, :reach])
    ring = np.round(distance).astype(np.intp).ravel()
    many = np.bincount(ring, np.maximum(pairs, 0.0).ravel())[:reach]
    mean = np.bincount(ring, products.ravel())[:reach] / np.maximum(many, 1.0)
    correlation = mean / max(float(mean[0]), 1e-12)
    end = int(np.argmax(correlation <= 0.0)) or reach
    bins = 2.0 * np.pi * np.arange(reach)  # of a ring
    return 1.0 + float(np.sum(bins[1:end] * correlation[1:end]))
