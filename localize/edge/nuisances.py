"""What a band knows of one channel beside the pose: the spotlights' gain, and the albedo along the strips."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.settings import EDGE
from conespot.localize.edge.strips import Eliminated, Strips, strip_scores
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.residual import follows, log_residuals, rest, rms, student_weights
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
    spread: Array  #: prior sigma of levels and slopes `[2]`
    smallest: Array  #: `[2]`
    level: float = math.nan  #: log albedo of all strips
    slow: Array = field(default_factory=lambda: np.zeros(0))  #: slopes that vary slowly around the outlines
    slow_spread: float = 0.0  #: and their prior sigma
    told: tuple[float, float] | None = None  #: what tells the gain beside the band, and its sigma
    levels: Array = field(default_factory=lambda: np.zeros((0, 2)))  #: of each strip beyond it, and slope `[S, 2]`
    white: float = EDGE.white  #: what residuals scatter beyond the sensor's noise

    def evaluate(self, irradiance: Array, light: Array, rows: Array) -> None:
        """Residuals, weights and Jacobian where the spotlights' light is `light` `[N]` with derivatives `rows`."""
        g, shown = math.exp(self.gain), self.shown
        incident = irradiance + g * light
        brightness = np.exp(shown.template) * incident
        if math.isnan(self.level):
            self._begin(brightness)
        albedo = self.level + self.slow @ self.strips.slow + self.strips.log_albedo(self.levels)
        model = np.exp(albedo) * brightness
        residual, bound = log_residuals(shown, model)
        use = shown.usable | bound
        variance = self.noise.variance(model) / self.pixels / np.square(np.maximum(model, 1e-9))
        # the scatter that counts is that of the bins which hold the edge, and it tells how far the edge still is off
        pull = np.abs(rows[2]) / incident
        steady = use & (pull > EDGE.steady * np.quantile(pull, 0.98))
        if np.count_nonzero(steady) > 30:
            self.white = rest(residual[steady], variance[steady], self.white)
        variance = variance + self.white**2
        whitened = residual / np.sqrt(variance)
        self.weights = use / variance * student_weights(whitened)
        self.misfit = rms(whitened[use])
        share = g / incident
        self.jacobian = np.concatenate(
            [share * rows, (share * light)[None], np.ones((1, len(model))), self.strips.slow]
        )
        self.residual = residual
        self.follows = follows(self.weights * np.square(self.jacobian[len(rows)]), whitened)

    def _begin(self, brightness: Array) -> None:
        """Take what bins show over the model's brightness `[N]` for the albedo."""
        shown = self.shown
        ratio = self.strips.sums(np.where(shown.usable, np.clip(shown.signal / brightness, 0.0, None), 0.0))
        number = self.strips.sums(shown.usable.astype(float))
        overall = max(float(ratio.sum() / max(number.sum(), 1.0)), 1e-9)
        mean = np.where(number > 0, ratio / np.maximum(number, 1.0), overall)
        self.level = math.log(overall)
        self.levels = np.stack([np.log(np.clip(mean / overall, 0.05, 20.0)), np.zeros(len(mean))], axis=1)
        self.slow, self.slow_spread = np.zeros(len(self.strips.slow)), float(self.spread[1])

    @property
    def precision(self) -> Array:
        """Prior precision of gain, level and slow slopes."""
        gain = 1e-9 if self.told is None else self.told[1] ** -2
        return np.concatenate([[gain, 1e-9], np.full(len(self.slow), self.slow_spread**-2)])

    def eliminated(self, size: int) -> Eliminated:
        """The normal equations of `size` shared parameters, gain, level and slow slopes, the strips' own eliminated."""
        data = self.residual + self.strips.log_albedo(self.levels)
        part = Eliminated.of(self.strips, self.jacobian, data, self.weights, self.spread)
        own = range(size, len(part.gradient))
        part.information[own, own] += self.precision
        part.gradient[size + 2 :] -= self.precision[2:] * self.slow
        if self.told is not None:
            part.gradient[size] -= self.precision[0] * (self.gain - self.told[0])
        return part

    def scores(self) -> tuple[Array, Array]:
        """The strips' own gradients `[S, P]` and informations `[S, P, P]`."""
        return strip_scores(self.strips, self.jacobian, self.residual, self.weights, self.levels, self.spread)

    def learn(self, part: Eliminated, step: Array) -> None:
        """Take a step `[P]`: gain, level, the strips' levels and, from those, how much they scatter (MacKay 1992)."""
        own = step[-2 - len(self.slow) :]
        self.gain += float(own[0])
        self.level += float(own[1])
        self.slow = self.slow + own[2:]
        self.levels = part.levels(step)
        known = np.maximum(1.0 - part.variance / self.spread**2, 0.0).sum(axis=0)
        found = np.sqrt(np.square(self.levels).sum(axis=0) / np.maximum(known, 1.0))
        self.spread = np.clip(found, self.smallest, EDGE.widest * self.spread)
        # albedo has no direction: across the outline it changes as much as along
        self.slow_spread = max(self.strips.slow_gradient(self.levels[:, 0]), float(self.smallest[1]))


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
