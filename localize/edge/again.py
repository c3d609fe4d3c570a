"""The edge fit of the next frame: from a prediction, with what a frame changes little carried over from the last.

The same likelihood as `edge.band` has, on the same bins of its last level: strips with a level and a slope of their own
are eliminated, gain, spreads and scatter start where the last fit left them, and so one or two Gauss-Newton steps are
enough. How much wider than of uncorrelated bins the covariance is (the sandwich) is carried as well.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.band import BandFit
from conespot.localize.edge.channel import Channel, Kept
from conespot.localize.edge.fit import is_sharp
from conespot.localize.edge.ground import Ground
from conespot.localize.edge.quick import QuickBeam, QuickLight
from conespot.localize.edge.rim import Rim
from conespot.localize.edge.settings import EDGE
from conespot.localize.edge.strips import Strips, score_covariance
from conespot.localize.image import Frame
from conespot.localize.model.deep import Deep
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.prior import prior_rows
from conespot.localize.model.solve import inverse, limited, reduction, solved
from conespot.localize.model.view import Shown, outline
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
_POSE, _ALL = 5, 6  #: parameters of the pose, and with the blur


@dataclass(frozen=True)
class AgainSettings:
    """Numbers of the fit that follows; `benchmarks/tracking.py` shows what they do."""

    #: steps at most, and how short the last must be [sigmas of uncorrelated residuals]: a step leaves a fifth of itself
    #: (a new track knows no velocity, so that its next frames seek a blur as well, after five steps: with six in all
    #: that was one too few, and cost a whole fit)
    steps: int = 10
    enough: float = 2.0
    #: and before a blur is sought
    there: float = 0.5
    #: a step this short is followed by ones with the slopes where it began, as long as each is this much shorter than
    #: the one before, and no weights change by more than this factor
    near: float = 30.0
    shorter: float = 0.3
    reweighed: float = 1.5
    #: points of the outline
    points: int = 64
    #: share of a band's bins that may be clipped: a glint, not the patch
    clipped: float = 0.02
    #: sigmas by which a frame must contradict the blur that it is told, as `model.doubt` has it, and below which one
    #: that was sought is sought no more
    doubt: float = 3.0
    forget: float = 1.0
    #: share that a frame's own sandwich takes of what is carried: few strips make it uncertain
    fresh: float = 0.3


AGAIN = AgainSettings()


@dataclass(frozen=True, eq=False)
class Carried:
    """What one frame's fit leaves to the next."""

    channels: tuple[Kept, ...]
    width: float  #: of what spreads the image across the edge [px]
    #: covariance of the gradient in units of the information's Cholesky factor `[5, 5]`
    together: Array
    blur: float | None  #: variance of a blur beyond the scene's [mm^2]; None while none is sought
    ground: Ground

    @classmethod
    def after(cls, fit: BandFit, width: float) -> Carried | None:
        """From a fit of all levels near which outlines are `width` [px] wide."""
        information = fit.information[:_POSE, :_POSE]
        # what else was free is as it was found, or told by the track
        together = _whitened(information, fit.scatter()[:_POSE, :_POSE])
        if together is None:
            return None
        return cls(tuple(map(Kept.of, fit.channels)), width, together, None, Ground(fit.estimate.scene))


@dataclass(frozen=True, eq=False)
class Again:
    """A fit that follows."""

    estimate: Estimate
    covariance: Array  #: of the pose `[5, 5]`
    misfit: float
    contrast: float  #: light deep inside the band over that outside
    carried: Carried


def can_follow(scene: Scene, knowns: Knowns) -> bool:
    """Whether the fit that follows has all of a scene in it: one soft spotlight, nothing free but pose and blur."""
    plain = len(scene.spotlights) == 1 and scene.instrument.shaft is None and Deep.of(scene) is None
    return plain and not knowns.free and not is_sharp(scene)


def fit_again(
    frame: Frame, start: Estimate, knowns: Knowns, before: Carried, noise: NoiseModel, *, renew: bool = False
) -> Again | None:
    """The pose near a prediction; None where the fit of all levels has to look.

    The start's scene may say how the needle moves. With `renew` this frame's own sandwich is taken in.
    """
    scene = start.scene
    curve = outline(start, 0, AGAIN.points)
    if len(curve) < AGAIN.points:
        return None
    level, size = EDGE.soft[-1], float(np.max(np.ptp(curve, axis=0)))
    side = max(1, int(size / (level.bins or size)), int(EDGE.bins_a_width * before.width))
    reach = EDGE.widths * before.width / side
    rim = Rim.about(curve, scene, side, level.inner + reach, level.outer + reach)
    if rim is None:
        return None
    shown = Shown.in_cells(frame, rim.window, *rim.cells)
    if any(np.count_nonzero(plane.usable) < (1.0 - AGAIN.clipped) * len(plane.usable) for plane in shown):
        return None
    sight, irradiance = before.ground.under(rim.window, rim.cells)
    beam = QuickBeam(sight, start)
    here = beam(start.pose, before.blur or 0.0)
    if not np.all(np.isfinite(here.value)):
        return None
    strips = Strips(rim.index, here.offset(scene.beam.half_angle), rim.first, (slice(0, len(rim.first)),))
    channels = [
        Channel(plane, strips, noise, irradiance, was, pixels=side**2, size=_ALL)
        for plane, was in zip(shown, before.channels, strict=True)
    ]
    fit = _Fit(beam, channels, knowns, start, before.blur or 0.0, here)
    if not fit.run(before):
        return None
    information = fit.of_pose
    together = before.together
    newer = _whitened(information, fit.scatter()) if renew else None
    if newer is not None:
        together = (1.0 - AGAIN.fresh) * together + AGAIN.fresh * newer
    misfit = math.sqrt(sum(channel.misfit**2 for channel in channels) / len(channels))
    contrast = min(channel.contrast for channel in channels)
    kept = tuple(channel.leave() for channel in channels)
    carried = Carried(kept, fit.here.width * side, together, fit.kept_blur, before.ground)
    return Again(fit.at, _coloured(information, together), misfit, contrast, carried)


