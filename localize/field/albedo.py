"""The retina's unknown albedo as a Gaussian field: cosine modes of a window, with the fundus' own spectrum as prior.

log albedo = sum of c_k phi_k + white rest. The power spectrum of the log albedo of a fundus photograph
(doi 10.15347/wjm/2014.008) falls as k^-2.6 up to some 8 cycles/mm and faster beyond; its amplitude, 0.0025 in green
and 0.0002 in red, is estimated from each image. A mode of wave number k in a window of area S has variance P(k) / S.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.fft import fftfreq, rfftfreq
from scipy.linalg import cho_solve, cholesky
from scipy.linalg.lapack import dtrtri

from conespot.localize.field.settings import FIELD

Array = NDArray[np.float64]
#: octaves of the wave number, the first up to 1/4 mm, as wide as a window, the last from 16 per mm, the finest mode
_FIRST_OCTAVE, _OCTAVES = -2, 8


def even(amplitude: float) -> Array:
    """The same amplitude of the power spectrum in every octave."""
    return np.full(_OCTAVES, amplitude)


@dataclass(frozen=True)
class Modes:
    """Cosine modes of an `[h, w]` grid, of unit mean square; the first is the mean."""

    along_y: Array  #: `[ny, h]`
    along_x: Array  #: `[nx, w]`
    twice_y: Array  #: cosines of twice as many orders, not normalized `[2 ny, h]`
    twice_x: Array  #: `[2 nx, w]`
    spectrum: Array  #: prior variances for amplitude 1 `[ny nx]`
    octave: NDArray[np.intp]  #: of each mode's wave number `[ny nx]`
    bin_mm: float  #: side of a bin [mm]

    @classmethod
    def over(cls, height: int, width: int, bin_mm: float) -> Modes:
        """Modes of a window of bins of `bin_mm` [mm]."""
        ny, nx = (max(2, min(FIELD.most_modes, side // FIELD.bins_a_mode)) for side in (height, width))
        twice = [_cosines(2 * n, size) for n, size in ((ny, height), (nx, width))]
        sides = (height * bin_mm, width * bin_mm)
        k = np.hypot(np.arange(ny)[:, None] / (2.0 * sides[0]), np.arange(nx) / (2.0 * sides[1])).ravel()
        k[0] = 1.0
        spectrum = k**-FIELD.exponent / (1.0 + (k / FIELD.knee) ** 2) / (sides[0] * sides[1])
        norm_y, norm_x = _norms(ny), _norms(nx)
        along_y, along_x = norm_y[:, None] * twice[0][:ny], norm_x[:, None] * twice[1][:nx]
        return cls(along_y, along_x, twice[0], twice[1], spectrum, _octave(k), bin_mm)

    def density(self, shape: tuple[int, int], amplitudes: Array) -> Array:
        """The albedo's power spectrum [mm2] at the first waves `[h, w]` of a real transform of `shape`.

        As many along a row as are no finer than the modes; 0 at 0 and beyond the modes.
        A window's modes have no slope at its sides, and no wave is longer than two of it. The albedo's are.
        """
        finest, along = 0.5 / (FIELD.bins_a_mode * self.bin_mm), rfftfreq(shape[1], self.bin_mm)
        k = np.hypot(fftfreq(shape[0], self.bin_mm)[:, None], along[along <= finest])
        there = (k > 0.0) & (k <= finest)
        k = np.where(there, k, 1.0)
        power = amplitudes[_octave(k)] * k**-FIELD.exponent / (1.0 + (k / FIELD.knee) ** 2)
        return np.where(there, power, 0.0)

    def precision(self, amplitudes: Array) -> Array:
        """Prior precision of each mode `[ny nx]`."""
        variance = amplitudes[self.octave] * self.spectrum
        variance[0] = FIELD.mean_variance
        return 1.0 / variance

    def field(self, coefficients: Array) -> Array:
        """The sum of the modes `[h, w]`."""
        c = coefficients.reshape(len(self.along_y), len(self.along_x))
        return np.asarray(self.along_y.T @ c @ self.along_x)

    def fields(self, coefficients: Array) -> Array:
        """The sums of the modes `[Q, h, w]` of several coefficients `[ny nx, Q]`."""
        c = coefficients.T.reshape(-1, len(self.along_y), len(self.along_x))
        return np.asarray(self.along_y.T @ c @ self.along_x)

    def project(self, images: Array) -> Array:
        """Sums of images `[Q, h, w]` times the modes `[ny nx, Q]`."""
        return np.asarray((self.along_y @ images @ self.along_x.T).reshape(len(images), -1).T)

    def gram(self, weights: Array) -> Array:
        """Sums of the modes' products with `weights` `[h, w]`: `[ny nx, ny nx]`.

        cos a cos b = (cos(a - b) + cos(a + b)) / 2, so one transform of the weights holds every product.
        """
        ny, nx = len(self.along_y), len(self.along_x)
        t = self.twice_y @ weights @ self.twice_x.T
        i = np.arange(ny)
        rows = t[np.abs(i[:, None] - i)] + t[i[:, None] + i]  # [ny, ny, 2 nx]
        mirrored = np.concatenate([rows[..., nx - 1 : 0 : -1], rows[..., :nx]], axis=2)
        less = sliding_window_view(mirrored, nx, axis=2)[..., ::-1]  # j - l, in the place of j and l
        more = sliding_window_view(rows, nx, axis=2)[:, :, :nx]  # j + l
        found = np.empty((ny, nx, ny, nx))
        np.add(less, more, out=found.transpose(0, 2, 1, 3))
        found *= self._norms
        return found.reshape(ny * nx, ny * nx)

    @cached_property
    def _norms(self) -> Array:
        """Of the products of modes `[ny, nx, ny, nx]`."""
        norms = np.multiply.outer(_norms(len(self.along_y)), _norms(len(self.along_x)))
        return 0.25 * np.multiply.outer(norms, norms)

    def learnt(self, coefficients: Array, variances: Array, amplitudes: Array) -> Array:
        """The octaves' amplitudes that MacKay's fixed point makes of the modes' posterior means and variances.

        D. J. C. MacKay, Bayesian interpolation, Neural Computation 4 (1992). The coarsest octaves have few modes, which
        the pose imitates: each octave is taken to be like the next finer one unless its modes say otherwise.
        """
        index, spectrum = self.octave[1:], self.spectrum[1:]
        known = 1.0 - variances[1:] / (amplitudes[index] * spectrum)
        determined = np.bincount(index, weights=np.maximum(known, 0.0), minlength=_OCTAVES)
        power = np.bincount(index, weights=np.square(coefficients[1:]) / spectrum, minlength=_OCTAVES)
        found = amplitudes.copy()
        finer = float(np.sum(power) / max(float(np.sum(determined)), 1.0))
        for octave in reversed(range(_OCTAVES)):
            finer = float((power[octave] + FIELD.shared * finer) / (determined[octave] + FIELD.shared))
            found[octave] = finer
        # the fixed point is slow where there is nothing to find
        return np.clip(found * np.minimum(1.0, found / amplitudes), *FIELD.amplitudes)


@dataclass(frozen=True)
class Eliminated:
    """Normal equations after the albedo has been eliminated, and what gives it back."""

    information: Array  #: `[P, P]`
    gradient: Array  #: `[P]`
    gain: Array  #: the modes' reaction to the parameters `[modes, P]`
    offset: Array  #: the modes for unchanged parameters `[modes]`
    factor: Array  #: Cholesky's, of the modes' own normal equations `[modes, modes]`

    @cached_property
    def variances(self) -> Array:
        """Posterior variances of the modes `[modes]`."""
        # the diagonal of the inverse is the sum of squares of the inverse factor's columns
        inverse = dtrtri(self.factor, lower=1)[0]
        return np.asarray(np.einsum("ij,ij->j", inverse, inverse))

    def coefficients(self, step: Array) -> Array:
        """The modes after the parameters moved by `step` `[P]`."""
        return np.asarray(self.offset - self.gain @ step)

    def fitted(self, right: Array) -> Array:
        """The modes `[modes, Q]` of other data, whose weighted sums with the modes are `right` `[modes, Q]`."""
        return np.asarray(cho_solve((self.factor, True), right))


def eliminate(modes: Modes, weights: Array, jacobian: Array, data: Array, amplitudes: Array) -> Eliminated:
    """Normal equations for `data` `[h, w]` = `jacobian` `[P, h, w]` step + modes + noise of precision `weights`."""
    system = modes.gram(weights)
    system[np.diag_indices_from(system)] += modes.precision(amplitudes)
    count = len(jacobian)
    weighted = np.empty((count + 1, *weights.shape))
    np.multiply(jacobian, weights, out=weighted[:count])
    np.multiply(data, weights, out=weighted[count])
    flat, y = weighted[:count].reshape(count, -1), data.ravel()
    right = modes.project(weighted)
    factor = cholesky(system.T, lower=True, overwrite_a=True)
    solved = cho_solve((factor, True), right)
    information = flat @ jacobian.reshape(count, -1).T - right[:, :count].T @ solved[:, :count]
    gradient = flat @ y - right[:, :count].T @ solved[:, count]
    return Eliminated(information, gradient, solved[:, :count], solved[:, count], factor)


def _octave(k: Array) -> NDArray[np.intp]:
    """Number of the octave that wave numbers [1/mm] are in."""
    return np.clip(np.floor(np.log2(k)).astype(np.intp) - _FIRST_OCTAVE, 0, _OCTAVES - 1)


def _cosines(count: int, size: int) -> Array:
    return np.cos(np.pi * np.arange(count)[:, None] * (np.arange(size) + 0.5) / size)


def _norms(count: int) -> Array:
    return np.where(np.arange(count) == 0, 1.0, np.sqrt(2.0))
