"""What a window's residuals say of a soft fit's covariance: how far bins err together, wave by wave.

The estimate is linear in the log light. With the modes of the albedo eliminated, the gradient by the parameters is the
sum over bins of J W (y - modes), where J is what of the Jacobian the modes do not imitate and W the bins' weights. Its
covariance, the middle of a sandwich (P. J. Huber, Proc. Fifth Berkeley Symposium 1, 1967; H. White, Econometrica 48,
1980), has two parts.

The albedo that the modes stand for leaks through J W, since they are held by their prior: with the spectrum D that the
frame has taught that is the sum over waves k of D(k) F(k) F(k)*, with F the transform of J W. A window's modes know no
wave that is longer than it; the spectrum does.

The rest is the albedo beyond the modes and the sensor's noise. Were it white and W its inverse variance, its part were
the sum of J W J. It is neither, since neighbouring bins share a vessel. With residuals u, whitened by W, whose power
spectrum is S, it is the sum over k of S(k) Z(k) Z(k)*, with Z the transform of J W^1/2: the same as the sum over all
pairs of bins of J W^1/2 of the one, the autocovariance of u, and W^1/2 J of the other (T. Conley, J. Econometrics 92,
1999). So bins count as the effective number of them does. S is measured on the residuals, a mean over rings of |k|,
over what the same fit leaves of white noise: modes and pose take part of every wave, and more of the longer ones.
"""

from __future__ import annotations

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from conespot.localize.field.albedo import Modes
from conespot.localize.field.settings import FIELD

Array = NDArray[np.float64]
Waves = NDArray[np.complex64] | NDArray[np.complex128]
#: rings of |k| from the finest mode to the finest wave that bins show, in steps of equal ratio
_RINGS = 6


def albedo_scatter(rows: Array, modes: Modes, amplitudes: Array) -> Array:
    """Covariance of the gradient `[P, P]` that the albedo makes; `rows` `[P, h, w]` are J W."""
    shape = _shape(rows)
    density = modes.density(shape, amplitudes)
    columns = density.shape[1]  # the other waves are finer than the modes
    waves = scipy.fft.fft(scipy.fft.rfft(rows.astype(np.float32), shape[1])[..., :columns], shape[0], axis=1)
    density *= _twice(shape)[:columns]
    return _products(waves, density) / (shape[0] * shape[1] * modes.bin_mm**2)


def rest_scatter(rows: Array, residuals: Array, white: Array) -> Array:
    """Covariance of the gradient `[P, P]` that the rest makes; `rows` `[P, h, w]` are J W^1/2, `residuals` `[h, w]` u.

    `white` `[D, h, w]` are what the fit leaves of white noise. Bins count for the spectrum as they do for the fit, by
    their leverage: beside the patch noise is another.
    """
    flat = rows.reshape(len(rows), -1)
    products = flat @ flat.T
    scale = np.sqrt(np.maximum(np.diag(products), 1e-300))
    values, vectors = np.linalg.eigh(products / np.multiply.outer(scale, scale))
    able = values > 1e-9 * values.max()
    unit = (vectors[:, able] / np.sqrt(values[able]) / scale[:, None]).T @ flat
    leverage = np.einsum("ij,ij->j", unit, unit)
    shape = _shape(rows)
    ring, twice = _rings(shape), _twice(shape)
    weighted = np.empty((1 + len(white), *residuals.shape), np.float32)
    np.multiply(np.sqrt(leverage).reshape(residuals.shape), residuals, out=weighted[0], casting="same_kind")
    np.multiply(np.sqrt(leverage).reshape(residuals.shape), white, out=weighted[1:], casting="same_kind")
    each = twice * np.square(np.abs(scipy.fft.rfft2(weighted, shape)))
    power = [np.bincount(ring.ravel(), plane.ravel(), minlength=_RINGS + 1) for plane in each]
    spectrum = power[0] / np.maximum(np.mean(power[1:], axis=0), 1e-300)
    waves = scipy.fft.rfft2(rows.astype(np.float32), shape)
    return _products(waves, spectrum[ring] * twice) / (shape[0] * shape[1])


def _products(waves: Waves, weights: Array) -> Array:
    """Sums over the waves of the products of transforms `[P, h, w]`, each counted by `weights` `[h, w]`: `[P, P]`."""
    each = (waves * np.sqrt(weights)).reshape(len(waves), -1).view(np.float64)  # real and imaginary parts
    return np.asarray(each @ each.T)


def _shape(rows: Array) -> tuple[int, int]:
    """Of a transform with zeros around, or what leaves a side of the window would come back at the other.

    As many as the longest wave has bins that is not the modes'.
    """
    around = 2 * FIELD.bins_a_mode
    height, width = (int(scipy.fft.next_fast_len(side + around, real=True)) for side in rows.shape[1:])
    return height, width


def _twice(shape: tuple[int, int]) -> Array:
    """How often each wave of a real transform counts `[w]`: half of them are not there, for they mirror the others."""
    twice = np.full(shape[1] // 2 + 1, 2.0)
    twice[0] = 1.0
    if shape[1] % 2 == 0:
        twice[-1] = 1.0
    return twice


def _rings(shape: tuple[int, int]) -> NDArray[np.intp]:
    """The ring of |k| of each wave of a real transform: 0 is as coarse as the modes."""
    k = np.hypot(scipy.fft.fftfreq(shape[0])[:, None], scipy.fft.rfftfreq(shape[1]))  # [cycles per bin]
    steps = np.geomspace(0.5 / FIELD.bins_a_mode, 0.5, _RINGS)
    return np.asarray(np.searchsorted(steps, k.ravel(), side="right").reshape(k.shape))
