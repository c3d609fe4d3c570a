"""Maximum likelihood on a band of bins along the outlines, cut into strips across the edge with an albedo of their own.

In each strip the log albedo is a level and a slope, both eliminated: a vessel or a shade that crosses the edge changes
both sides alike and leaves the edge where it is. How much levels and slopes scatter is learnt from the band itself.
What remains is the position of the beam's own profile.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.moments import Eliminated, of_shared
from conespot.localize.edge.nuisances import Nuisances, first_gain, gain_over
from conespot.localize.edge.ribbon import Ribbon
from conespot.localize.edge.rounding import Rounding
from conespot.localize.edge.sandwich import EdgeFit
from conespot.localize.edge.seen import Seen
from conespot.localize.edge.settings import EDGE
from conespot.localize.edge.strips import score_covariance
from conespot.localize.edge.surroundings import surroundings
from conespot.localize.image import Frame, Reference
from conespot.localize.model.deep import Deep
from conespot.localize.model.doubt import contradicted
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import ambient_irradiance
from conespot.localize.model.irradiance import Irradiance, Lights
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.prior import prior_rows
from conespot.localize.model.quantity import quantity
from conespot.localize.model.solve import limited, reduction, solved
from conespot.localize.model.suspicion import matter, watched
from conespot.localize.model.suspicion import scores as score_tests
from conespot.localize.outcome import COVERED, UNCERTAIN, LocalizationFailure
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
BLUR = quantity("blur")


@dataclass(frozen=True)
class Stage:
    """Bins of `side` x `side` px up to `inner` bins inside the outlines and `outer` outside, and when a fit is done."""

    side: int
    inner: float
    outer: float
    iterations: int  #: at most
    enough: float  #: a step that is shorter ends them [sigmas of uncorrelated residuals]


@dataclass(frozen=True)
class BandFit(EdgeFit):
    """A fitted band."""

    channels: tuple[Nuisances, ...]  #: before the last step
    seen: Seen

    @property
    def gains(self) -> tuple[float, ...]:
        """Log of the spotlights' intensity over the ambient irradiance, a channel each."""
        return tuple(channel.gain for channel in self.channels)

    @property
    def misfit(self) -> float:
        """Rms of the residuals, outliers cut, over what the model expects."""
        return float(np.sqrt(np.mean(np.square([channel.misfit for channel in self.channels]))))

    @property
    def likelihood(self) -> float:
        """Log-likelihood of the bins, one in the mean."""
        return float(np.mean([channel.likelihood for channel in self.channels]))

    def scatter(self) -> Array:
        """Covariance of the gradient `[P, P]` as the strips' residuals show it."""
        return self._scatter(self.channels, self.prior)

    @cached_property
    def there(self) -> tuple[Nuisances, ...]:
        """The channels where the fit stands, evaluated after its last step; those of the fit stay as they are."""
        lights, channels = self.seen.lights(self.estimate, self.knowns.doubting), tuple(map(copy, self.channels))
        for c, channel in enumerate(channels):
            channel.evaluate(self.seen.irradiance, *lights[c], lights.odds[c] if lights.odds else None)
        return channels

    def contradicts(self, doubted: Knowns, nominal: Scene) -> bool:
        """Whether the band shows that to be otherwise than `nominal` which `doubted` leave free beside its knowns."""
        lights, prior = self.seen.lights(self.estimate, doubted), prior_rows(self.estimate, nominal, doubted)
        channels = [channel.along(lights[c][1]) for c, channel in enumerate(self.there)]
        information, gradient, _ = _equations(channels, prior)
        return contradicted(information, gradient, self.estimate, doubted, self.knowns)

    def suspicions(self, nominal: Scene) -> dict[str, float]:
        """Scores of beam and wall where the fit stands, over their sigmas."""
        knowns, pose_size = self.knowns, self.estimate.pose_size
        wide = watched(knowns, self.estimate.scene)
        blurred = wide if wide.sigma(BLUR) != 0.0 else replace(wide, blur_sigma_mm=None)
        lights = self.seen.lights(self.estimate, blurred)
        at = {q.name: pose_size + i for i, q in enumerate(blurred.free)}
        told = [q.name for q in wide.free if knowns.sigma(q) == 0.0]
        own = [*range(pose_size), *(at[q.name] for q in knowns.free)]
        first = [*own, *(at[name] for name in told)]
        softer = self.seen.softer(self.estimate, lights[0][0])
        also = [] if softer is None else [softer[None]]
        told += ["edge"] * len(also)
        by_blur = [rows[at["blur"]] for _, rows in lights.each]
        others, by_others = self.seen.doubts(self.channels, lights, by_blur, nominal)
        channels = [
            channel.along(np.concatenate([lights[c][1][first], *also, more]))
            for c, (channel, more) in enumerate(zip(self.there, by_others, strict=True))
        ]
        pull, prior = prior_rows(self.estimate, nominal, knowns)
        prior = np.pad(prior, ((0, 0), (0, len(told) + len(others))))
        # where a prior pulls, the slope of what bins say is not zero at the minimum: both together are
        information, gradient, _ = _equations(channels, (pull, prior))
        size = len(own)
        beam, last = np.arange(size + len(told)), np.r_[:size, size + len(told) : len(gradient)]
        found: dict[str, float] = {}
        for names, of in ((told, beam), (others, last)):
            # they take their time, and hardly ever matter
            if matter(names, gradient[of], information[np.ix_(of, of)], size):
                found |= self._scores(names, channels, prior, gradient, information, of)
        return found

    def _scores(
        self,
        names: list[str],
        channels: Sequence[Nuisances],
        prior: Array,
        gradient: Array,
        information: Array,
        of: NDArray[np.intp],
    ) -> dict[str, float]:
        """Scores of the last of some shared parameters `of` all, which have those `names`."""
        rows = [*of, len(gradient)]  # and the gain's
        kept = [copy(channel) for channel in channels]
        for channel in kept:
            channel.rows = channel.rows[rows]
        follows = float(np.mean([channel.follows for channel in channels]))
        scatter, size = self._scatter(kept, prior[:, of]), len(self.information)
        return score_tests(names, gradient[of] / follows, information[np.ix_(of, of)], scatter, size)

    @staticmethod
    def _scatter(channels: Sequence[Nuisances], prior: Array) -> Array:
        """The same of other parameters `[P, P]`, of which the channels have rows and the prior `[Q, P]` too."""
        size, strips = prior.shape[1], channels[0].strips
        scores, parts = np.zeros((strips.count, size)), np.zeros((strips.count, size, size))
        known = prior.T @ prior
        for channel in channels:
            gradient, own = channel.scores()
            whole = own.sum(axis=2)
            whole[range(size, len(whole)), range(size, len(whole))] += channel.precision
            reduced = reduction(whole, size)
            known = known + (reduced[:, size:] * channel.precision) @ reduced[:, size:].T
            scores = scores + (reduced @ gradient).T / channel.follows
            parts = parts + of_shared(own, reduced)
        return score_covariance(strips, scores, parts) + known


