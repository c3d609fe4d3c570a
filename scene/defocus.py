"""What is out of focus: where rays through the rim of the entrance pupil go, beside the one through its middle."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from conespot.scene.rays import Rays
from conespot.scene.refracted import steps_to

Array = NDArray[np.float64]
#: around the pupil's rim
_AROUND = 12
#: [mm]: rays so close to the axis are paraxial
_NEAR_AXIS = 0.01
_ROUNDS = 3


def rim(radius: float, points: int = _AROUND) -> Array:
    """Places on a pupil's rim `[points, 2]` [mm], to the right and up."""
    angle = np.arange(points) * 2.0 * np.pi / points
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def vergence(rays: Callable[[Array, float], Rays], point: Array, start: float) -> float:
    """The vergence [1/mm] of the camera's light at which a point `[3]` [mm] is sharp, by the secant method.

    `rays` gives those through four places in the pupil `[4, 2]` [mm], of the point's own pixel, for a vergence. Where
    the optics focus lines across each other in different places, it is the mean of the two.
    """
    places = rim(_NEAR_AXIS, 4)

    def defocus(at: float) -> float:
        return float(np.sum(steps_to(rays(places, at), np.tile(point, (len(places), 1)))[0] * places * [1.0, -1.0]))

    before, now = 0.0, start
    for _ in range(_ROUNDS):
        low, high = defocus(before), defocus(now)
        if high == low:
            break
        before, now = now, now - high * (now - before) / (high - low)
    return now


def blurred(rays: Callable[[Array], Rays], points: Array, radius: float) -> Array:
    """How far [px] from their own pixels points `[N, 3]` [mm] lie for rays through the pupil's rim, at most: `[N]`.

    `rays` gives those of the points' pixels through a place in the pupil `[2]` [mm].
    """
    return np.max([np.linalg.norm(steps_to(rays(place), points)[0], axis=1) for place in rim(radius)], axis=0)