@dataclass(eq=False)
class _Fit:
    """Gauss-Newton steps of the pose, and of the blur where it is sought."""

    beam: QuickBeam
    channels: list[Channel]
    knowns: Knowns
    at: Estimate
    blur: float  #: variance beyond the scene's [mm^2]
    here: QuickLight
    sought: bool = False
    information: Array = field(default_factory=lambda: np.eye(_ALL))  #: of pose and blur `[6, 6]`

    def run(self, before: Carried) -> bool:
        """Whether it settles."""
        self.sought = before.blur is not None
        length, shorter = math.inf, 0.0
        for turn in range(AGAIN.steps):
            # after a short step the next ones take the slopes that there are, as long as they get shorter
            anew = length > AGAIN.near or shorter > AGAIN.shorter or not self._weighed
            gradient = self._linearized(turn) if anew else self._corrected()
            step = self._step(gradient)
            if step is None:
                return False
            for channel in self.channels:
                channel.learn(step)
            before_it, length = length, math.sqrt(float(step @ self.information @ step))
            shorter = 0.0 if anew else length / before_it
            if turn and length < AGAIN.enough and self._weighed:
                if self.sought or not self._doubted(gradient):
                    self.information = self.information * self._heavier
                    return True
                # far from the minimum a width stands for a place
                self.sought = length < AGAIN.there
        return False

    @property
    def _heavier(self) -> float:
        """The last weights over those of the last equations."""
        return sum(channel.heavier for channel in self.channels) / len(self.channels)

    @property
    def _weighed(self) -> bool:
        return 1.0 / AGAIN.reweighed < self._heavier < AGAIN.reweighed

    def _linearized(self, turn: int) -> Array:
        """The gradient `[6]`; the information as well."""
        if turn:
            self.here = self.beam(self.at.pose, self.blur)
        pr, pj = prior_rows(self.at, self.at.scene, self.knowns)
        self.prior = np.zeros((len(pj), _ALL))
        self.prior[:, :_POSE] = pj
        information, gradient = self.prior.T @ self.prior, -self.prior.T @ pr
        for channel in self.channels:
            more, slope = channel.equations(self.here.value, self.here.rows)
            information += more
            gradient += slope
        self.information = information
        return gradient

    def _corrected(self) -> Array:
        """The gradient `[6]` where the fit stands by the slopes where it stood."""
        light = self.beam.beside(self.here, self.at.pose, self.blur)
        pr, _ = prior_rows(self.at, self.at.scene, self.knowns)
        gradient = -self.prior.T @ pr
        for channel in self.channels:
            gradient += channel.corrected(light)
        return gradient

    def _step(self, gradient: Array) -> Array | None:
        """The step `[6]`, taken; None if there is none."""
        size = _ALL if self.sought else _POSE
        found = solved(self.information[:size, :size], gradient[:size])
        if found is None:
            return None
        step = np.zeros(_ALL)
        step[:size] = limited(found, EDGE.longest_step_mm)
        step[_POSE] = max(step[_POSE], -self.beam.blur - self.blur)
        self.at = self.at.moved(step[:_POSE], ())
        self.blur += float(step[_POSE])
        return step

    def _doubted(self, gradient: Array) -> bool:
        """Whether the frame would have another blur, by more than chance does; less than none is none."""
        covariance = inverse(self.information)
        by = float(covariance[_POSE] @ gradient)
        far = abs(by) > AGAIN.doubt * math.sqrt(max(float(covariance[_POSE, _POSE]), 0.0))
        return far and (by > 0.0 or self.beam.blur > 0.0)

    @property
    def of_pose(self) -> Array:
        """Information about the pose `[5, 5]`."""
        if not self.sought:
            return self.information[:_POSE, :_POSE]
        taken = reduction(self.information, _POSE)
        return np.asarray(taken @ self.information @ taken.T)

    @property
    def kept_blur(self) -> float | None:
        """The blur that the next frame starts from."""
        if not self.sought:
            return None
        sigma = math.sqrt(max(float(inverse(self.information)[_POSE, _POSE]), 0.0))
        return self.blur if abs(self.blur) > AGAIN.forget * sigma else None

    def scatter(self) -> Array:
        """Covariance of the pose's gradient `[5, 5]` as the strips' residuals show it, priors included."""
        prior = self.prior[:, :_POSE]
        total, scores, parts = prior.T @ prior, np.zeros((1, _POSE)), np.zeros((1, _POSE, _POSE))
        for channel in self.channels:
            gradient, own, known = channel.scores(_POSE)
            scores, parts, total = scores + gradient, parts + own, total + known
        return score_covariance(self.channels[0].strips, scores, parts) + total


def _whitened(information: Array, scatter: Array) -> Array | None:
    """A gradient's covariance in units of the information's Cholesky factor; None without one."""
    try:
        half = np.linalg.inv(np.linalg.cholesky(information))
    except np.linalg.LinAlgError:
        return None
    return np.asarray(half @ scatter @ half.T)


def _coloured(information: Array, together: Array) -> Array:
    """The covariance that belongs to it."""
    half = np.linalg.inv(np.linalg.cholesky(information))
    return np.asarray(half.T @ together @ half)
