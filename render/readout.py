"""The EMVA 1288 camera at work: response-weighted radiance becomes electrons, noise and digital numbers.

The noise of a pixel is a function of the seed, its row and its column alone: each row has a stream of its own that
always starts at the frame's first column, so a crop repeats exactly what the full frame holds there.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.render.fixed_pattern import unevenness
from conespot.scene.emva import Emva

#: below this mean [e-] the Poisson distribution is inverted exactly; above, its skewness-corrected normal form is
#: within 0.2 % of a standard deviation
_EXACT_BELOW = 30.0
#: the inversion is tabulated at means of 2^-12 e- on, so many an octave, and interpolated; below nothing is counted
_FAINTEST = -12.0
_PER_OCTAVE = 64
#: rows worked on at once: bounds the memory
_BAND = 128


def expose(
    signal: NDArray[np.float32], sensor: Emva, seed: int, row: int = 0, column: int = 0
) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """Raw pixel values `[h, w]` [DN] of signals `[h, w, C]` [A m-2 sr-1] whose first pixel is (row, column).

    A sensor of several channels sees one of them in each pixel (RGGB, counted from the frame's first pixel).
    """
    values = np.empty(signal.shape[:2], np.uint8 if sensor.full_scale <= 255 else np.uint16)
    for first in range(0, len(signal), _BAND):
        band = mosaic(signal[first : first + _BAND], row + first, column)
        mean = band.astype(np.float32) * np.float32(sensor.electrons_per_signal)
        uneven = None
        if sensor.fixed_pattern is not None:
            uneven = unevenness(sensor.fixed_pattern, row + first, column, (len(band), band.shape[1]))
            mean = mean * uneven.response + uneven.dark_current * np.float32(sensor.exposure_time)
        mean += np.float32(sensor.dark_current * sensor.exposure_time)
        shot, read = normal_pairs(seed, row + first, column, mean.shape)
        electrons = np.minimum(poisson(mean, shot), np.float32(sensor.full_well))
        if uneven is not None:
            electrons += uneven.offset
        digital = np.float32(sensor.gain) * (electrons + np.float32(sensor.read_noise) * read)
        digital += np.float32(sensor.black_level + 0.5)
        values[first : first + _BAND] = np.clip(np.floor(digital), 0, sensor.full_scale)
    return values


def mosaic(signal: NDArray[Any], row: int, column: int) -> NDArray[Any]:
    """The channel `[h, w]` that each pixel of `[h, w, C]` sees: the only one, or the Bayer pattern RGGB."""
    if signal.shape[-1] == 1:
        return signal[..., 0]
    plane = signal[..., 1].copy()
    plane[row % 2 :: 2, column % 2 :: 2] = signal[row % 2 :: 2, column % 2 :: 2, 0]
    plane[1 - row % 2 :: 2, 1 - column % 2 :: 2] = signal[1 - row % 2 :: 2, 1 - column % 2 :: 2, 2]
    return plane


def demosaic(raw: NDArray[Any]) -> NDArray[Any]:
    """Colours `[H, W, 3]` (red, green, blue) of a full raw frame `[H, W]`, interpolated linearly."""
    return np.asarray(cv2.cvtColor(raw, cv2.COLOR_BayerRGGB2RGB))


def normal_pairs(
    seed: int, row: int, column: int, shape: tuple[int, ...]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Two independent standard normal deviates for each pixel of a crop `shape` = (h, w), repeatable per pixel."""
    height, width = shape
    pairs = np.empty((height, 2 * (column + width)), np.float32)
    for i in range(height):
        stream = np.random.Philox(key=seed % 2**64, counter=[0, 0, 0, row + i])
        np.random.Generator(stream).standard_normal(dtype=np.float32, out=pairs[i])
    crop = pairs.reshape(height, -1, 2)[:, column:]
    return crop[..., 0], crop[..., 1]


def poisson(mean: NDArray[np.float32], normal: NDArray[np.float32]) -> NDArray[np.float32]:
    """Poisson counts of `mean` as the quantiles that standard normal deviates stand for, any shape."""
    skewed = mean + np.sqrt(mean) * normal + (normal * normal - 1.0) / 6.0
    counts = np.maximum(np.rint(skewed), 0.0).astype(np.float32)
    low = np.flatnonzero(mean < _EXACT_BELOW)
    if len(low):
        counts.ravel()[low] = _inverted(mean.ravel()[low], normal.ravel()[low], counts.ravel()[low])
    return counts


def _inverted(mean: NDArray[np.float32], normal: NDArray[np.float32], near: NDArray[np.float32]) -> NDArray[np.int64]:
    """The smallest counts `[N]` whose cumulative Poisson probability reaches that of the deviates; `near` them."""
    table = _thresholds()
    count = np.minimum(near, table.shape[1] - 2).astype(np.int64)
    octave = np.log2(np.maximum(mean, np.float32(2.0**_FAINTEST)))
    position = (octave - np.float32(_FAINTEST)) * np.float32(_PER_OCTAVE)
    row = position.astype(np.int64)
    share = position - row
    first = row * table.shape[1]
    flat = table.ravel()

    def threshold(at: NDArray[np.int64], k: NDArray[np.int64]) -> NDArray[np.float32]:
        low = first[at] + k
        return flat[low] + share[at] * (flat[low + table.shape[1]] - flat[low])

    open_ = np.arange(len(count))
    while len(open_):  # up to where the threshold is reached
        k = count[open_]
        open_ = open_[(normal[open_] > threshold(open_, k)) & (k < table.shape[1] - 2)]
        count[open_] += 1
    open_ = np.flatnonzero(count > 0)
    while len(open_):  # and down while the one below reaches it too
        open_ = open_[normal[open_] <= threshold(open_, count[open_] - 1)]
        count[open_] -= 1
        open_ = open_[count[open_] > 0]
    count[mean < 2.0**_FAINTEST] = 0
    return count


@functools.cache
def _thresholds() -> NDArray[np.float32]:
    """The largest deviate that stands for at most k electrons, for means of up to `_EXACT_BELOW` `[means, k]`."""
    from scipy.special import ndtri, pdtr, pdtrc  # every process of a campaign would wait for it

    octaves = math.log2(_EXACT_BELOW) - _FAINTEST
    means = 2.0 ** (_FAINTEST + np.arange(math.ceil(octaves * _PER_OCTAVE) + 2)[:, None] / _PER_OCTAVE)
    counts = np.arange(100)
    # the upper tail keeps its digits where the cumulative probability is rounded to 1
    below, above = pdtr(counts, means), pdtrc(counts, means)
    z = np.where(below < 0.5, ndtri(below), -ndtri(above))
    return np.asarray(np.clip(z, -40.0, 40.0), np.float32)


def metered_time(lit: NDArray[np.float32], sensor: Emva) -> float:
    """The exposure time [s] that `sensor.metering` asks for, from the signals of the pixels that light reaches.

    `lit` `[..., C]` [A m-2 sr-1]; the brightest channel counts. The time stays within 1 us to 10 s.
    """
    if sensor.metering is None or lit.size == 0:
        return float(sensor.exposure_time)
    brightest = lit.max(axis=-1)
    signal = float(np.percentile(brightest, sensor.metering.percentile))
    rate = signal * sensor.electrons_per_signal / sensor.exposure_time + sensor.dark_current
    wanted = sensor.metering.level * sensor.saturation
    return float(np.clip(wanted / rate, 1e-6, 10.0)) if rate > 0.0 else 10.0
