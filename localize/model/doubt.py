"""What a localizer is told and may doubt: quantities that are taken as told until a frame contradicts them.

An image's blur is one. Whether it is fitted or not moves no edge, since it widens both sides alike; but a width that no
frame shows costs time, and a width that is wrong costs the tip.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.solve import inverse

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DoubtSettings:
    """Tuned numbers of what is doubted."""

    #: sigmas by which a frame must contradict what it is told: by chance it does so once in 700 frames, and then
    #: nothing is lost but time
    sigmas: float = 3.0


DOUBT = DoubtSettings()


def contradicted(information: Array, gradient: Array, at: Estimate, doubted: Knowns, knowns: Knowns) -> bool:
    """Whether one step would change by more than chance does what is free in `doubted` and not in `knowns`.

    `information` `[P, P]` and `gradient` `[P]` are those of the pose and all that is free in `doubted`.
    """
    covariance = inverse(information)
    step = covariance @ gradient
    size = at.pose_size
    for j, each in enumerate(doubted.free, start=size):
        if each in knowns.free or not step[j] ** 2 > DOUBT.sigmas**2 * covariance[j, j]:
            continue
        # what cannot be less is not contradicted by less
        if not at.blocked(each, float(step[j])):
            return True
    return False
