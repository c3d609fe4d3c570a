"""The tracker: frames with time stamps in, poses with covariance out, one after the other.

Where the motion so far says where the needle is, the fit alone starts there; where it does not, or the fit contradicts
it, the whole frame is searched as `locate` does. The pose that comes out is always the frame's own.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.localize.distance import with_distance
from conespot.localize.image import AnyImage, Frame, Reference, checked
from conespot.localize.locate import locate
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.outcome import Localization, LocalizationFailure, Outcome
from conespot.localize.tracking.follower import Follower
from conespot.localize.tracking.process import OBSERVED, Belief, miss_of, seen_of
from conespot.scene.document import InputError
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
_FITS = ("cone", "photometric")


@dataclass(frozen=True)
class TrackingSettings:
    """Numbers of the tracker; each follows from what it means, and none was tuned."""

    #: squared innovation beyond which a fit is not what the motion leads to: chi-squared of five degrees is above it
    #: once in 10^7 frames
    gate: float = 42.0
    #: how long a motion tells where to look [s], and how far its tip may be off for that [mm]: a start is good to this
    longest_s: float = 0.1
    loosest_mm: float = 0.3


TRACKING = TrackingSettings()


class State(Enum):
    """How a frame's pose came about, or why there is none."""

    FOLLOWED = "followed"  #: by the fit alone, from where the motion so far leads
    FOUND = "found"  #: by a search of the whole frame: at first, after an interruption, after a leap
    LOST = "lost"  #: neither; the motion is too long ago, or there was none
    COASTING = "coasting"  #: neither, and the motion still says where the needle should be


@dataclass(frozen=True, eq=False)
class Tracked:
    """A frame's answer. `predicted` is what the motion so far says of it, with its covariance, where it says anything.

    `latency_s` is the time from the frame's arrival in `Tracker.track` to this answer.
    """

    time_s: float
    state: State
    outcome: Outcome
    predicted: Localization | None
    latency_s: float


class Tracker:
    """Follows a needle through frames of one camera. Give it frames in the order of their time stamps.

    >>> tracker = Tracker(load_scene("theatre"))  # doctest: +SKIP
    >>> tracker.track(image, time_s=0.0083).outcome  # doctest: +SKIP
    """

    def __init__(
        self,
        scene: Scene,
        localizer: str = "cone",
        *,
        knowns: Knowns | None = None,
        reference: ArrayLike | Reference | None = None,
    ) -> None:
        """`localizer` is `cone` or `photometric`, the others as `locate` takes them. Raises InputError for another."""
        if localizer not in _FITS:
            raise InputError(f"tracking: '{localizer}' has no fit that starts from a pose; take {' or '.join(_FITS)}")
        self.scene, self.localizer = scene, localizer
        self.knowns = (knowns or Knowns()).within(scene)
        self._reference = None if reference is None else Reference.of(reference, scene)
        self._miss = miss_of(self.knowns, scene)
        self._follower = Follower(scene, localizer, self.knowns, self._reference)
        self._belief: Belief | None = None
        self._at = -math.inf
        self._seen_at = -math.inf
        self._roll = 0.0

    def track(self, image: ArrayLike, time_s: float) -> Tracked:
        """The pose in a frame `[H, W]` or `[H, W, 3]` taken at `time_s` [s].

        Raises InputError for an image as `locate` does, and a time stamp that is not after the one before.
        """
        arrived = time.perf_counter()
        if not (math.isfinite(time_s) and time_s > self._at):
            raise InputError(f"tracking: a frame at {time_s:g} s follows one at {self._at:g} s; give them in order")
        pixels = checked(image, self.scene)
        before, self._at = self._predicted(time_s), time_s
        state, outcome = self._answer(pixels, before)
        outcome = with_distance(outcome, self.scene, self.knowns)
        if isinstance(outcome, Localization):
            self._learn(outcome, before, state)
        else:
            self._belief = before
        predicted = None
        if before is not None:
            pose = before.pose(self.scene)
            predicted = Localization(pose.apex, pose.axis, before.pose_covariance(self.scene))
        return Tracked(time_s, state, outcome, predicted, time.perf_counter() - arrived)

    def _predicted(self, time_s: float) -> Belief | None:
        """What is believed of the frame's pose; None where the last answer is too long ago."""
        if self._belief is None or time_s - self._seen_at > TRACKING.longest_s:
            return None
        return self._belief.moved(time_s - self._at, self._miss)

    def _answer(self, image: AnyImage, before: Belief | None) -> tuple[State, Outcome]:
        if before is not None and _spread(before) < TRACKING.loosest_mm:
            outcome = self._followed(image, before)
            if isinstance(outcome, Localization):
                return State.FOLLOWED, outcome
        outcome = locate(image, self.scene, self.localizer, knowns=self.knowns, reference=self._reference)
        if isinstance(outcome, Localization):
            pose = Pose(outcome.apex_mm, outcome.axis, outcome.roll or 0.0)
            self._follower.begin(Frame(image, self.scene.sensor), Estimate(pose, self.scene), self._at)
            return State.FOUND, outcome
        return (State.LOST if before is None else State.COASTING), outcome

    def _followed(self, image: AnyImage, before: Belief) -> Outcome:
        """The fit from where the motion leads, if it stays there."""
        frame = Frame(image, self.scene.sensor)
        pose = before.pose(self.scene)
        # of several spotlights the roll as well, of which no motion is known: it is the last one
        start = Estimate(Pose(pose.apex, pose.axis, self._roll), self.scene)
        if self.scene.depth(start.pose.apex) <= 0.0:
            return LocalizationFailure("the motion leads out of the eye")
        outcome = self._follower.quick(frame, start, before.way(self._follower.exposure_s), self._at)
        if self._goes_on(outcome, before):
            return outcome
        outcome = self._follower.full(frame, start, self._at)
        if self._goes_on(outcome, before):
            return outcome
        return LocalizationFailure("no fit is where the motion leads")

    def _goes_on(self, outcome: Outcome, before: Belief) -> bool:
        """Whether an answer is where the motion leads."""
        if not isinstance(outcome, Localization) or outcome.covariance is None:
            return False
        return before.surprise(*seen_of(outcome, self.scene)) <= TRACKING.gate

    def _learn(self, found: Localization, before: Belief | None, state: State) -> None:
        self._seen_at, self._roll = self._at, found.roll or 0.0
        if found.covariance is None:
            self._belief = None
            return
        seen, noise = seen_of(found, self.scene)
        goes_on = before is not None and (state is State.FOLLOWED or before.surprise(seen, noise) < TRACKING.gate)
        if before is not None and goes_on:
            self._belief = before.corrected(seen, noise)
        else:
            self._belief = Belief.first(seen, noise, self._miss)


def _spread(belief: Belief) -> float:
    """Standard deviation of the tip [mm]."""
    return math.sqrt(max(0.0, float(np.trace((OBSERVED @ belief.covariance @ OBSERVED.T)[:3, :3]))))
