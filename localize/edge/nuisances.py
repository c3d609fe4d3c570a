"""What a band knows of one channel beside the pose: the spotlights' gain, and the albedo along the strips."""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.moments import Eliminated, Moments, strip_scores
from conespot.localize.edge.settings import EDGE
from conespot.localize.edge.strips import Strips
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.residual import (
    censored,
    follows,
    incident_light,
    log_likelihood,
    log_residuals,
    quantile,
    rest,
    rms,
    student_weights,
)
from conespot.localize.model.solve import inverse
from conespot.localize.model.view import Shown

Array = NDArray[np.float64]


@dataclass
class Nuisances:
    """Of one channel, with its bins' residuals as they stand."""

    shown: Shown
    strips: Strips
    noise: NoiseModel
    pixels: int  #: in a bin
    gain: float  #: log of the spotlights' intensity over the ambient irradiance
    spread: Array  #: prior sigma of levels and slopes, and of the odds of deep light where there is any `[2 or 3]`
    smallest: Array  #: `[2 or 3]`
    level: float = math.nan  #: log albedo of all strips
    slow: Array = field(default_factory=lambda: np.zeros(0))  #: slopes, and more, that vary slowly around the outlines
    slow_spread: float = 0.0  #: prior sigma of those slopes
    slow_level: float = EDGE.level  #: and of levels and odds
    told: tuple[float, float] | None = None  #: what tells the gain beside the band, and its sigma
    #: of each strip beyond it, slope, and odds `[S, 2 or 3]`
    levels: Array = field(default_factory=lambda: np.zeros((0, 2)))
    white: float = EDGE.white  #: what residuals scatter beyond the sensor's noise

    def evaluate(self, irradiance: Array, light: Array, rows: Array, odds: Array | None) -> None:
        """Residuals, weights and Jacobian where the spotlights' light is `light` `[N]` with derivatives `rows`.

        Of light from under the retina `odds` `[N]` is its derivative by the logarithm of that one's.
        """
        g, shown = math.exp(self.gain), self.shown
        incident = incident_light(irradiance, g * light)
        if odds is not None:
            self.strips = replace(self.strips, odds=g / incident * odds)
        brightness = np.exp(shown.template) * incident
        if math.isnan(self.level):
            self._begin(brightness)
        albedo = self.level + self.strips.log_albedo(self.levels, self.slow)
        self.model = model = np.exp(albedo) * brightness
        residual, bound = log_residuals(shown, model)
        use = shown.usable | bound
        variance = self.noise.variance(model) / self.pixels / np.square(np.maximum(model, 1e-9))
        # the scatter that counts is that of the bins which hold the edge, and it tells how far the edge still is off
        pull = np.abs(rows[2]) / incident
        steady = use & (pull > EDGE.steady * quantile(pull, 0.98))
        if np.count_nonzero(steady) > 30:
            self.white = rest(residual[steady], variance[steady], self.white)
        variance = variance + self.white**2
        whitened = residual / np.sqrt(variance)
        self._left = whitened, variance, use
        worth = use.astype(float)
        if shown.clipped.any():
            over, beyond = shown.clipped, -np.log(np.maximum(model[shown.clipped], 1e-6))
            residual[over], worth[over] = censored(beyond, np.sqrt(variance[over]))
            whitened = residual / np.sqrt(variance)
        self.weights = worth / variance * student_weights(whitened)
        self._share = share = g / incident
        self.rows = np.concatenate([share * rows, (share * light)[None]])
        self.residual, self._whitened = residual, whitened

    def along(self, rows: Array) -> Nuisances:
        """The same as it was evaluated, with the light's derivatives `rows` `[P, N]` by other shared parameters."""
        other = copy(self)
        other.rows = np.concatenate([self._share * rows, self.rows[-1:]])
        return other

    def _begin(self, brightness: Array) -> None:
        """Take what bins show over the model's brightness `[N]` for the albedo."""
        self.level, self.levels = first_levels(self.shown, self.strips, brightness, len(self.spread))
        self.slow, self.slow_spread = np.zeros(len(self.strips.slow[0])), float(self.spread[1])

    @property
    def misfit(self) -> float:
        """Rms of the residuals where they were last evaluated, outliers cut, over what the model expects."""
        whitened, _, use = self._left
        return rms(whitened[use])

    @property
    def follows(self) -> float:
        """How far the fit follows its data there, over least squares of the same weights."""
        return follows(self.weights * np.square(self.rows[-1]), self._whitened)

    @property
    def likelihood(self) -> float:
        """Log-likelihood of the bins where they were last evaluated, one in the mean."""
        whitened, variance, use = self._left
        return log_likelihood(whitened[use], variance[use])

    @property
    def precision(self) -> Array:
        """Prior precision of gain, level and slow slopes."""
        gain = 1e-9 if self.told is None else self.told[1] ** -2
        spreads = [self.slow_spread, *self.strips.slow_levels * [self.slow_level]]
        return np.concatenate([[gain, 1e-9], np.repeat(np.array(spreads) ** -2, len(self.slow) // len(spreads))])

    def eliminated(self, size: int) -> Eliminated:
        """The normal equations of `size` shared parameters, gain, level and slow slopes, the strips' own eliminated."""
        precision = self.precision
        moments = Moments.of(self.strips, self.rows, self.residual, self.weights, self.levels)
        part = Eliminated.of(moments, self.spread)
        own = range(size, len(part.gradient))
        part.information[own, own] += precision
        part.gradient[size + 2 :] -= precision[2:] * self.slow
        if self.told is not None:
            part.gradient[size] -= precision[0] * (self.gain - self.told[0])
        return part

    def scores(self) -> tuple[Array, Array]:
        """The strips' own gradients `[P, S]` and informations `[P, P, S]`."""
        moments = Moments.of(self.strips, self.rows, self.residual, self.weights, self.levels)
        return strip_scores(moments, self.spread)

    @property
    def slow_scatter(self) -> float:
        """Rms of the levels that vary slowly."""
        return float(np.sqrt(np.mean(np.square(self._slow_levels @ self.strips.waves))))

    @property
    def _slow_levels(self) -> Array:
        """The levels that vary slowly `[5 T]`."""
        count = len(self.strips.waves)
        return self.slow[count : 2 * count]

    def learn(self, part: Eliminated, step: Array) -> None:
        """Take a step `[P]`: gain, level, the strips' levels and, from those, how much they scatter (MacKay 1992)."""
        own = step[-2 - len(self.slow) :]
        self.gain += float(own[0])
        self.level += float(own[1])
        self.slow = self.slow + own[2:]
        self.levels = part.levels(step)
        known = np.maximum(1.0 - part.variance / self.spread[:, None] ** 2, 0.0).sum(axis=1)
        found = np.sqrt(np.square(self.levels).sum(axis=0) / np.maximum(known, 1.0))
        self.spread = np.clip(found, self.smallest, EDGE.widest * self.spread)
        # albedo has no direction: across the outline it changes as much as along
        levels = self.levels[:, 0] + self._learn_slow_levels(part) @ self.strips.waves
        if self.strips.odds is not None:
            # nor do a strip's own bins tell its slope where the step is low; and odds vary as the albedo does
            self.spread[1:] = np.maximum(self.spread[1:], [self.strips.gradient(levels), self.spread[0]])
        self.slow_spread = max(self.strips.slow_gradient(levels), float(self.smallest[1]))

    def _learn_slow_levels(self, part: Eliminated) -> Array:
        """The levels that vary slowly `[5 T]`, once they have told how much they do (MacKay 1992)."""
        slow, count = self._slow_levels, len(self.strips.waves)
        first = len(part.gradient) - len(self.slow) + count
        variance = np.diag(inverse(part.information))[first : first + count]
        known = max(float(np.sum(np.maximum(1.0 - variance / self.slow_level**2, 0.0))), 1.0)
        self.slow_level = float(np.clip(np.linalg.norm(slow) / math.sqrt(known), self.smallest[0], EDGE.level))
        return slow


def first_levels(shown: Shown, strips: Strips, brightness: Array, own: int) -> tuple[float, Array]:
    """Log albedo of all strips, and each one's `own` beyond it `[S, own]`: what bins show over a brightness `[N]`."""
    ratio = strips.sums(np.where(shown.usable, np.clip(shown.signal / brightness, 0.0, None), 0.0))
    number = strips.sums(shown.usable.astype(float))
    overall = max(float(ratio.sum() / max(number.sum(), 1.0)), 1e-9)
    mean = np.where(number > 0, ratio / np.maximum(number, 1.0), overall)
    levels = np.zeros((len(mean), own))
    levels[:, 0] = np.log(np.clip(mean / overall, 0.05, 20.0))
    return math.log(overall), levels


def gain_over(shown: Shown, irradiance: Array, light: Array, offset: Array, around: float) -> float:
    """Log of the spotlights' intensity over the ambient irradiance, of which the surroundings show `around` [white]."""
    inside = shown.usable & (offset < -1.0)
    if np.count_nonzero(inside) < 5 or not around > 0.0:
        return math.log(1e3 / max(float(light.max(initial=0.0)), 1e-9))
    lit = np.exp(-shown.template[inside]) * shown.signal[inside]
    excess = float(np.median((lit / around - irradiance[inside]) / light[inside]))
    return math.log(max(excess, 1e-3 / float(light.max())))


def first_gain(shown: Shown, irradiance: Array, light: Array, offset: Array) -> float:
    """Log of the spotlights' intensity over the ambient irradiance from the two sides of a band."""
    signal, usable = shown.signal / np.exp(shown.template), shown.usable
    dark = light <= EDGE.dark * float(light.max(initial=0.0))
    inside, outside = usable & ~dark & (offset < -1.0), usable & dark & (offset > 1.0)
    if np.count_nonzero(inside) < 5 or np.count_nonzero(outside) < 5:
        return math.log(1e3 / max(float(light.max(initial=0.0)), 1e-9))
    albedo = max(float(np.median(signal[outside] / irradiance[outside])), 1e-6)
    excess = float(np.median((signal[inside] / albedo - irradiance[inside]) / light[inside]))
    return math.log(max(excess, 1e-3 / float(light.max())))
