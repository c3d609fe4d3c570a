"""Maximum likelihood on a band of bins along the outlines, cut into strips across the edge with an albedo of their own.

In each strip the log albedo is a level and a slope, both eliminated: a vessel or a shade that crosses the edge changes
both sides alike and leaves the edge where it is. How much levels and slopes scatter is learnt from the band itself.
What remains is the position of the beam's own profile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.ribbon import Ribbon
from conespot.localize.edge.sandwich import EdgeFit
from conespot.localize.edge.strips import Eliminated, Strips, score_covariance, strip_scores
from conespot.localize.model.forward import ambient_irradiance, look
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.prior import Estimate, Knowns, prior_rows
from conespot.localize.model.solve import reduction, rest, solved, student_bend, student_weights
from conespot.localize.model.view import Channel, Unlit, spotlight_irradiance

Array = NDArray[np.float64]
#: where the spreads of the strips' log albedo start: level, and gradient per mm of a fundus in green light
_LEVEL, _SLOPE_PER_MM = 0.3, 3.0
_SMALLEST = 1e-3  # spread of levels, and of slopes over the width of the band
_LONGEST_STEP_BINS = 3.0


@dataclass
class _Channel:
    """One channel's nuisances, and its bins' residuals as they stand."""

    shown: Channel
    strips: Strips
    noise: NoiseModel
    bins: int  #: pixels in a bin
    gain: float  #: log of the spotlights' intensity over the ambient irradiance
    spread: Array  #: prior sigma of levels and slopes `[2]`
    smallest: Array  #: `[2]`
    level: float = math.nan  #: log albedo of all strips
    slow: Array = field(default_factory=lambda: np.zeros(0))  #: slopes that vary slowly around the outlines
    slow_spread: float = 0.0  #: and their prior sigma
    levels: Array = field(default_factory=lambda: np.zeros((0, 2)))  #: of each strip beyond it, and slope `[S, 2]`
    white: float = 0.05  #: what residuals scatter beyond the sensor's noise

    def evaluate(self, irradiance: Array, light: Array, rows: Array) -> None:
        """Residuals, weights and Jacobian where the spotlights' light is `light` `[N]` with derivatives `rows`."""
        g, shown = math.exp(self.gain), self.shown
        incident = irradiance + g * light
        brightness = np.exp(shown.template) * incident
        if math.isnan(self.level):
            ratio = self.strips.sums(np.where(shown.usable, np.clip(shown.signal / brightness, 0.0, None), 0.0))
            number = self.strips.sums(shown.usable.astype(float))
            overall = max(float(ratio.sum() / max(number.sum(), 1.0)), 1e-9)
            mean = np.where(number > 0, ratio / np.maximum(number, 1.0), overall)
            self.level = math.log(overall)
            self.levels = np.stack([np.log(np.clip(mean / overall, 0.05, 20.0)), np.zeros(len(mean))], axis=1)
            self.slow, self.slow_spread = np.zeros(len(self.strips.slow)), float(self.spread[1])
        albedo = self.level + self.slow @ self.strips.slow + self.strips.log_albedo(self.levels)
        model = np.exp(albedo) * brightness
        relative = shown.signal / model - 1.0
        residual = np.where(np.abs(relative) < 0.5, relative, np.log(np.maximum(shown.signal, 0.02 * model) / model))
        bound = shown.clipped & (model < 1.0)
        residual[bound] = -np.log(np.maximum(model[bound], 1e-6))
        use = shown.usable | bound
        variance = self.noise.variance(model) / self.bins / np.square(np.maximum(model, 1e-9))
        # the scatter that counts is that of the bins which hold the edge, and it tells how far the edge still is off
        pull = np.abs(rows[2]) / incident
        steady = use & (pull > 0.3 * np.quantile(pull, 0.98))
        if np.count_nonzero(steady) > 30:
            self.white = rest(residual[steady], variance[steady], self.white)
        variance = variance + self.white**2
        whitened = residual / np.sqrt(variance)
        self.weights = use / variance * student_weights(whitened)
        self.misfit = float(np.sqrt(np.mean(np.minimum(np.square(whitened[use]), 25.0)))) if use.any() else math.inf
        share = g / incident
        self.jacobian = np.concatenate(
            [share * rows, (share * light)[None], np.ones((1, len(model))), self.strips.slow]
        )
        self.residual = residual
        # a robust fit follows its data by the slope of their influence, where least squares goes by the weight
        effect = self.weights * np.square(self.jacobian[len(rows)])
        self.follows = max(0.3, float(np.sum(effect * student_bend(whitened)) / max(np.sum(effect), 1e-300)))

    @property
    def precision(self) -> Array:
        """Prior precision of gain, level and slow slopes."""
        return np.concatenate([[1e-9, 1e-9], np.full(len(self.slow), self.slow_spread**-2)])

    def eliminated(self) -> Eliminated:
        """The normal equations of pose, free quantities, gain and level without the strips' own levels."""
        data = self.residual + self.strips.log_albedo(self.levels)
        return Eliminated.of(self.strips, self.jacobian, data, self.weights, self.spread)

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
        self.spread = np.clip(found, self.smallest, 5.0 * self.spread)
        # albedo has no direction: across the outline it changes as much as along
        self.slow_spread = max(self.strips.slow_gradient(self.levels[:, 0]), float(self.smallest[1]))


