"""One window of the soft fit: a patch, its normal equations for pose and gain, its albedo eliminated."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.localize.field.albedo import FUNDUS, Modes, eliminate
from conespot.localize.field.roughness import Roughness
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.view import Channel, Grid

Array = NDArray[np.float64]
_CHROMA = 0.5  # how much of a log ratio of channels the leading one's log albedo may hold


def _chroma(lead: Channel, others: list[Channel]) -> Array:
    """Log ratios `[C - 1, h, w]` of the other channels to the leading one, beside their templates; 0 where unknown."""
    found = np.zeros((len(others), *lead.signal.shape))
    for plane, other in zip(found, others, strict=True):
        # a little smoother than the bins, or their noise would hide what the channels have in common
        smooth = [cv2.GaussianBlur(channel.signal, (0, 0), 1.0) for channel in (other, lead)]
        a, b = (np.maximum(signal, max(0.05 * float(np.median(signal)), 1e-6)) for signal in smooth)
        ratio = np.log(a / b) - other.template + lead.template
        known = lead.usable & other.usable
        plane[known] = ratio[known] - (np.median(ratio[known]) if known.any() else 0.0)
    return found


class Piece:
    """One window: its normal equations for pose and gain, with its albedo eliminated.

    The channels of a colour image show the same light, so one leads and the others tell its albedo: the log ratios to
    it are free of the light, and what they have in common with the leader's albedo is taken off.
    """

    roughness = Roughness()
    amplitudes = FUNDUS  # of the albedo's power spectrum, by octave

    def __init__(self, shown: list[Channel], lead: int, grid: Grid, basis: Modes, noise: NoiseModel) -> None:
        """Of the channels `shown` the `lead`ing one is measured."""
        self.grid, plane = grid, shown[lead]
        self._plane, self._basis, self._noise = plane, basis, noise
        self._seen = grid.seen.reshape(plane.signal.shape)
        self._usable = plane.usable & self._seen
        self._chroma = _chroma(plane, shown[:lead] + shown[lead + 1 :])
        self._albedo = np.zeros(plane.signal.shape)  # log, beside the template
        self._fresh = True
        self._lit = np.zeros(plane.signal.shape, bool)
        self.misfit = np.inf

    def begin(self, light: Array) -> float:
        """Take the surroundings' albedo for all there is, and tell the log gain that the brighter half then shows."""
        plane, full, ambient = self._plane, self._full(light), self.grid.ambient.reshape(self._seen.shape)
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

    def resume(self, coarse: Piece) -> None:
        """Take over what a coarser fit knows of the albedo."""
        self.roughness, self.amplitudes = coarse.roughness, coarse.amplitudes
        at, old = self.grid.at, coarse.grid.at
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

    def unclipped(self) -> float:
        """Share of the window's lit bins that can be measured."""
        lit = self._lit & self._seen
        return float(np.count_nonzero(self._usable & lit)) / max(1.0, float(np.count_nonzero(lit)))

    def linearize(self, light: Array, rows: Array, log_gain: float) -> tuple[Array, Array]:
        """Information `[P + 1, P + 1]` and gradient `[P + 1]` of the pose and the log gain.

        The grid's bins get `light` `[N]`, with its derivatives `[P, N]`.
        """
        plane, grid = self._plane, self.grid
        shape, gain = plane.signal.shape, np.exp(log_gain)
        full = self._full(light)
        self._lit = full > 0.0
        brightness = grid.ambient.reshape(shape) + gain * full
        model = np.exp(plane.template + self._albedo) * brightness
        relative = plane.signal / model - 1.0
        residual = np.where(np.abs(relative) < 0.3, relative, np.log(np.maximum(plane.signal, 0.02 * model) / model))
        # a clipped bin says only that its light is above white
        bound = plane.clipped & self._seen & (model < 1.0)
        residual[bound] = np.maximum(0.0, -np.log(np.maximum(model[bound], 1e-6)))
        use = self._usable | bound
        sensor = self._noise.variance(model) / grid.at.side**2 / np.square(np.maximum(model, 1e-9))
        sensor = sensor + plane.template_variance
        local = np.full(shape, self.roughness.scatter**2)
        if not self._fresh:
            inner = self._usable & (full > 0.1 * light.max(initial=0.0))
            self.roughness, local = self.roughness.measured(residual, sensor, use, inner)
        whitened = np.square(residual[use]) / (sensor + local)[use]
        self.misfit = float(np.sqrt(np.mean(np.minimum(whitened, 25.0)))) if use.any() else np.inf
        size = len(rows) + 1
        jacobian = np.zeros((size + len(self._chroma), full.size))
        share = gain / brightness.ravel()[grid.lit]
        jacobian[: size - 1, grid.lit] = share * rows
        jacobian[size - 1, grid.lit] = share * light
        jacobian[size:] = self._chroma.reshape(len(self._chroma), full.size)
        weights = use / (sensor + self.roughness.variance(local))
        solved = eliminate(self._basis, weights, jacobian.reshape(-1, *shape), residual + self._albedo, self.amplitudes)
        self._solved = solved
        own = solved.information[size:, size:] + np.eye(len(self._chroma)) / _CHROMA**2
        self._reaction = np.linalg.solve(own, solved.information[size:, :size])
        self._share = np.linalg.solve(own, solved.gradient[size:])
        return (
            solved.information[:size, :size] - solved.information[:size, size:] @ self._reaction,
            solved.gradient[:size] - solved.information[:size, size:] @ self._share,
        )

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
        full.ravel()[self.grid.lit] = light
        return full