def fit_band(
    frame: Frame,
    start: Estimate,
    before: BandFit | None,
    knowns: Knowns,
    noise: NoiseModel,
    reference: Reference | None,
    *,
    stage: Stage,
    tied: bool = False,
) -> BandFit | LocalizationFailure:
    """Fit the pose to the bins of a stage.

    Gain and spreads of the albedo start from those of the fit `before`, or from the band itself and a usual retina.
    With `tied` the axis stays on the RCM. A `reference` tells the albedo as far as it shows it.
    """
    nominal, estimate, side, size = start.scene, start, stage.side, start.pose_size + len(knowns.free)
    used = replace(knowns, rcm_sigma_mm=0.0) if tied else knowns
    band = Ribbon.along(frame, estimate, side=side, inner=stage.inner, outer=stage.outer)
    if band is None:
        return LocalizationFailure(COVERED)
    if reference is not None:
        band = band.told(reference, nominal, noise)
    irradiance = ambient_irradiance(band.sight, nominal)
    pitch = nominal.camera.pixel_pitch * side
    shed = Irradiance(band.sight, band.pixels, side, estimate, knowns, np.ones(len(band.pixels), bool))
    lights = shed(estimate)
    each = 3 if lights.odds else 2  # quantities of a strip
    if before is None:
        usual = np.array([EDGE.level, EDGE.slope_per_mm * pitch, EDGE.level])[:each]
        begin = [(gain, usual, told) for gain, told in _first_gains(frame, estimate, band, irradiance, lights)]
    else:
        per_bin = np.array([1.0, side / math.sqrt(before.channels[0].pixels), 1.0])[:each]
        begin = [(c.gain, c.spread * per_bin, c.told) for c in before.channels]
    smallest = np.array([EDGE.smallest, EDGE.smallest / (stage.inner + stage.outer), EDGE.smallest])[:each]
    rounding, noise = Rounding.of(frame, band, noise)
    channels = [
        Nuisances(shown, band.strips, noise, side**2, gain, spread, smallest, told=told)
        for shown, (gain, spread, told) in zip(band.shown, begin, strict=True)
    ]
    information, pj, step = np.eye(size), np.zeros((0, size)), np.zeros(size)
    for turn in range(stage.iterations):
        if turn:
            lights = shed(estimate)
        pr, pj = prior_rows(estimate, nominal, used)
        for c, channel in enumerate(channels):
            channel.evaluate(irradiance, *lights[c], lights.odds[c] if lights.odds else None)
        information, gradient, parts = _equations(channels, (pr, pj))
        found = _within_bounds(information, gradient, estimate, knowns)
        if found is None:
            return LocalizationFailure(UNCERTAIN)
        step = limited(found, max(EDGE.longest_step_mm, EDGE.longest_step_bins * pitch))
        estimate = estimate.moved(step, knowns.free)
        for channel, part in zip(channels, parts, strict=True):
            channel.learn(part, _with_own(part, step))
        if rounding is not None:
            channels[0].shown = rounding.without(channels[0].model)
        length = float(step @ information @ step)
        if length < stage.enough**2 and turn >= 2:
            break
    if rounding is not None:
        information = rounding.lets_through(information, pj.T @ pj, channels[0])
    seen = Seen(band.sight, band.pixels, side, irradiance, shed)
    return BandFit(estimate, information, pj, step, band.covered, knowns, tuple(channels), seen)