@dataclass(frozen=True)
class BandFit(EdgeFit):
    """A fitted band."""

    channels: tuple[_Channel, ...]

    @property
    def gains(self) -> tuple[float, ...]:
        """Log of the spotlights' intensity over the ambient irradiance, a channel each."""
        return tuple(channel.gain for channel in self.channels)

    @property
    def misfit(self) -> float:
        """Rms of the residuals, outliers cut, over what the model expects."""
        return float(np.sqrt(np.mean(np.square([channel.misfit for channel in self.channels]))))

    def scatter(self) -> Array:
        """Covariance of the gradient `[P, P]` as the strips' residuals show it."""
        size, strips = len(self.information), self.channels[0].strips
        scores, parts = np.zeros((strips.count, size)), np.zeros((strips.count, size, size))
        known = self.prior.T @ self.prior
        for channel in self.channels:
            gradient, own = channel.scores()
            whole = own.sum(axis=0)
            whole[range(size, len(whole)), range(size, len(whole))] += channel.precision
            reduced = reduction(whole, size)
            known = known + (reduced[:, size:] * channel.precision) @ reduced[:, size:].T
            scores = scores + gradient @ reduced.T / channel.follows
            parts = parts + reduced @ own @ reduced.T
        return score_covariance(strips, scores, parts) + known


def fit_band(
    image: NDArray[np.generic],
    start: Estimate,
    before: BandFit | None,
    knowns: Knowns,
    noise: NoiseModel,
    *,
    side: int,
    inner: float,
    outer: float,
    iterations: int,
    enough: float,
    tied: bool = False,
    unlit: Unlit | None = None,
) -> BandFit | None:
    """Fit the pose to bins of `side` x `side` px from `inner` bins inside the outlines to `outer` bins outside.

    Gain and spreads of the albedo start from those of the fit `before`, or from the band itself and a usual retina. A
    step shorter than `enough` sigmas of uncorrelated residuals ends the iterations. With `tied` the axis stays on the
    RCM. `unlit` tells the albedo as far as it shows it. None if too little of the outlines is in the frame or the
    equations are singular.
    """
    nominal, estimate = start.scene, start
    roll = len(nominal.spotlights) > 1
    pose_size = 6 if roll else 5
    size = pose_size + len(knowns.free)
    used = replace(knowns, rcm_sigma_mm=0.0) if tied else knowns
    band = Ribbon.along(image, estimate, side=side, inner=inner, outer=outer, unlit=unlit)
    if band is None:
        return None
    sight = look(nominal, band.pixels, side)
    irradiance = ambient_irradiance(sight, nominal)
    pitch = nominal.camera.pixel_pitch * side
    channels: list[_Channel] = []
    information, pj, step = np.eye(size), np.zeros((0, size)), np.zeros(size)
    for turn in range(iterations):
        light, rows = spotlight_irradiance(sight, estimate, knowns, band.pixels, side, roll=roll)
        if turn == 0:
            for c, shown in enumerate(band.shown):
                if before is None:
                    gain = _first_gain(shown, irradiance, light, band.strips.offset)
                    spread = np.array([_LEVEL, _SLOPE_PER_MM * pitch])
                else:
                    gain = before.channels[c].gain
                    spread = before.channels[c].spread * [1.0, side / math.sqrt(before.channels[c].bins)]
                smallest = np.array([_SMALLEST, _SMALLEST / (inner + outer)])
                channels.append(_Channel(shown, band.strips, noise, side**2, gain, spread, smallest))
        pr, pj = prior_rows(estimate, nominal, used, pose_size)
        information, gradient = pj.T @ pj, -pj.T @ pr
        parts = []
        for channel in channels:
            channel.evaluate(irradiance, light, rows)
            part = channel.eliminated()
            part.information[range(size, len(part.gradient)), range(size, len(part.gradient))] += channel.precision
            part.gradient[size + 2 :] -= channel.precision[2:] * channel.slow
            reduced = reduction(part.information, size)
            parts.append(part)
            information = information + reduced @ part.information @ reduced.T
            gradient = gradient + reduced @ part.gradient
        found = solved(information, gradient)
        if found is None:
            return None
        step = found
        reach = float(np.max(np.abs(step[:3])))
        step = step / max(1.0, reach / max(0.1, _LONGEST_STEP_BINS * pitch), float(np.max(np.abs(step[3:5]))) / 0.05)
        estimate = estimate.moved(step, pose_size, knowns.free)
        for channel, part in zip(channels, parts, strict=True):
            own = solved(part.information[size:, size:], part.gradient[size:] - part.information[size:, :size] @ step)
            channel.learn(
                part, np.append(step, np.zeros(len(part.gradient) - size) if own is None else np.clip(own, -1.0, 1.0))
            )
        length = float(step @ information @ step)
        if length < enough**2 and turn >= 2:
            break
    return BandFit(estimate, information, pj, step, band.covered, tuple(channels))


def _first_gain(shown: Channel, irradiance: Array, light_: Array, offset: Array) -> float:
    """Log of the spotlights' intensity over the ambient irradiance from the band's two sides."""
    signal, usable = shown.signal / np.exp(shown.template), shown.usable
    inside, outside = usable & (light_ > 0.0) & (offset < -1.0), usable & (light_ <= 0.0) & (offset > 1.0)
    if np.count_nonzero(inside) < 5 or np.count_nonzero(outside) < 5:
        return math.log(1e3 / max(float(light_.max(initial=0.0)), 1e-9))
    albedo = max(float(np.median(signal[outside] / irradiance[outside])), 1e-6)
    excess = float(np.median((signal[inside] / albedo - irradiance[inside]) / light_[inside]))
    return math.log(max(excess, 1e-3 / float(light_.max())))
