"""Maximum likelihood on windows' bins, with the albedo as a Gaussian field eliminated from the normal equations.

Every spotlight has a window of its own, every window and channel an albedo of their own; pose and gains are one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from localize.albedo import FUNDUS, KNOWN, Modes, eliminate
from localize.band import SETTLED_SIGMAS
from localize.noise import NoiseModel
from localize.prior import Estimate, Knowns, prior_rows
from localize.roughness import Roughness
from localize.view import Channel, Grid, Unlit, Window, shown_in, visible

Array = NDArray[np.float64]
_MARGIN = 0.15  # of a patch's size, seen around it: where the light ends, and the albedo there
_LONGEST_STEP_MM = 0.15
_DONE_SIGMAS = 0.2  # a step this short ends the iterations
_TIED_MM = 2e-3
#: an albedo with vessels and a disc is no Gaussian field: on fundus images, in green and at 850 nm, the squared errors
#: of the tip were this much larger, with the RCM and without
_NOT_GAUSSIAN = 1.4


@dataclass(frozen=True)
class FieldFit:
    """A fitted patch, or several."""

    estimate: Estimate
    pieces: tuple[_Piece, ...]
    gains: tuple[float, ...]  #: log of the spotlights' intensity over the ambient irradiance, a channel each
    information: Array  #: of the pose and the free quantities `[P, P]`, priors included
    misfit: float  #: rms of the lit bins' residuals, outliers cut, over what the model expects
    settled: bool  #: whether the last step was small
    lit_share: float  #: share of the predicted patches that the frame shows and that is not clipped


def fit_field(
    image: NDArray[np.generic],
    start: Estimate,
    before: FieldFit | None,
    knowns: Knowns,
    noise: NoiseModel,
    *,
    bins: int,
    iterations: int,
    tied: int = 0,
    unlit: Unlit | None = None,
) -> FieldFit | None:
    """Fit pose, gains and albedo to windows `bins` bins across each patch, from `start`.

    The first `tied` iterations keep the axis on the RCM, so that a poor start cannot run off along the soft directions
    of a free fit. `before` is a coarser fit, to start its albedo and gains from. None if the patches leave the frame or
    the equations are singular.
    """
    estimate, nominal = start, start.scene
    roll = len(nominal.spotlights) > 1
    pose_size = 6 if roll else 5
    size = pose_size + len(knowns.free)
    pieces: list[_Piece] = []
    for k in range(len(nominal.spotlights)):
        at = Window.around(estimate, k, bins, _MARGIN)
        if at is None:
            continue
        grid = Grid(at, estimate, knowns, k)
        basis = Modes.over(at.height, at.width, nominal.camera.pixel_pitch * at.side)
        for c, plane in enumerate(shown_in(image, nominal, at, unlit)):
            pieces.append(_Piece(c, plane, grid, basis, noise))
    if not pieces:
        return None
    lights = {id(piece.grid): piece.grid.spotlight(estimate, roll=roll) for piece in pieces}
    first = np.array([piece.begin(lights[id(piece.grid)][0]) for piece in pieces])
    if before is not None and len(before.pieces) == len(pieces):
        gains = np.array(before.gains)
        for piece, coarse in zip(pieces, before.pieces, strict=True):
            piece.resume(coarse)
    else:
        gains = np.median(first.reshape(-1, 1 + pieces[-1].channel), axis=0)
        for piece in pieces:
            piece.amplitudes = FUNDUS if unlit is None else KNOWN
    whole = size + len(gains)
    settled, prior, information = False, np.zeros((whole, whole)), np.eye(whole)
    for count in range(iterations):
        tie = replace(knowns, rcm_sigma_mm=_TIED_MM) if count < tied else knowns
        residuals, rows = prior_rows(estimate, nominal, tie, pose_size)
        prior = rows.T @ rows
        information, gradient = np.zeros((whole, whole)), np.zeros(whole)
        information[:size, :size], gradient[:size] = prior, -rows.T @ residuals
        if count:
            lights = {id(piece.grid): piece.grid.spotlight(estimate, roll=roll) for piece in pieces}
        for piece in pieces:
            mine = np.append(np.arange(size), size + piece.channel)
            part, slope = piece.linearize(*lights[id(piece.grid)], float(gains[piece.channel]))
            information[np.ix_(mine, mine)] += part
            gradient[mine] += slope
        scale = np.sqrt(np.maximum(np.diag(information), 1e-12))
        try:
            covariance = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
        except np.linalg.LinAlgError:
            return None
        step = covariance @ gradient
        if not np.all(np.isfinite(step)):
            return None
        step /= max(1.0, float(np.max(np.abs(step[:3]))) / _LONGEST_STEP_MM, float(np.max(np.abs(step[3:5]))) / 0.05)
        step[size:] = np.clip(step[size:], -1.0, 1.0)
        estimate = estimate.moved(step[:size], pose_size, knowns.free)
        gains = gains + step[size:]
        for piece in pieces:
            mine = np.append(np.arange(size), size + piece.channel)
            piece.move(step[mine], covariance[np.ix_(mine, mine)])
        length = float(np.sqrt(max(0.0, float(step @ information @ step))))
        settled = length < SETTLED_SIGMAS
        if length < _DONE_SIGMAS and count >= max(tied, 1):
            break
    own = information[size:, :size]
    data = information[:size, :size] - own.T @ np.linalg.solve(information[size:, size:], own) - prior
    return FieldFit(
        estimate,
        tuple(pieces),
        tuple(gains),
        prior + data / _NOT_GAUSSIAN,
        float(np.sqrt(np.mean([piece.misfit**2 for piece in pieces]))),
        settled,
        visible(estimate) * float(np.mean([piece.unclipped() for piece in pieces])),
    )


class _Piece:
    """One channel in one window: its normal equations for pose and gain, with its albedo eliminated."""

    roughness = Roughness()
    amplitudes = FUNDUS  # of the albedo's power spectrum, by octave

    def __init__(self, channel: int, plane: Channel, grid: Grid, basis: Modes, noise: NoiseModel) -> None:
        self.channel, self.grid = channel, grid
        self._plane, self._basis, self._noise = plane, basis, noise
        self._seen = grid.seen.reshape(plane.signal.shape)
        self._usable = plane.usable & self._seen
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

    def resume(self, coarse: _Piece) -> None:
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
        jacobian = np.zeros((len(rows) + 1, full.size))
        share = gain / brightness.ravel()[grid.lit]
        jacobian[:-1, grid.lit] = share * rows
        jacobian[-1, grid.lit] = share * light
        weights = use / (sensor + self.roughness.variance(local))
        solved = eliminate(self._basis, weights, jacobian.reshape(-1, *shape), residual + self._albedo, self.amplitudes)
        self._solved = solved
        return solved.information, solved.gradient

    def move(self, step: Array, covariance: Array) -> None:
        """Take what a step `[P + 1]` of pose and log gain means for the albedo and its spectrum.

        The spectrum is learnt from the modes as far as neither pose nor gain, of this `covariance`, imitates them.
        """
        solved = self._solved
        coefficients = solved.coefficients(step)
        variances = solved.variances + np.einsum("ij,jk,ik->i", solved.gain, covariance, solved.gain)
        self.amplitudes = self._basis.learnt(coefficients, variances, self.amplitudes)
        self._albedo, self._fresh = self._basis.field(coefficients), False

    def _full(self, light: Array) -> Array:
        """Light on all bins of the window `[h, w]`."""
        full = np.zeros(self._seen.shape)
        full.ravel()[self.grid.lit] = light
        return full
