"""Light and disc fitted together, over a retina that has two levels and a little of everything else.

The field's fit takes a rim for roughness of the albedo, which counts for little, and sets the end of the light upon it.
Here a step of the log albedo competes with it for the same rim. Nothing is learnt on the way, so what two fits leave of
one window may be compared.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.localize.disc.rings import find_round
from conespot.localize.disc.settings import DISC
from conespot.localize.disc.step import Disc
from conespot.localize.image import Frame
from conespot.localize.model.deep import Deep
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.prior import on_rcm
from conespot.localize.model.residual import incident_light, log_residuals, student_cost, student_weights
from conespot.localize.model.view import Bins, Shown, Window, outline
from conespot.localize.outcome import DISC_UNDER_IT, Localization, LocalizationFailure, Outcome
from conespot.localize.start.rig import poses_on
from conespot.localize.start.rings import Ring
from conespot.scene.pose import Pose

Array = NDArray[np.float64]
#: parameters without a disc's: the tip, the log of the gain and the retina's level
_SIZE = 5


def unless_disc(outcome: Outcome, frame: Frame, start: Estimate, knowns: Knowns, noise: NoiseModel) -> Outcome:
    """The outcome of a fit to a soft patch near a start, refused where a disc passes for the light.

    The start's scene has what the fit has found: of a blur that nobody told a scene without would leave a ring.
    """
    if isinstance(outcome, Localization) and passes_for_light(frame, start, knowns, noise):
        return LocalizationFailure(DISC_UNDER_IT)
    return outcome


def passes_for_light(frame: Frame, start: Estimate, knowns: Knowns, noise: NoiseModel) -> bool:
    """Whether a disc about as large as the patch lies under it, so that its rim may be taken for the light's end.

    Of one spotlight near a `start`. Where light from under the retina fills a window the answer is no.
    """
    at = None if len(start.scene.spotlights) > 1 else Window.around(start, 0, DISC.bins, DISC.margin)
    if at is None or Deep.of(start.scene) is not None:
        return False
    view = _View(frame, at, knowns, noise, start)
    first = view.begun(start, None)
    # a start is off by a little, which makes a ring of the light's end itself: a fit leaves none of it
    if first is None or not view.shows_round(first):
        return False
    alone = view.fitted(first)
    if alone is None or not view.shows_round(alone):
        return False
    found = [fit for rival in view.rivals(first, alone) if (fit := view.fitted(rival)) is not None]
    best = min([alone, *found], key=lambda fit: fit.cost)
    return view.shared(best) > DISC.shared


@dataclass(frozen=True)
class _Fit:
    """Where a fit stands: `gain` is the log of the spotlight over the ambient light, `level` the log albedo."""

    estimate: Estimate
    gain: float
    level: float
    disc: Disc | None
    cost: float = math.inf  #: minus twice the log-likelihood, but for a constant


class _View:
    """A window of a frame, and fits of light and disc to it."""

    def __init__(self, frame: Frame, at: Window, knowns: Knowns, noise: NoiseModel, start: Estimate) -> None:
        self._at, self._knowns, self._noise, self._scene = at, knowns, noise, start.scene
        # the channel least clipped, as the field's fit has it
        self._shown = max(Shown.each(frame, at), key=lambda plane: np.count_nonzero(plane.usable))
        self._shape = at.height, at.width
        self._pitch = start.scene.camera.pixel_pitch
        self._x, self._y = (at.pixels * self._pitch).T.reshape(2, *self._shape)
        self._near, self._bins = start, Bins(at, start, knowns, 0)
        self._use = self._bins.seen.reshape(self._shape) & self._shown.usable
        self._ambient = self._bins.ambient.reshape(self._shape)

    @property
    def _side(self) -> float:
        """Of a bin [mm]."""
        return self._at.side * self._pitch

    def begun(self, at: Estimate, disc: Disc | None) -> _Fit | None:
        """Where a fit begins: level and gain as bins beside the patch and its brighter half show them."""
        full = self._light(at)[0]
        signal = self._shown.signal / self._ambient
        if disc is not None:
            signal = signal / np.exp(disc.step(self._x, self._y)[0])
        dark, lit = self._use & (full <= 0.0), self._use & (full > 0.0)
        if not dark.any() or not lit.any() or not np.isfinite(full).all():
            return None
        level = max(float(np.median(signal[dark])), 1e-5)
        bright = lit & (full >= np.median(full[lit]))
        gain = float(np.median(((signal / level - 1.0) * self._ambient)[bright] / full[bright]))
        return _Fit(at, math.log(max(gain, 1e-9)), math.log(level), disc)

    def round(self, fit: _Fit) -> tuple[Array, float, float]:
        """Middle `[2]` and radius [mm] of the roundest bright region of what a fit leaves, and its votes.

        Without votes where the fit's light is none.
        """
        model = self._model(fit)[0]
        if not np.isfinite(model).all():
            return np.zeros(2), DISC.radii[0], 0.0
        seen = np.log(np.maximum(self._shown.signal / model, DISC.darkest))
        middle, radius, votes = find_round(seen, self._variance(model), self._use, self._side)
        return middle + [self._x[0, 0], self._y[0, 0]], radius, votes

    def shows_round(self, fit: _Fit) -> bool:
        """Whether a fit leaves a round that lies under the patch for the most part."""
        middle, radius, votes = self.round(fit)
        return votes > DISC.votes and self.shared(replace(fit, disc=Disc.at(middle, radius))) > DISC.shared_first

    def rivals(self, first: _Fit, alone: _Fit) -> Iterator[_Fit]:
        """Where fits with a disc begin: the rounds that two fits without one see in the albedo.

        What was taken for the patch's outline may be the disc's rim, and the round the patch: the other way round, too.
        """
        for fit in (first, alone):
            middle, radius, votes = self.round(fit)
            points = self._pitch * outline(fit.estimate, 0)
            centre = points.mean(axis=0)
            size = float(np.mean(np.linalg.norm(points - centre, axis=1)))
            ring = Ring(middle / self._pitch, radius / self._pitch, votes)
            pairs = [(first.estimate, Disc.at(middle, radius))]
            pairs += [(Estimate(pose, self._scene), Disc.at(centre, size)) for pose in poses_on([ring], self._scene)]
            for at, disc in pairs:
                begun = self.begun(at, disc)
                if begun is not None:
                    yield begun

    def fitted(self, fit: _Fit) -> _Fit | None:
        """The fit's nearest minimum, by Gauss and Newton with Levenberg's damping; None where there is no light."""
        damping = 1e-3
        model, jacobian = self._model(fit)
        fit, weights, residual = self._judged(fit, model)
        if not math.isfinite(fit.cost):
            return None
        for count in range(DISC.steps):
            flat = jacobian.reshape(len(jacobian), -1)
            information = (flat * weights.ravel()) @ flat.T
            gradient = flat @ (weights * residual).ravel()
            if fit.disc is not None:
                information[_SIZE:, _SIZE:] += np.diag(fit.disc.precision)
                gradient[_SIZE:] += fit.disc.precision * (fit.disc.first - fit.disc.now)
            still = fit.disc is not None and count < DISC.still
            before = fit
            for _ in range(8):
                damped = information + np.diag(damping * np.diag(information) + 1e-12)
                if still:  # a disc that is not yet in its place would move the tip instead
                    damped[:3, :3] += np.diag(np.full(3, 1e12))
                moved = self._moved(fit, np.asarray(np.linalg.solve(damped, gradient), float))
                if moved is not None:
                    model, jacobian = self._model(moved)
                    moved, weights, residual = self._judged(moved, model)
                    if moved.cost < fit.cost + 1e-6:
                        fit = moved
                        break
                damping = max(10.0 * damping, 1e-4)
            if fit is before or (before.cost - fit.cost < DISC.done and not still):
                break
            damping = max(damping / 10.0, 1e-9)
        return fit

    def shared(self, fit: _Fit) -> float:
        """What disc and patch have in common over what both cover, 0 to 1."""
        if fit.disc is None:
            return 0.0
        corners = (outline(fit.estimate, 0) - [self._at.column, self._at.row]) / self._at.side - 0.5
        patch = cv2.fillPoly(np.zeros(self._shape, np.uint8), [np.round(corners).astype(np.int32)], 1) > 0
        return fit.disc.shared(self._x, self._y, patch, self._side**2)

    def _moved(self, fit: _Fit, step: Array) -> _Fit | None:
        """The fit after a step, the axis through the RCM; None where the tip would be outside."""
        step = step / max(1.0, float(np.max(np.abs(step[:3]))) / DISC.longest_mm)
        tip = fit.estimate.pose.apex + step[:3]
        if not np.isfinite(step).all() or not self._scene.depth(tip) > 0.0:
            return None
        return _Fit(
            Estimate(Pose.through(tip, self._scene.instrument.rcm), self._scene),
            fit.gain + float(np.clip(step[3], -1.0, 1.0)),
            fit.level + float(step[4]),
            None if fit.disc is None else fit.disc.moved(step[_SIZE:]),
        )

    def _light(self, at: Estimate) -> tuple[Array, Array]:
        """Light on the bins to use `[h, w]`, and its derivatives by the tip `[3, h, w]`, the axis on the RCM."""
        if float(np.linalg.norm(at.pose.apex - self._near.pose.apex)) > DISC.stale_mm:
            self._near, self._bins = at, Bins(self._at, at, self._knowns, 0)
        light, rows = self._bins.spotlight(at)[0]
        both = np.zeros((4, self._ambient.size))
        both[0, self._bins.lit] = light
        both[1:, self._bins.lit] = on_rcm(rows, at.pose, self._scene)
        planes = np.where(self._use, both.reshape(4, *self._shape), 0.0)
        return planes[0], planes[1:]

    def _model(self, fit: _Fit) -> tuple[Array, Array]:
        """The model's light `[h, w]` [white] and the derivatives of its log by all that is fitted `[P, h, w]`."""
        light, rows = self._light(fit.estimate)
        gain = math.exp(fit.gain)
        brightness = incident_light(self._ambient, gain * light)
        step, of_disc = np.zeros(self._shape), np.zeros((0, *self._shape))
        if fit.disc is not None:
            step, of_disc = fit.disc.step(self._x, self._y)
        jacobian = [gain * rows / brightness, (gain * light / brightness)[None], np.ones((1, *self._shape)), of_disc]
        return np.exp(fit.level + step) * brightness, np.concatenate(jacobian)

    def _variance(self, model: Array) -> Array:
        """The sensor's, of the log of a bin's light."""
        return self._noise.variance(model) / self._at.side**2 / np.square(np.maximum(model, 1e-9))

    def _judged(self, fit: _Fit, model: Array) -> tuple[_Fit, Array, Array]:
        """The fit with its cost, and the bins' weights and residuals `[h, w]`."""
        variance = self._variance(model)
        residual, _ = log_residuals(self._shown, model, variance)
        variance = variance + DISC.rest**2
        white = residual / np.sqrt(variance)
        cost = student_cost(white[self._use]) + float(np.sum(np.log(variance[self._use])))
        weights = self._use * student_weights(white) / variance
        return replace(fit, cost=cost + (0.0 if fit.disc is None else fit.disc.unlikely)), weights, residual