def _within_bounds(information: Array, gradient: Array, at: Estimate, knowns: Knowns) -> Array | None:
    """The step `[P]` that solves the equations, with what is at its end held there; None if nothing solves them."""
    kept = np.arange(len(gradient))
    step = solved(information, gradient)
    while step is not None:
        held = [j for j, each in enumerate(knowns.free, start=at.pose_size) if at.blocked(each, float(step[j]))]
        if not held:
            break
        kept = np.setdiff1d(kept, held)
        part = solved(information[np.ix_(kept, kept)], gradient[kept])
        if part is None:
            return None
        step = np.zeros(len(gradient))
        step[kept] = part
    return step


def _equations(channels: Sequence[Nuisances], prior: tuple[Array, Array]) -> tuple[Array, Array, list[Eliminated]]:
    """Information `[P, P]` and gradient `[P]` of what the channels share, and each with its own still in it.

    The channels are as they were evaluated; the `prior` are residuals and rows.
    """
    pr, pj = prior
    information, gradient = pj.T @ pj, -pj.T @ pr
    size, parts = len(gradient), []
    for channel in channels:
        part = channel.eliminated(size)
        reduced = reduction(part.information, size)
        parts.append(part)
        information = information + reduced @ part.information @ reduced.T
        gradient = gradient + reduced @ part.gradient
    return information, gradient, parts


def _first_gains(
    frame: Frame, estimate: Estimate, band: Ribbon, irradiance: Array, lights: Lights
) -> list[tuple[float, tuple[float, float] | None]]:
    """Where each channel's gain starts, and what tells it beside the band.

    Light from under the retina is on both sides of an edge, and in a band it looks like ambient light.
    """
    offset = band.strips.offset
    if Deep.of(estimate.scene) is None:
        return [(first_gain(shown, irradiance, lights[c][0], offset), None) for c, shown in enumerate(band.shown)]
    around = surroundings(frame, estimate)
    gains = [gain_over(shown, irradiance, lights[c][0], offset, float(around[c])) for c, shown in enumerate(band.shown)]
    return [(gain, (gain, EDGE.gain)) for gain in gains]


def _with_own(part: Eliminated, step: Array) -> Array:
    """A step of the shared parameters and what it means for a channel's gain, level and slow slopes."""
    size = len(step)
    own = solved(part.information[size:, size:], part.gradient[size:] - part.information[size:, :size] @ step)
    return np.append(step, np.zeros(len(part.gradient) - size) if own is None else np.clip(own, -1.0, 1.0))
