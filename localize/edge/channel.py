"""What a fit that follows knows of one channel beside the pose: `edge.nuisances` with what a track lets it leave out.

The likelihood is the same. Gain, spreads and scatter start where the last frame's fit left them: spreads are learnt
once a frame, and which bins hold the edge is found once. No template, no light from under the retina.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.moments import Moments, of_shared, strip_scores
from conespot.localize.edge.nuisances import Nuisances, first_levels
from conespot.localize.edge.settings import EDGE
from conespot.localize.edge.strips import Strips
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.residual import RESIDUAL, follows, incident_light, median, rest, rms
from conespot.localize.model.view import Shown

Array = NDArray[np.float64]
_STEEPEST = 50  #: one bin in so many is steeper than the one by which the others are judged


@dataclass(frozen=True, eq=False)
class Kept:
    """What a channel leaves to the next frame, in the words of `Nuisances`."""

    gain: float
    spread: Array  #: `[2]`
    smallest: Array  #: `[2]`
    slow_spread: float
    white: float

    @classmethod
    def of(cls, fitted: Nuisances) -> Kept:
        """What a band's fit leaves; here the strips' own levels are all of them, the slow ones too."""
        spread = np.append(np.hypot(fitted.spread[0], fitted.slow_scatter), fitted.spread[1:])
        return cls(fitted.gain, spread, fitted.smallest, fitted.slow_spread, fitted.white)


class Channel:
    """A channel's bins about one outline, and the equations of `size` shared parameters."""

    def __init__(
        self, shown: Shown, strips: Strips, noise: NoiseModel, irradiance: Array, was: Kept, *, pixels: int, size: int
    ) -> None:
        """Each bin has so many `pixels`, and the microscope's `irradiance` `[N]`."""
        self._shown, self.strips, self._noise, self._pixels, self._size = shown, strips, noise, pixels, size
        self._irradiance = irradiance
        self.kept, self._spread, self._white, self._gain = was, was.spread, was.white, was.gain
        self._slow = np.zeros(len(strips.waves))
        self._levels = np.zeros((0, 2))
        self._level = 0.0
        own = [1e-9, 1e-9, *len(self._slow) * [was.slow_spread**-2]]
        self._precision = np.array(own)
        self._rows = np.empty((size + 1, len(shown.signal)))  # of the shared and the gain
        self._steady: NDArray[np.intp] | None = None
        #: how much more bins tell of the tip's height by the last weights than by those of the last equations
        self.heavier = 1.0

    def equations(self, light: Array, rows: Array) -> tuple[Array, Array]:
        """Information `[size, size]` and gradient `[size]`, all of the channel's own eliminated.

        The spotlights' light is `light` `[N]` with derivatives `rows` `[size, N]`.
        """
        g, size = math.exp(self._gain), self._size
        incident, model, albedo = self._compared(light, g)
        self._shot = self._noise.variance(model) / (self._pixels * model * model)
        if self._steady is None:
            steep = np.abs(rows[2] / incident)
            at = len(steep) - 1 - len(steep) // _STEEPEST
            self._steady = np.flatnonzero(self._shown.usable & (steep > EDGE.steady * np.partition(steep, at)[at]))
        # as far as the outline still is off residuals scatter more, and those at the edge count nonetheless
        self._weigh(self._scatter())
        share = g / incident
        np.multiply(share, rows, out=self._rows[:size])
        self._squares = np.square(self._rows[2])
        self._told, self.heavier = float(self._weights @ self._squares), 1.0
        np.multiply(share, light, out=self._rows[size])
        return self._eliminated(self._residual + albedo)

    def corrected(self, light: Array) -> Array:
        """The gradient `[size]` where a step has led, to `light` `[N]`; slopes are those before it."""
        self._compared(light, math.exp(self._gain))
        self._weigh(self._scatter())
        self.heavier = float(self._weights @ self._squares) / self._told
        weighted = self._residual * (self._weights / self.heavier)
        flat, sloped = self.strips.sums(np.stack([weighted, weighted * self.strips.offset]))
        gradient = np.concatenate([self._rows @ weighted, [flat.sum()], self.strips.waves @ sloped])
        # the strips' own, as far as their priors let them
        flat, sloped = np.stack([flat, sloped]) - (self._levels / np.square(self._spread)).T
        gradient -= self._solved[0][:-1] @ flat + self._solved[1][:-1] @ sloped
        for part, own, now in zip(self._solved, self._of_strips(flat, sloped), self._levels.T, strict=True):
            part[-1] = now + own
        return self._shared(gradient)

    def _compared(self, light: Array, gain: float) -> tuple[Array, Array, Array]:
        """The light that falls on bins, what they should show, and what strips add to its logarithm, `[N]` each."""
        shown, index, offset = self._shown, self.strips.index, self.strips.offset
        incident = incident_light(self._irradiance, gain * light)
        if not len(self._levels):
            self._level, self._levels = first_levels(shown, self.strips, incident, self._levels.shape[1])
        level, slope = self._levels.T
        albedo = level[index] + slope[index] * offset
        model = np.exp(albedo + (self._slow @ self.strips.waves)[index] * offset + self._level) * incident
        residual = shown.signal / model - 1.0
        wide = np.abs(residual) >= RESIDUAL.linear
        if wide.any():
            residual[wide] = np.log(np.maximum(1.0 + residual[wide], RESIDUAL.darkest))
        self._residual = residual
        return incident, model, albedo

    def _scatter(self) -> float:
        """What residuals scatter beyond the sensor's noise, from the bins that hold the edge."""
        if self._steady is None or len(self._steady) <= EDGE.fewest_bins:
            return self._white
        return rest(self._residual[self._steady], self._shot[self._steady], self._white)

    def _weigh(self, white: float) -> None:
        """Weights of the residuals, which scatter by `white` beyond the sensor's noise."""
        self._white, variance = white, self._shot + white**2
        student = RESIDUAL.student
        self._weights = self._shown.usable * (student + 1.0) / (student * variance + np.square(self._residual))

    def _eliminated(self, data: Array) -> tuple[Array, Array]:
        size, strips, many = self._size, self.strips, len(self._rows)
        columns = np.empty((2 * many + 5, len(data)))
        weighted = columns[: many + 1]
        np.multiply(self._rows, self._weights, out=weighted[:many])
        np.multiply(data, self._weights, out=weighted[many])
        np.multiply(weighted, strips.offset, out=columns[many + 1 : -3])
        columns[-3] = self._weights
        np.multiply(self._weights, strips.offset, out=columns[-2])
        np.multiply(columns[-2], strips.offset, out=columns[-1])
        sums = strips.sums(columns)
        # what is the same all over a strip, the level and the slow slopes, needs no sums of its own
        waves, (ones, once, twice) = strips.waves, sums[-3:]
        flat = np.concatenate([sums[:many], ones[None], waves * once, sums[many : many + 1]])
        sloped = np.concatenate([sums[many + 1 : -4], once[None], waves * twice, sums[-4:-3]])
        count = len(flat) - 1
        normal = np.empty((count + 1, count))
        normal[:, many] = flat.sum(axis=1)
        normal[:, many + 1 :] = sloped @ waves.T
        normal[many:count, :many] = normal[:many, many:].T
        normal[[*range(many), count], :many] = weighted @ self._rows.T
        self._system = ones + self._spread[0] ** -2, once, twice + self._spread[1] ** -2
        self._solved = self._of_strips(flat, sloped)
        normal -= flat @ self._solved[0][:count].T + sloped @ self._solved[1][:count].T
        self._information = normal[:count]
        own = np.arange(size, count)
        self._information[own, own] += self._precision
        self._inverse = np.linalg.inv(self._information[size:, size:])
        self._taken = self._inverse @ self._information[size:, :size]
        information = self._information[:size, :size] - self._information[:size, size:] @ self._taken
        return information, self._shared(normal[count])

    def _of_strips(self, flat: Array, sloped: Array) -> tuple[Array, Array]:
        """Levels and slopes of the strips `[..., S]` for weighted sums of columns, and of those times the offset."""
        a, b, d = self._system
        det = a * d - b * b
        return (d * flat - b * sloped) / det, (a * sloped - b * flat) / det

    def _shared(self, gradient: Array) -> Array:
        """The gradient `[size]` of what is shared, from that of all but the strips' own."""
        size = self._size
        gradient[size + 2 :] -= self._precision[2:] * self._slow
        self._gradient = gradient
        return np.asarray(gradient[:size] - self._taken.T @ gradient[size:])

    def learn(self, step: Array) -> None:
        """Take a step `[size]` of what is shared, and what it means for the channel's own."""
        size = self._size
        own = self._inverse @ self._gradient[size:] - self._taken @ step
        step = np.concatenate([step, np.clip(own, -1.0, 1.0)])
        self._gain += float(step[size])
        self._level += float(step[size + 1])
        self._slow = self._slow + step[size + 2 :]
        self._levels = np.stack([part[-1] - step @ part[:-1] for part in self._solved], axis=1)

    def leave(self) -> Kept:
        """What the next frame starts from; the spreads as this frame's levels have them (MacKay 1992)."""
        squares, count = np.square(self._levels).sum(axis=0), len(self._levels)
        a, b, d = self._system
        variance = np.array([np.mean(d / (a * d - b * b)), np.mean(a / (a * d - b * b))])
        known = np.maximum(count * (1.0 - variance / self._spread**2), 1.0)
        spread = np.clip(np.sqrt(squares / known), self.kept.smallest, EDGE.widest * self._spread)
        return Kept(self._gain, spread, self.kept.smallest, self.kept.slow_spread, self._white)

    @property
    def misfit(self) -> float:
        """Rms of the whitened residuals, gross ones cut."""
        return rms(self._whitened[self._shown.usable])

    @property
    def _whitened(self) -> Array:
        return np.asarray(self._residual / np.sqrt(self._shot + self._white**2))

    @property
    def contrast(self) -> float:
        """Median light deep inside the band over that outside."""
        offset, usable = self.strips.offset, self._shown.usable
        inside, outside = usable & (offset < 0.7 * float(offset.min())), usable & (offset > 1.0)
        if not inside.any() or not outside.any():
            return 0.0
        signal = self._shown.signal
        return median(signal[inside]) / max(median(signal[outside]), 1e-9)

    def scores(self, size: int) -> tuple[Array, Array, Array]:
        """The strips' gradients `[S, size]` and informations `[S, size, size]` of the first `size` shared parameters.

        And the covariance `[size, size]` of what the channel's own priors add to the gradient.
        """
        rows = np.concatenate([self._rows[:size], self._rows[self._size :]])
        moments = Moments.of(self.strips, rows, self._residual, self._weights, self._levels)
        gradient, own = strip_scores(moments, np.asarray(self._spread))
        whole = own.sum(axis=2)
        mine = np.arange(size, len(whole))
        whole[mine, mine] += self._precision
        taken = np.concatenate([np.eye(size), -np.linalg.solve(whole[size:, size:], whole[size:, :size]).T], axis=1)
        known = (taken[:, size:] * self._precision) @ taken[:, size:].T
        follow = follows(self._weights * np.square(rows[size]), self._whitened)
        return (taken @ gradient).T / follow, of_shared(own, taken), known
