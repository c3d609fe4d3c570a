"""Maximum likelihood on windows' bins, with the albedo as a Gaussian field eliminated from the normal equations.

Every spotlight has a window of its own, every window and channel an albedo and a gain of their own; the pose is one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from localize.albedo import FUNDUS, KNOWN, Modes, eliminate
from localize.band import SETTLED_SIGMAS
from localize.noise import NoiseModel
from localize.prior import Estimate, Knowns, prior_rows
from localize.roughness import Roughness
from localize.view import Channel, Grid, Window, channels, visible

Array = NDArray[np.float64]
_MARGIN = 0.15  # of a patch's size, seen around it: where the light ends, and the albedo there
_LONGEST_STEP_MM = 0.15
_DONE_SIGMAS = 0.05
_TIED_MM = 2e-3
#: an albedo with vessels and a disc is no Gaussian field: on fundus images, in green and at 850 nm, the squared errors
#: of the tip were this much larger, with the RCM and without
_NOT_GAUSSIAN = 1.4


@dataclass(frozen=True)
class Field:
    """What the fit of one channel in one window knows beside the pose."""

    log_gain: float | None  #: log of the spotlights' intensity over the ambient irradiance
    roughness: Roughness
    amplitudes: Array  #: of the albedo's power spectrum, by octave


@dataclass(frozen=True)
class FieldFit:
    """A fitted patch, or several."""

    estimate: Estimate
    fields: tuple[Field, ...]
    information: Array  #: of the pose and the free quantities `[P, P]`, priors included
    misfit: float  #: rms of the lit bins' residuals, outliers cut, over what the model expects
    settled: bool  #: whether the last step was small
    lit_share: float  #: share of the predicted patches that the frame shows and that is not clipped


def fit_field(
    image: NDArray[np.generic],
    start: Estimate,
    fields: tuple[Field, ...],
    knowns: Knowns,
    noise: NoiseModel,
    *,
    bins: int,
    modes: int,
    iterations: int,
    tied: int = 0,
    reference: NDArray[np.generic] | None = None,
    frames: float = 1.0,
) -> FieldFit | None:
    """Fit pose, gains and albedo to windows `bins` bins across each patch, from `start`.

    The first `tied` iterations keep the axis on the RCM, so that a poor start cannot run off along the soft directions
    of a free fit. `fields` is what a fit before this one found, or empty. None if the patches leave the frame or the
    equations are singular.
    """
    estimate, nominal = start, start.scene
    roll = len(nominal.spotlights) > 1
    pose_size = 6 if roll else 5
    pieces: list[_Piece] = []
    for k in range(len(nominal.spotlights)):
        at = Window.around(estimate, k, bins, _MARGIN)
        if at is None:
            continue
        grid = Grid(at, estimate, knowns, k)
        basis = Modes.over(at.height, at.width, nominal.camera.pixel_pitch * at.side, modes)
        for plane in channels(image, nominal, at, reference, noise, frames):
            pieces.append(_Piece(k, plane, grid, basis, noise))
    if not pieces:
        return None
    spectrum = FUNDUS if reference is None else KNOWN
    if len(fields) != len(pieces):
        fields = tuple(Field(None, Roughness(), spectrum) for _ in pieces)
    for piece, field in zip(pieces, fields, strict=True):
        piece.field = field
    settled, prior = False, np.zeros((0, 0))
    information = prior
    for count in range(iterations):
        tie = replace(knowns, rcm_sigma_mm=_TIED_MM) if count < tied else knowns
        residuals, rows = prior_rows(estimate, nominal, tie, pose_size)
        prior = rows.T @ rows
        information, gradient = prior.copy(), -rows.T @ residuals
        lights = {}
        for piece in pieces:
            if piece.spotlight not in lights:
                lights[piece.spotlight] = piece.grid.spotlight(estimate, roll=roll)
            part, slope = piece.linearize(*lights[piece.spotlight])
            information += part
            gradient += slope
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        try:
            covariance = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
        except np.linalg.LinAlgError:
            return None
        step = covariance @ gradient
        if not np.all(np.isfinite(step)):
            return None
        step /= max(1.0, float(np.max(np.abs(step[:3]))) / _LONGEST_STEP_MM, float(np.max(np.abs(step[3:5]))) / 0.05)
        estimate = estimate.moved(step, pose_size, knowns.free)
        for piece in pieces:
            piece.move(step, covariance)
        length = float(np.sqrt(max(0.0, float(step @ information @ step))))
        settled = length < SETTLED_SIGMAS
        if length < _DONE_SIGMAS and count >= max(tied, 2):
            break
    return FieldFit(
        estimate,
        tuple(piece.field for piece in pieces),
        prior + (information - prior) / _NOT_GAUSSIAN,
        float(np.sqrt(np.mean([piece.misfit**2 for piece in pieces]))),
        settled,
        visible(estimate) * float(np.mean([piece.unclipped() for piece in pieces])),
    )


class _Piece:
    """One channel in one window: its normal equations for the pose, with its albedo and gain eliminated."""

    field: Field

    def __init__(self, spotlight: int, plane: Channel, grid: Grid, basis: Modes, noise: NoiseModel) -> None:
        self.spotlight, self.grid = spotlight, grid
        self._plane, self._basis, self._noise = plane, basis, noise
        self._seen = grid.seen.reshape(plane.signal.shape)
        self._usable = plane.usable & self._seen
        self._albedo: Array | None = None  # log, beside the template `[h, w]`
        self._lit = np.zeros(0, bool)
        self.misfit = np.inf

    def unclipped(self) -> float:
        """Share of the window's lit bins that can be measured."""
        lit = self._lit & self._seen
        return float(np.count_nonzero(self._usable & lit)) / max(1.0, float(np.count_nonzero(lit)))

    def linearize(self, light: Array, rows: Array) -> tuple[Array, Array]:
        """Information `[P, P]` and gradient `[P]` for `light` `[N]` on the grid's bins and its derivatives `[P, N]`."""
        plane, grid, field = self._plane, self.grid, self.field
        shape = plane.signal.shape
        ambient = grid.ambient.reshape(shape)
        full = np.zeros(shape)
        full.ravel()[grid.lit] = light
        self._lit = full > 0.0
        fresh = self._albedo is None
        if self._albedo is None:
            self._albedo = np.full(shape, _surroundings(plane, ambient, self._usable & ~self._lit))
        albedo = plane.template + self._albedo
        log_gain = field.log_gain
        if log_gain is None:
            log_gain = _gain(plane.signal / np.exp(albedo), ambient, full, self._usable & self._lit)
        gain = np.exp(log_gain)
        brightness = ambient + gain * full
        model = np.exp(albedo) * brightness
        relative = plane.signal / model - 1.0
        residual = np.where(np.abs(relative) < 0.3, relative, np.log(np.maximum(plane.signal, 0.02 * model) / model))
        # a clipped bin says only that its light is above white
        bound = plane.clipped & self._seen & (model < 1.0)
        residual[bound] = np.maximum(0.0, -np.log(np.maximum(model[bound], 1e-6)))
        use = self._usable | bound
        sensor = self._noise.variance(model) / grid.at.side**2 / np.square(np.maximum(model, 1e-9))
        sensor = sensor + plane.template_variance
        roughness, local = field.roughness, np.full(shape, field.roughness.scatter**2)
        if not fresh:
            inner = self._usable & (full > 0.1 * light.max(initial=0.0))
            roughness, local = roughness.measured(residual, sensor, use, inner)
        whitened = np.square(residual[use]) / (sensor + local)[use]
        self.misfit = float(np.sqrt(np.mean(np.minimum(whitened, 25.0)))) if use.any() else np.inf
        jacobian = np.zeros((len(rows) + 1, full.size))
        share = gain / brightness.ravel()[grid.lit]
        jacobian[:-1, grid.lit] = share * rows
        jacobian[-1, grid.lit] = share * light
        weights = use / (sensor + roughness.variance(local))
        solved = eliminate(
            self._basis, weights, jacobian.reshape(-1, *shape), residual + self._albedo, field.amplitudes
        )
        self._solved, self.field = solved, Field(log_gain, roughness, field.amplitudes)
        information, gradient = solved.information, solved.gradient
        # the gain is this piece's own
        self._pivot = max(information[-1, -1], 1e-12)
        self._reaction, self._own = information[-1, :-1] / self._pivot, gradient[-1] / self._pivot
        return (
            information[:-1, :-1] - np.outer(information[:-1, -1], self._reaction),
            gradient[:-1] - information[:-1, -1] * self._own,
        )

    def move(self, step: Array, covariance: Array) -> None:
        """Take what a step `[P]` of the pose means for gain, albedo and its spectrum; `covariance` is the pose's.

        The spectrum is learnt from the modes as far as neither the pose nor the gain imitates them.
        """
        solved, field = self._solved, self.field
        gain = float(np.clip(self._own - self._reaction @ step, -1.0, 1.0))
        coefficients = solved.coefficients(np.append(step, gain))
        by_pose = solved.gain[:, :-1] - np.outer(solved.gain[:, -1], self._reaction)
        variances = solved.variances + np.einsum("ij,jk,ik->i", by_pose, covariance, by_pose)
        variances += np.square(solved.gain[:, -1]) / self._pivot
        assert field.log_gain is not None
        amplitudes = self._basis.learnt(coefficients, variances, field.amplitudes)
        self.field = Field(field.log_gain + gain, field.roughness, amplitudes)
        self._albedo = self._basis.field(coefficients)


def _surroundings(plane: Channel, ambient: Array, dark: NDArray[np.bool_]) -> float:
    """Log albedo, beside the template, of what the spotlights do not light."""
    if np.count_nonzero(dark) < 10:
        dark = np.ones_like(dark)
    return float(np.log(max(float(np.median(plane.signal[dark] / (ambient * np.exp(plane.template))[dark])), 1e-5)))


def _gain(irradiance: Array, ambient: Array, light: Array, lit: NDArray[np.bool_]) -> float:
    """Log of the spotlights' intensity over the ambient irradiance, from the brighter half of what is not clipped."""
    if np.count_nonzero(lit) < 5:
        return float(np.log(1e3 / max(float(light.max(initial=0.0)), 1e-9)))
    ratio, bright = (irradiance[lit] - ambient[lit]) / light[lit], light[lit] >= np.quantile(light[lit], 0.5)
    return float(np.log(max(float(np.median(ratio[bright])), 1e-3 / float(light.max()))))
