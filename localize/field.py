"""Maximum likelihood on a window's bins, with the albedo as a Gaussian field eliminated from the normal equations."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from localize.albedo import FUNDUS_AMPLITUDE, Eliminated, Modes, eliminate
from localize.band import SETTLED_SIGMAS
from localize.noise import NoiseModel
from localize.prior import Estimate, Knowns, prior_rows
from localize.solve import rest, student_weights
from localize.view import Channel, Grid, Window, channels

Array = NDArray[np.float64]
_WHITE = 0.1  # of the albedo beyond the modes, before it has been measured
_LONGEST_STEP_MM = 0.15
_DONE_SIGMAS = 0.05


@dataclass(frozen=True)
class Field:
    """What a channel's fit knows beside the pose."""

    log_gain: float | None = None  #: log of the spotlights' intensity over the ambient irradiance
    white: float = _WHITE  #: rms of the log albedo beyond the modes
    amplitude: float = FUNDUS_AMPLITUDE  #: of the albedo's power spectrum


@dataclass(frozen=True)
class FieldFit:
    """A fitted window."""

    estimate: Estimate
    fields: tuple[Field, ...]
    information: Array  #: of the pose and the free quantities `[P, P]`, priors included
    misfit: float  #: rms of the lit bins' residuals, outliers cut, over what the model expects
    settled: bool  #: whether the last step was small
    lit_share: float  #: share of the predicted patch that the frame shows and that is not clipped
    correlation: float  #: how much larger the residuals' means over blocks are than independent bins would give


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
    margin: float = 0.3,
) -> FieldFit | None:
    """Fit pose, gain and albedo to a window `bins` bins across the patch, from `start`.

    The first `tied` iterations keep the axis on the RCM, so that a poor start cannot run off along the soft directions
    of a free fit. None if the patch leaves the frame or the equations are singular.
    """
    estimate, nominal = start, start.scene
    roll = len(nominal.spotlights) > 1
    pose_size = 6 if roll else 5
    size = pose_size + len(knowns.free)
    at = Window.around(estimate, bins, margin)
    if at is None:
        return None
    grid = Grid(at, estimate, knowns)
    planes = channels(image, nominal, at, reference, noise, frames)
    basis = Modes.over(at.height, at.width, nominal.camera.pixel_pitch * at.side, modes)
    if not fields:
        first = Field(amplitude=1e-5 if reference is not None else FUNDUS_AMPLITUDE)
        fields = tuple(first for _ in planes)
    coefficients = [np.zeros(len(basis.spectrum)) for _ in planes]
    information, misfit, settled, correlation = np.zeros((size, size)), 0.0, False, 1.0
    for count in range(iterations):
        light, rows = grid.spotlight(estimate, roll=roll)
        exact = Knowns(rcm_sigma_mm=2e-3, half_angle_sigma_deg=knowns.half_angle_sigma_deg,
                       eye_radius_sigma_mm=knowns.eye_radius_sigma_mm,
                       camera_height_sigma_mm=knowns.camera_height_sigma_mm)  # fmt: skip
        pr, pj = prior_rows(estimate, nominal, exact if count < tied else knowns, pose_size)
        information, gradient = pj.T @ pj, -pj.T @ pr
        parts, updated, misfits = [], [], []
        for plane, field, c in zip(planes, fields, coefficients, strict=True):
            term = _Term(plane, field, c, grid, light, rows, basis, noise, fresh=count == 0)
            parts.append(term)
            information += term.information
            gradient += term.gradient
            updated.append(term.field)
            misfits.append(term.misfit)
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        try:
            step = np.linalg.solve(information / np.outer(scale, scale), gradient / scale) / scale
        except np.linalg.LinAlgError:
            return None
        if not np.all(np.isfinite(step)):
            return None
        step /= max(1.0, float(np.max(np.abs(step[:3]))) / _LONGEST_STEP_MM, float(np.max(np.abs(step[3:5]))) / 0.05)
        estimate = estimate.moved(step, pose_size, knowns.free)
        steps = [part.gain_step(step) for part in parts]
        coefficients = [part.coefficients(step, gain) for part, gain in zip(parts, steps, strict=True)]
        fields = tuple(
            Field(field.log_gain + gain, field.white, part.amplitude)  # type: ignore[operator]
            for field, gain, part in zip(updated, steps, parts, strict=True)
        )
        misfit = float(np.sqrt(np.mean(np.square(misfits))))
        correlation = float(np.mean([part.correlation for part in parts]))
        length = float(np.sqrt(max(0.0, float(step @ information @ step))))
        settled = length < SETTLED_SIGMAS * float(np.sqrt(correlation))
        if length < _DONE_SIGMAS and count >= max(tied, 2):
            break
    inside = grid.lit[light > 0.0]
    share = float(np.mean([np.count_nonzero(p.usable.ravel()[inside]) / max(1, len(inside)) for p in planes]))
    return FieldFit(estimate, fields, information, misfit, settled, share, correlation)


