"""A fixed-lag smoother: every pose with the help of the frames just before and after it.

H. E. Rauch, F. Tung, C. T. Striebel, Maximum likelihood estimates of linear dynamic systems, AIAA J. 3, 1965.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.knowns import Knowns
from conespot.localize.outcome import Localization, Outcome
from conespot.localize.tracking.process import Belief, miss_of, seen_of, transition
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: without an answer for this long [s] a track begins anew: 0.3 s are three periods of a tremor
GAP_S = 0.3


@dataclass(frozen=True, eq=False)
class _Step:
    """A frame with an answer: what was believed before and after it, and the transition from the one before."""

    number: int
    before: Belief | None  #: None where a track begins
    after: Belief
    change: Array


def smoothed(
    times_s: Sequence[float], outcomes: Sequence[Outcome], scene: Scene, knowns: Knowns, lag: int = 12
) -> list[Outcome]:
    """The answers, each from those before it and up to `lag` after it; what is refused or has no covariance as it is.

    Only what errs independently from frame to frame becomes less; what all frames have in common (the RCM, the scene,
    an albedo that stays) does not. No frame says how much of its sigma is which, so that the covariance stays the
    frame's own, and the distance is left for `localize.distance` to add.
    """
    steps = _forward(times_s, outcomes, scene, miss_of(knowns, scene))
    found = list(outcomes)
    for at, step in enumerate(steps):
        last = at
        while last < len(steps) - 1 and last < at + lag and steps[last + 1].before is not None:
            last += 1
        belief = steps[last].after
        for j in range(last - 1, at - 1, -1):
            belief = _back(steps[j].after, steps[j + 1], belief)
        own = outcomes[step.number]
        assert isinstance(own, Localization)
        pose = belief.pose(scene)
        found[step.number] = replace(own, apex_mm=pose.apex, axis=pose.axis, distance=None)
    return found


def _forward(times_s: Sequence[float], outcomes: Sequence[Outcome], scene: Scene, miss: float) -> list[_Step]:
    steps: list[_Step] = []
    for number, outcome in enumerate(outcomes):
        if not isinstance(outcome, Localization) or outcome.covariance is None:
            continue
        seen, noise = seen_of(outcome, scene)
        gone = times_s[number] - times_s[steps[-1].number] if steps else np.inf
        if gone > GAP_S:
            steps.append(_Step(number, None, Belief.first(seen, noise, miss), np.eye(len(transition(0.01, miss)[0]))))
            continue
        change, _ = transition(round(gone, 9), miss)
        before = steps[-1].after.moved(gone, miss)
        steps.append(_Step(number, before, before.corrected(seen, noise), change))
    return steps


def _back(here: Belief, after: _Step, smooth: Belief) -> Belief:
    """One step back: what was believed here, with what the frames after it have made of the next."""
    assert after.before is not None
    gain = np.linalg.solve(after.before.covariance, after.change @ here.covariance).T
    return Belief(
        here.mean + gain @ (smooth.mean - after.before.mean),
        here.covariance + gain @ (smooth.covariance - after.before.covariance) @ gain.T,
    )
