"""One window of the soft fit: a patch, its normal equations for pose and gain, its albedo eliminated."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.localize.field.albedo import Modes, eliminate, even
from conespot.localize.field.roughness import Roughness
from conespot.localize.field.sandwich import albedo_scatter, rest_scatter
from conespot.localize.field.settings import FIELD
from conespot.localize.model.gain import gain_between
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.residual import incident_light, log_residuals, rms
from conespot.localize.model.view import Bins, Shown

Array = NDArray[np.float64]


def _chroma(lead: Shown, others: list[Shown]) -> Array:
    """Log ratios `[C - 1, h, w]` of the other channels to the leading one, beside their templates; 0 where unknown."""
    found = np.zeros((len(others), *lead.signal.shape))
    for plane, other in zip(found, others, strict=True):
        # a little smoother than the bins, or their noise would hide what the channels have in common
        smooth = [cv2.GaussianBlur(channel.signal, (0, 0), FIELD.chroma_blur) for channel in (other, lead)]
        a, b = (np.maximum(signal, max(FIELD.chroma_darkest * float(np.median(signal)), 1e-6)) for signal in smooth)
        ratio = np.log(a / b) - other.template + lead.template
        known = lead.usable & other.usable
        plane[known] = ratio[known] - (np.median(ratio[known]) if known.any() else 0.0)
    return found


def _noise(count: int) -> Array:
    """White noise `[count]`: always the same, so that a frame has one answer, and drawn once for all of them."""
    return _drawn(1 << count.bit_length())[:count]


@cache
def _drawn(count: int) -> Array:
    drawn = np.random.default_rng(0).standard_normal(count)
    drawn.flags.writeable = False
    return drawn


class Piece:
    """One window: its normal equations for pose and gain, with its albedo eliminated.

    The channels of a colour image show the same light, so one leads and the others tell its albedo: the log ratios to
    it are free of the light, and what they have in common with the leader's albedo is taken off.
    """

    def __init__(
        self, shown: list[Shown], lead: int, bins: Bins, basis: Modes, noise: NoiseModel, amplitude: float
    ) -> None:
        """Of the channels `shown` the `lead`ing one is measured; the albedo's spectrum begins with `amplitude`."""
        self.bins, plane = bins, shown[lead]
        self.roughness, self.amplitudes = Roughness(FIELD.scatter), even(amplitude)  # by octave
        self._plane, self._basis, self._noise = plane, basis, noise
        self._seen = bins.seen.reshape(plane.signal.shape)
        self._usable = plane.usable & self._seen
        self._chroma = _chroma(plane, shown[:lead] + shown[lead + 1 :])
        self._albedo = np.zeros(plane.signal.shape)  # log, beside the template
        self._fresh = True
        self._lit = np.zeros(plane.signal.shape, bool)
        # residuals, the variances that the model expects of them, and which are used, as last linearized
        self._left = np.zeros(0), np.zeros(0), np.zeros(0, bool)

    def begin(self, light: Array) -> float:
        """Take the surroundings' albedo for all there is, and tell the log gain that the brighter half then shows."""
        plane, full, ambient = self._plane, self._full(light), self.bins.ambient.reshape(self._seen.shape)
        if np.all(full[self._usable] > 0.0):
            return self._begin_in_glow(full, ambient)
        dark, lit = self._usable & (full <= 0.0), self._usable & (full > 0.0)
        if np.count_nonzero(dark) < 10:
            dark = np.ones_like(dark)
        around = max(float(np.median(plane.signal[dark] / (ambient * np.exp(plane.template))[dark])), 1e-5)
        self._albedo += np.log(around)
        if np.count_nonzero(lit) < 5:
            return float(np.log(1e3 / max(float(light.max(initial=0.0)), 1e-9)))
        ratio = (plane.signal[lit] / (around * np.exp(plane.template[lit])) - ambient[lit]) / full[lit]
        bright = full[lit] >= np.quantile(full[lit], 0.5)
        return float(np.log(max(float(np.median(ratio[bright])), 1e-3 / float(light.max()))))

    def _begin_in_glow(self, full: Array, ambient: Array) -> float:
        """`begin` where light from under the retina is all over the window."""
        signal = self._plane.signal / np.exp(self._plane.template)
        low, high = np.quantile(full[self._usable], FIELD.glow) if self._usable.any() else (0.0, 0.0)
        gain = gain_between(signal, ambient, full, self._usable & (full >= high), self._usable & (full <= low))
        even = (signal / (ambient + np.exp(gain) * full))[self._usable]
        self._albedo += np.log(max(float(np.median(even)), 1e-5) if len(even) else 1e-5)
        return gain

    def resume(self, coarse: Piece) -> None:
        """Take over what a coarser fit knows of the albedo."""
        self.roughness, self.amplitudes = coarse.roughness, coarse.amplitudes
        at, old = self.bins.at, coarse.bins.at
        scale = at.side / old.side
        shift = [
            (new - was) / old.side + (scale - 1.0) / 2.0 for new, was in ((at.column, old.column), (at.row, old.row))
        ]
        to = np.array([[scale, 0.0, shift[0]], [0.0, scale, shift[1]]])
        self._albedo[:] = cv2.warpAffine(
            coarse._albedo, to, (at.width, at.height),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, borderMode=cv2.BORDER_REPLICATE,
        )  # fmt: skip
        self._fresh = False

    @property
    def misfit(self) -> float:
        """Rms of the residuals over what the model expects, outliers cut; infinite before there are any."""
        residual, variance, use = self._left
        return rms((residual / np.sqrt(variance))[use])

    def unclipped(self) -> float:
        """Share of the window's lit bins that can be measured."""
        lit = self._lit & self._seen
        return float(np.count_nonzero(self._usable & lit)) / max(1.0, float(np.count_nonzero(lit)))

    def linearize(
        self, light: Array, rows: Array, log_gain: float, also: Callable[[Array], Array] | None = None
    ) -> tuple[Array, Array]:
        """Information `[P + 1, P + 1]` and gradient `[P + 1]` of the pose and the log gain.

        The lit bins get `light` `[N]`, with its derivatives `[P, N]`. `also` makes a row `[h, w]` more, behind the
        gain's, of the log light by a quantity, out of the model's [white]. Not a number where there is no such model.
        """
        plane, bins = self._plane, self.bins
        shape, gain = plane.signal.shape, np.exp(log_gain)
        full = self._full(light)
        self._lit = full > 0.0
        brightness = incident_light(bins.ambient.reshape(shape), gain * full)
        model = np.exp(plane.template + self._albedo) * brightness
        size = len(rows) + (1 if also is None else 2)
        if not np.isfinite(model).all():
            return np.full((size, size), np.nan), np.full(size, np.nan)
        sensor = self._noise.variance(model) / bins.at.side**2 / np.square(np.maximum(model, 1e-9))
        residual, bound = log_residuals(plane, model, sensor)
        use = self._usable | (bound & self._seen)
        sensor = sensor + plane.template_variance
        local = np.full(shape, self.roughness.scatter**2)
        if not self._fresh:
            inner = self._usable & (full > FIELD.lit * light.max(initial=0.0))
            self.roughness, local = self.roughness.measured(residual, sensor, use, inner)
        self._left = residual, sensor + local, use
        jacobian = np.zeros((size + len(self._chroma), full.size))
        share = gain / brightness.ravel()[bins.lit]
        jacobian[: len(rows), bins.lit] = share * rows
        jacobian[len(rows), bins.lit] = share * light
        if also is not None:
            jacobian[size - 1] = also(model).ravel()
        jacobian[size:] = self._chroma.reshape(len(self._chroma), full.size)
        weights = use / (sensor + self.roughness.variance(local))
        solved = eliminate(self._basis, weights, jacobian.reshape(-1, *shape), residual + self._albedo, self.amplitudes)
        self._solved, self._jacobian, self._weights = solved, jacobian, weights
        self._data, self._spectrum = residual + self._albedo, self.amplitudes
        own = solved.information[size:, size:] + np.eye(len(self._chroma)) / FIELD.chroma**2
        self._reaction = np.linalg.solve(own, solved.information[size:, :size])
        self._share = np.linalg.solve(own, solved.gradient[size:])
        return (
            solved.information[:size, :size] - solved.information[:size, size:] @ self._reaction,
            solved.gradient[:size] - solved.information[:size, size:] @ self._share,
        )

    def scatter(self, step: Array, bread: Array) -> Array:
        """Covariance of the gradient `[P + 1, P + 1]` as the residuals show it, where `step` leads `[P + 1]`.

        `bread` `[P + 1, P + 1]` is the fit's covariance if its model is right.
        """
        solved, size, basis = self._solved, len(step), self._basis
        every, (height, width) = self._jacobian.reshape(-1, *self._data.shape), self._data.shape
        gain = solved.gain[:, :size] - solved.gain[:, size:] @ self._reaction
        own = every[:size] - np.tensordot(self._reaction.T, every[size:], 1)
        root = np.sqrt(self._weights)
        rows = root * (own - basis.fields(gain))
        both = np.append(step, self._share - self._reaction @ step)
        left = self._data - basis.field(solved.coefficients(both)) - np.tensordot(both, every, 1)
        white = _noise(FIELD.whites * height * width).reshape(-1, height, width) * (root > 0.0)
        modes = solved.fitted(basis.project(root * white))
        moves = bread @ np.tensordot(rows, white, ([1, 2], [1, 2]))
        white -= root * basis.fields(modes)
        white -= np.tensordot(moves.T, rows, 1)
        known = self._reaction.T @ self._reaction / FIELD.chroma**2
        return known + albedo_scatter(root * rows, basis, self._spectrum) + rest_scatter(rows, root * left, white)

    def move(self, step: Array, covariance: Array) -> None:
        """Take what a step `[P + 1]` of pose and log gain means for the albedo and its spectrum.

        The spectrum is learnt from the modes as far as neither pose nor gain, of this `covariance`, imitates them.
        """
        solved, size = self._solved, len(step)
        share = self._share - self._reaction @ step
        coefficients = solved.coefficients(np.append(step, share))
        gain = solved.gain[:, :size] - solved.gain[:, size:] @ self._reaction
        variances = solved.variances + np.einsum("ij,jk,ik->i", gain, covariance, gain)
        self.amplitudes = self._basis.learnt(coefficients, variances, self.amplitudes)
        self._albedo = self._basis.field(coefficients) + np.tensordot(share, self._chroma, 1)
        self._fresh = False

    def _full(self, light: Array) -> Array:
        """Light on all bins of the window `[h, w]`."""
        full = np.zeros(self._seen.shape)
        full.ravel()[self.bins.lit] = light
        return full