class _Term:
    """One channel's contribution to the normal equations of the pose, its albedo and gain eliminated."""

    def __init__(
        self,
        plane: Channel,
        field: Field,
        c: Array,
        grid: Grid,
        light: Array,
        rows: Array,
        basis: Modes,
        noise: NoiseModel,
        *,
        fresh: bool,
    ) -> None:
        shape = plane.signal.shape
        lit = grid.lit
        signal = plane.signal.ravel()
        usable = plane.usable.ravel() & grid.seen
        flat_light = np.zeros(signal.size)
        flat_light[lit] = light
        dark = usable & (flat_light <= 0.0)
        albedo_first = np.exp(plane.template.ravel())
        base = 0.0
        if fresh:
            base = _base(signal, grid.ambient * albedo_first, dark)
        log_gain = field.log_gain
        if log_gain is None:
            log_gain = _gain(signal, grid.ambient, flat_light, albedo_first * np.exp(base), usable)
        gain = np.exp(log_gain)
        brightness = grid.ambient + gain * flat_light
        known = plane.template.ravel() + (base if fresh else basis.field(c).ravel())
        model = np.exp(known) * brightness
        relative = signal / model - 1.0
        residual = np.where(np.abs(relative) < 0.3, relative, np.log(np.maximum(signal, 0.02 * model) / model))
        # a clipped bin says only that its light is above white
        bound = plane.clipped.ravel() & grid.seen & (model < 1.0)
        residual[bound] = np.maximum(0.0, -np.log(np.maximum(model[bound], 1e-6)))
        use = usable | bound
        sensor = noise.variance(model) / grid.at.side**2 / np.square(np.maximum(model, 1e-9))
        spots = np.zeros(signal.size, bool)
        spots[lit] = light > 0.1 * light.max(initial=0.0)
        inner = spots & usable
        white = field.white
        if not fresh and np.count_nonzero(inner) > 30:
            white = rest(residual[inner], sensor[inner], white)
        self.field = Field(log_gain, white, field.amplitude)
        variance = sensor + white**2 + plane.template_variance.ravel()
        weights = use / variance
        whitened = residual / np.sqrt(variance)
        if not fresh:
            weights = weights * student_weights(whitened)
        self.misfit = float(np.sqrt(np.mean(np.minimum(np.square(whitened[use]), 25.0)))) if use.any() else np.inf
        self.correlation = _correlation((whitened * inner).reshape(shape), inner.reshape(shape))
        jacobian = np.zeros((len(rows) + 1, signal.size))
        share = gain / brightness[lit]
        jacobian[:-1, lit] = share * rows
        jacobian[-1, lit] = share * light
        data = residual + known - plane.template.ravel()
        solved = eliminate(
            basis, weights.reshape(shape), jacobian.reshape(-1, *shape), data.reshape(shape), field.amplitude
        )
        self._solved: Eliminated = solved
        self._size = len(rows)
        full, gradient = solved.information, solved.gradient
        # the gain is this channel's own
        pivot = max(full[-1, -1], 1e-12)
        self._reaction, self._own = full[-1, :-1] / pivot, gradient[-1] / pivot
        self.information = full[:-1, :-1] - np.outer(full[:-1, -1], self._reaction)
        self.gradient = gradient[:-1] - full[:-1, -1] * self._own
        self._basis, self.amplitude = basis, field.amplitude

    def gain_step(self, step: Array) -> float:
        """How the log gain answers to a step of the pose."""
        return float(np.clip(self._own - self._reaction @ step, -1.0, 1.0))

    def coefficients(self, step: Array, gain: float) -> Array:
        """The albedo's modes after the step."""
        c = self._solved.coefficients(np.append(step, gain))
        self.amplitude = self._basis.learnt_amplitude(c, self._solved.variances, self.amplitude)
        return c


def _correlation(residuals: Array, inner: NDArray[np.bool_], block: int = 7) -> float:
    """Variance of means over blocks of whitened residuals, times the block's size, over the bins' own variance."""
    full = np.clip(residuals, -4.0, 4.0)
    share = cv2.blur(inner.astype(float), (block, block))
    means = cv2.blur(full, (block, block))[share > 0.99]
    if len(means) < 2 * block**2:
        return 1.0
    single = float(np.var(full[inner]))
    return float(np.clip(block**2 * np.var(means) / max(single, 1e-12), 1.0, 30.0))


def _base(signal: Array, ambient: Array, dark: NDArray[np.bool_]) -> float:
    """Log albedo of the surroundings."""
    if np.count_nonzero(dark) < 10:
        dark = np.ones_like(dark)
    return float(np.log(max(float(np.median(signal[dark] / ambient[dark])), 1e-5)))


def _gain(signal: Array, ambient: Array, light: Array, albedo: Array, usable: NDArray[np.bool_]) -> float:
    """Log of the spotlights' intensity over the ambient irradiance, from the brighter half of what is not clipped."""
    lit = usable & (light > 0.0)
    if np.count_nonzero(lit) < 5:
        return float(np.log(1e3 / max(float(light.max(initial=0.0)), 1e-9)))
    ratio = (signal[lit] / albedo[lit] - ambient[lit]) / light[lit]
    bright = light[lit] >= np.quantile(light[lit], 0.5)
    return float(np.log(max(float(np.median(ratio[bright])), 1e-3 / float(light.max()))))
