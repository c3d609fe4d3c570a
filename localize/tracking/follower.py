"""The fits that follow a needle from where its motion leads: a quick one, and the localizer's own.

The quick one (`edge.again`) takes over what a frame changes little, and asks nothing of the scene. The localizer's own
begins a track, goes on where the quick one does not settle, and comes back from time to time to ask whether the frames
still show the scene's beam and wall.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from conespot.localize.cone import judged_edge
from conespot.localize.doubt import noise_of
from conespot.localize.edge.again import Carried, can_follow, fit_again
from conespot.localize.edge.band import BandFit
from conespot.localize.edge.fit import fit_edge
from conespot.localize.edge.sandwich import EdgeFit
from conespot.localize.image import Frame, Reference, linear_light
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.smear import smeared
from conespot.localize.model.view import edge_width, outline
from conespot.localize.outcome import Localization, LocalizationFailure, Outcome
from conespot.localize.photometric import patch_outcome
from conespot.localize.verdict import VERDICT, judged
from conespot.scene.motion import Tremor, exposure_of
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FollowerSettings:
    """Numbers of the fits that follow; each follows from what it means."""

    #: light just inside the outline over that just outside, without which nothing shines there
    contrast: float = 1.1
    #: where inside and outside are looked at, over the distance from the patch's middle to its outline
    inside: float = 0.6
    outside: float = 1.35
    #: after so long [s] a quick fit measures how its strips err together, and the localizer's own fit asks of the scene
    #: again, which takes as long as ten quick ones
    sandwich_s: float = 0.1
    scene_s: float = 5.0
    #: times the misfit of the localizer's own fit from which on that one looks again
    worse: float = 1.5


FOLLOWER = FollowerSettings()


class Follower:
    """Fits from a prediction, one frame after the other."""

    def __init__(self, scene: Scene, localizer: str, knowns: Knowns, reference: Reference | None) -> None:
        """The scene's tremor, if it has one, is what the motion so far says of each frame."""
        self._scene, self._knowns, self._reference = scene, knowns, reference
        self._photometric = localizer == "photometric"
        # how far a tremor goes in a frame, which each frame alone has to find, the track tells
        self._told = replace(knowns, smear_sigma_mm=0.0)
        self._can_follow = not self._photometric and reference is None and can_follow(scene, self._told)
        #: that smears [s]; 0 where frames are sharp
        self.exposure_s = exposure_of(scene.motion, scene.sensor) if isinstance(scene.motion, Tremor) else 0.0
        self._carried: Carried | None = None
        self._misfit = math.inf
        self._asked_at = self._measured_at = -math.inf

    def quick(self, frame: Frame, start: Estimate, way: Array, time_s: float) -> Outcome:
        """The quick fit's answer, the tip's places during the exposure having the covariance `way` `[3, 3]` [mm^2]."""
        if self._carried is None or time_s - self._asked_at > FOLLOWER.scene_s:
            return LocalizationFailure("nothing is carried over")
        renew = time_s - self._measured_at > FOLLOWER.sandwich_s
        near = Estimate(start.pose, smeared(self._scene, way) if self.exposure_s else self._scene)
        fit = fit_again(frame, near, self._told, self._carried, noise_of(frame, None), renew=renew)
        if fit is None or fit.contrast < FOLLOWER.contrast:
            return LocalizationFailure("the quick fit does not settle")
        if fit.misfit > min(FOLLOWER.worse * self._misfit, VERDICT.largest_misfit):
            return LocalizationFailure("the quick fit is worse than the one before")
        self._carried = fit.carried
        if renew:
            self._measured_at = time_s
        pose = Estimate(fit.estimate.pose, self._scene)
        return judged(pose, fit.covariance, self._scene, self._told, misfit=fit.misfit, covered=1.0, settled=True)

    def begin(self, frame: Frame, found: Estimate, time_s: float) -> None:
        """Take over what the next frame's quick fit needs from the frame of a pose that has been found."""
        self._carried = None
        if self._can_follow:
            self._keep(fit_edge(frame, found, self._knowns, noise_of(frame, None)), time_s)

    def full(self, frame: Frame, start: Estimate, time_s: float) -> Outcome:
        """The localizer's own fit's answer."""
        self._carried = None
        if not _shines(frame, start):
            return LocalizationFailure("no light where the motion leads")
        noise = noise_of(frame, None)
        if self._photometric:
            outcome = patch_outcome(frame, start, self._knowns, noise, self._reference)
        else:
            fit = fit_edge(frame, start, self._knowns, noise, self._reference)
            outcome = fit if isinstance(fit, LocalizationFailure) else judged_edge(fit, self._scene)
            if outcome and self._can_follow:
                self._keep(fit, time_s)
        if isinstance(outcome, Localization):
            pose = Pose(outcome.apex_mm, outcome.axis, outcome.roll or 0.0)
            if not _shines(frame, Estimate(pose, self._scene)):
                return LocalizationFailure("no light where the fit ends")
        return outcome

    def _keep(self, fit: EdgeFit | LocalizationFailure, time_s: float) -> None:
        if isinstance(fit, BandFit):
            self._carried, self._misfit = Carried.after(fit, edge_width(fit.estimate)), fit.misfit
            self._asked_at = self._measured_at = time_s


def _shines(frame: Frame, at: Estimate) -> bool:
    """Whether it is brighter inside the outline than outside, where the frame shows both."""
    points = outline(at, 0, 24)
    if len(points) < 8:
        return False
    middle = points.mean(axis=0)
    means = []
    for share in (FOLLOWER.inside, FOLLOWER.outside):
        column, row = np.floor(middle + share * (points - middle)).astype(int).T
        shown = (row >= 0) & (column >= 0) & (row < frame.pixels.shape[0]) & (column < frame.pixels.shape[1])
        if np.count_nonzero(shown) < 4:
            return False
        light, _ = linear_light(frame.pixels[row[shown], column[shown]], frame.sensor)
        means.append(float(np.median(light if light.ndim == 1 else light.sum(axis=1))))
    return means[0] > FOLLOWER.contrast * max(means[1], 0.0)
