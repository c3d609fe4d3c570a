"""One rule for residuals: how a bin's light misses the model, how much a miss counts, and how far misses scatter."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from conespot.localize.model.view import Shown

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ResidualSettings:
    """Tuned numbers of residuals; halved and doubled by `benchmarks/tuned_numbers.py residual`."""

    #: degrees of freedom of Student's t. On a photographed fundus 4 gained a factor of 2 to 3 over Poisson weights;
    #: here 2 costs 10 % on clipped rims and refuses one more of 12, 8 gains 2 %
    student: float = 4.0
    #: share of the model's light below which a bin counts as that dark, so that its logarithm is finite: halved or
    #: doubled, no error changes in its third digit
    darkest: float = 0.02
    #: share of the model's light by which a bin may miss it to be taken to first order. On soft patches 0.15, 0.3 and
    #: 0.6 change no error by more than 4 %, on edges 0.25 and 1 by 3 %
    linear: float = 0.5
    #: and standard deviations of the sensor's noise within which it is taken so, however dark it is: the mean logarithm
    #: of noise is low. Without them, soft patches of `gross_errors` at 850 nm, around which it is darker than the read
    #: noise, put the tips with the largest chi-squared 2 to 3 um too far along the axis, at a stated 0.5
    noise_sigmas: float = 4.0
    #: whitened residuals count up to here in the misfit; it means what it does together with the verdict's limit. At
    #: 2.5 the limit of 2.5 can refuse nothing, at 10 it refuses 2 of 12 good fits on hard edges
    gross: float = 5.0
    #: however many gross errors there are, a fit follows its data at least so far: halved, no answer changes; doubled,
    #: no error in its third digit
    least_follows: float = 0.3
    #: the albedo's rest, from below what any sensor resolves (halved or doubled, no error changes in its third digit)
    #: to as much as a disc's rim (either way errors change by 1 %, and one of 12 clipped patches more is answered)
    rest: tuple[float, float] = (1e-4, 0.3)


RESIDUAL = ResidualSettings()


def incident_light(ambient: Array, spotlights: Array) -> Array:
    """All light that falls on bins, of any one shape; not a number where a model leaves none, and its fit ends there.

    A spread that is being sought is continued in a straight line to below none, where a bright spotlight's foot takes
    off more than the microscope's light. A fit that went on from there was 179 um off where a tremor was told wrongly.
    """
    light = ambient + spotlights
    return np.where(light > 0.0, light, np.nan)


def log_residuals(shown: Shown, model: Array, variance: Array | float = 0.0) -> tuple[Array, NDArray[np.bool_]]:
    """Log of the light that a channel's bins show over the `model`'s [white], and which of them are bounds only.

    To first order where they nearly agree, or differ by no more than the sensor's noise does, of that `variance` over
    the model's square: the mean of a logarithm of noise is not that of noise. An edge's bins give none: where no other
    light is about, their model is next to none a pixel beyond the rim, and a fit that takes what is there to first
    order creeps and does not settle. A clipped bin says only that its light is above white.
    """
    relative = shown.signal / model - 1.0
    log = np.log(np.maximum(shown.signal, RESIDUAL.darkest * model) / model)
    near = np.maximum(RESIDUAL.linear, RESIDUAL.noise_sigmas * np.sqrt(variance))
    residual = np.where(np.abs(relative) < near, relative, log)
    bound = shown.clipped & (model < 1.0)
    residual[bound] = -np.log(np.maximum(model[bound], 1e-6))
    return residual, bound


def censored(beyond: Array, sigma: Array) -> tuple[Array, Array]:
    """Residuals and the share of a measurement that they are worth, of bins of which only a bound is known.

    The light is above white, which is `beyond` the model in its logarithm (negative where the model is above white
    too), and a measurement would scatter by `sigma` (J. Tobin, Estimation of relationships for limited dependent
    variables, Econometrica 26, 1958). The log likelihood is log Q(z) with z = beyond / sigma; its slope and curvature
    are h / sigma and h (h - z) / sigma^2 with the hazard h = phi / Q. Bins that are as bright and yet measured err
    downwards, and these make up for it.
    """
    z = beyond / sigma
    hazard = np.exp(-0.5 * np.square(z) - 0.5 * math.log(2.0 * math.pi) - log_ndtr(-z))
    # the difference is 1 / z for large ones, where rounding eats it
    off = np.where(z < 1e3, hazard - z, 1.0 / np.maximum(z, 1e3))
    return np.asarray(sigma / off), np.asarray(np.minimum(hazard * off, 1.0))


def student_weights(residuals: Array) -> Array:
    """Weights of iteratively reweighted least squares for whitened residuals that follow Student's t."""
    return np.asarray((RESIDUAL.student + 1.0) / (RESIDUAL.student + np.square(residuals)))


def student_cost(residuals: Array) -> float:
    """Minus twice the log-likelihood of whitened residuals that follow Student's t, but for a constant."""
    return float(np.sum((RESIDUAL.student + 1.0) * np.log1p(np.square(residuals) / RESIDUAL.student)))


def follows(weights: Array, residuals: Array) -> float:
    """How far a robust fit of these `weights` follows its data, over the same weights of least squares.

    It goes by the slope of the residuals' influence, which is 1 for small ones and -1 for gross errors.
    """
    square = np.square(residuals)
    bend = (RESIDUAL.student - square) / (RESIDUAL.student + square)
    return max(RESIDUAL.least_follows, float(np.sum(weights * bend) / max(np.sum(weights), 1e-300)))


def rms(whitened: Array) -> float:
    """Root mean square of whitened residuals, gross ones cut; infinite for none."""
    return float(np.sqrt(np.mean(np.minimum(np.square(whitened), RESIDUAL.gross**2)))) if len(whitened) else math.inf


def log_likelihood(whitened: Array, variance: Array) -> float:
    """Of normal residuals, one in the mean, gross ones cut: `whitened` `[N]` were residuals of the `variance` `[N]`."""
    squares = np.minimum(np.square(whitened), RESIDUAL.gross**2)
    return float(-0.5 * np.mean(squares + np.log(2.0 * math.pi * variance))) if len(whitened) else -math.inf


def median(values: Array) -> float:
    """The median of values of any shape, as numpy has it in a tenth of its time; not a number where one is none."""
    half, odd = divmod(values.size, 2)
    least = half if odd else half - 1
    part = np.partition(values, (least, half, values.size - 1), axis=None)
    if math.isnan(part[-1]):
        return math.nan
    return float(part[half]) if odd else float(part[least] + part[half]) / 2.0


def quantile(values: Array, share: float) -> float:
    """A quantile of values of any shape, as numpy has it in a quarter of its time; not a number where one is none."""
    at = share * (values.size - 1)
    least = int(at)
    part = np.partition(values, (least, min(least + 1, values.size - 1), values.size - 1), axis=None)
    if math.isnan(part[-1]):
        return math.nan
    return float(part[least] + (at - least) * (part[min(least + 1, values.size - 1)] - part[least]))


def spread(residuals: Array) -> float:
    """Robust standard deviation: 1.4826 times the median absolute value."""
    return 1.4826 * median(np.abs(residuals)) if len(residuals) else 0.0


def rest(residuals: Array, variances: Array, before: float) -> float:
    """What residuals scatter beyond the sensor's `variances`, one step from `before`: albedo nothing else explains."""
    whole = variances + before**2
    ratio = spread(residuals / np.sqrt(whole)) ** 2
    found = before**2 + (ratio - 1.0) * median(whole)
    least, most = RESIDUAL.rest
    return float(np.sqrt(np.clip(found, least**2, most**2)))
