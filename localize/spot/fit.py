"""Maximum likelihood on all bins of a spot, whose tip may be on its way, with the albedo as a Gaussian field.

`first` says where the light alone puts it, and `field.piece` how the albedo is taken out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from conespot.localize.field.albedo import Modes
from conespot.localize.field.piece import Piece
from conespot.localize.field.settings import FIELD
from conespot.localize.image import Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.prior import prior_rows
from conespot.localize.model.solve import STEP, inverse, limited
from conespot.localize.model.view import Bins, visible
from conespot.localize.outcome import COVERED, UNCERTAIN, LocalizationFailure
from conespot.localize.spot.first import first_fit, way_sigma
from conespot.localize.spot.light import Moving, SpotLight
from conespot.localize.spot.settings import SPOT
from conespot.localize.spot.window import lead_of, window_of
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: a still tip's way [mm]: far below anything an image can tell, yet well conditioned
_STILL = 1e-6


@dataclass(frozen=True)
class SpotFit:
    """A fitted spot."""

    here: Moving
    piece: Piece
    normal: Array  #: information of the pose, the free quantities, the way and the gain `[P + 1, P + 1]`
    prior: Array  #: what is known of all but the gain `[P, P]`
    step: Array  #: the last `[P + 1]`
    settled: bool  #: whether it was small
    knowns: Knowns  #: by which it was fitted
    explained: float  #: share of the light's variance in the window that a spot over an even retina explains

    @property
    def covered(self) -> float:
        """Share of the patch that the frame shows and that is not clipped."""
        return visible(self.here.estimate) * self.piece.unclipped()

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the pose and the free quantities `[P - 3, P - 3]`: a sandwich (`field.sandwich`)."""
        bread, size = inverse(self.normal), len(self.prior)
        meat = self.piece.scatter(self.step, bread)
        meat[:size, :size] += self.prior
        found = (bread @ meat @ bread)[: size - 3, : size - 3]
        pose, scene = self.here.estimate.pose, self.here.estimate.scene
        near = SPOT.near_mm3 / float(scene.eye.intersect(pose.apex, pose.axis)) ** 2
        along = SPOT.along_mm**2 + near**2
        found[:3, :3] += SPOT.model_mm**2 * np.eye(3) + along * np.outer(pose.axis, pose.axis)
        return np.asarray(found)


@dataclass(frozen=True)
class _Modelled:
    """The noise of a sensor, and of a model that is off by a deviation [white]."""

    sensor: NoiseModel
    off: float

    def variance(self, signal: Array) -> Array:
        """Variance of one pixel [white^2]."""
        return self.sensor.variance(signal) + self.off**2


def fit_spot(frame: Frame, start: Estimate, knowns: Knowns, noise: NoiseModel) -> SpotFit | LocalizationFailure:
    """The fit near a start, or why there is none."""
    first = first_fit(frame, start)
    at = None if first is None else window_of(first.here.estimate)
    if first is None or at is None:
        return LocalizationFailure(COVERED)
    # the way has parameters of its own
    used, nominal, here = replace(knowns, smear_sigma_mm=0.0), start.scene, first.here
    lead, shown = lead_of(frame, at)
    light, bins = SpotLight(at, nominal), Bins(at, here.estimate, used, 0)
    pitch = nominal.camera.pixel_pitch * at.side
    # a bin is off as a whole, and its pixels' noise is not
    whole = _Modelled(noise, SPOT.light * float(np.ptp(shown[lead].signal)) * at.side)
    piece = Piece(shown, lead, bins, Modes.over(at.height, at.width, pitch), whole, FIELD.fundus)
    value, rows = light(here, used.free, lead)
    gain = piece.begin(value[bins.lit])
    size = len(rows)
    settled, prior, information, step = False, np.zeros((size, size)), np.eye(size + 1), np.zeros(size + 1)
    for count in range(SPOT.steps):
        if count:
            value, rows = light(here, used.free, lead)
        if not (np.isfinite(value).all() and np.isfinite(rows).all()):
            return LocalizationFailure(UNCERTAIN)
        residuals, known = _known(here, nominal, used)
        prior = known.T @ known
        information, gradient = piece.linearize(value[bins.lit], rows[:, bins.lit], gain)
        information[:size, :size] += prior
        gradient[:size] -= known.T @ residuals
        covariance = inverse(information)
        found = covariance @ gradient
        if not np.isfinite(found).all():
            return LocalizationFailure(UNCERTAIN)
        step = limited(found, SPOT.longest_step_mm)
        step[size] = np.clip(step[size], -1.0, 1.0)
        here = here.moved(step[:size], used.free)
        gain += float(step[size])
        piece.move(step, covariance)
        length = math.sqrt(max(0.0, float(step @ information @ step)))
        settled = length < STEP.settled_sigmas
        if length < SPOT.done_sigmas and count > 1:
            break
    return SpotFit(here, piece, information, prior, step, settled, used, first.explained)


def _known(here: Moving, nominal: Scene, knowns: Knowns) -> tuple[Array, Array]:
    """Whitened residuals `[Q]` and rows `[Q, P]` of what is known of pose, free quantities and way."""
    residuals, rows = prior_rows(here.estimate, nominal, knowns)
    sigma = max(way_sigma(nominal), _STILL)
    known = np.zeros((len(rows) + 3, rows.shape[1] + 3))
    known[:-3, :-3], known[-3:, -3:] = rows, np.eye(3) / sigma
    return np.concatenate([residuals, here.way / sigma]), known
