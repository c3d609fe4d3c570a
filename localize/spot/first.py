"""Where the light of a spot alone puts the tip: over an even retina, with the needle through the RCM.

Light does not change with a way of none, and not with which end of it is first: several directions are tried.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from conespot.localize.image import Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.prior import on_rcm
from conespot.localize.model.smear import smear_sigma
from conespot.localize.spot.light import Moving, SpotLight
from conespot.localize.spot.settings import SPOT
from conespot.localize.spot.window import lead_of, window_of
from conespot.scene.pose import Pose, tangents
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: parameters: tip [mm], way [mm], and the light there is without the spot's and for each of its own
_TIP, _WAY, _GROUND, _GAIN = slice(0, 3), slice(3, 6), 6, 7


def way_sigma(scene: Scene) -> float:
    """Standard deviation of each coordinate of the tip's way during an exposure [mm]; 0 of a still one."""
    # the places of an even way have a variance of a twelfth of its square
    return math.sqrt(12.0) * smear_sigma(scene)


@dataclass(frozen=True)
class First:
    """Where the light alone puts the tip."""

    here: Moving
    explained: float  #: share of the light's variance in the window


def first_fit(frame: Frame, start: Estimate) -> First | None:
    """The tip and the way that explain the light near a start best; None where too little of it is in the frame."""
    at = window_of(start)
    if at is None:
        return None
    lead, every = lead_of(frame, at)
    light = SpotLight(at, start.scene)
    use = light.seen & every[lead].usable.ravel()
    signal = every[lead].signal.ravel()[use]
    if len(signal) < 8 * (_GAIN + 1) or np.ptp(signal) <= 0.0:
        return None
    problem = _Problem(light, start.scene, lead, use, signal)
    u, v = tangents(start.pose.axis)
    size = SPOT.first_way * way_sigma(start.scene)
    found: list[First] = []
    for angle in np.arange(SPOT.directions if size > 0.0 else 1) * math.pi / SPOT.directions:
        begin = problem.begin(start.pose.apex, size * (math.cos(angle) * u + math.sin(angle) * v))
        best = least_squares(
            problem.residuals, begin, problem.jacobian, method="lm", x_scale="jac", max_nfev=SPOT.first_steps
        )
        found.append(problem.first(best.x))
    return max(found, key=lambda one: one.explained)


class _Problem:
    """The light of some bins, in parts of what an even retina is off by, and the way's prior."""

    def __init__(self, light: SpotLight, scene: Scene, lead: int, use: NDArray[np.bool_], signal: Array) -> None:
        self._light, self._scene, self._lead, self._use, self._signal = light, scene, lead, use, signal
        self._off = SPOT.even * float(np.ptp(signal))
        self._way = way_sigma(scene)
        self._last: tuple[bytes, Array, Array] | None = None

    def begin(self, tip: Array, way: Array) -> Array:
        """Parameters with the ground and the gain that suit a tip and a way best."""
        bare = np.concatenate([tip, way, [0.0, 1.0]])
        value = self._seen(bare)[0]
        ground, gain = np.linalg.lstsq(np.stack([np.ones_like(value), value], axis=1), self._signal, rcond=None)[0]
        return np.concatenate([tip, way, [ground, gain]])

    def residuals(self, x: Array) -> Array:
        """What the light leaves of the signal, and the way over its standard deviation."""
        left = (x[_GROUND] + x[_GAIN] * self._seen(x)[0] - self._signal) / self._off
        return np.concatenate([left, x[_WAY] / (self._way or 1.0)])

    def jacobian(self, x: Array) -> Array:
        """Its derivatives."""
        value, rows = self._seen(x)
        found = np.zeros((len(value) + 3, len(x)))
        found[:-3] = np.concatenate([x[_GAIN] * rows, np.ones_like(value)[None], value[None]]).T / self._off
        found[-3:, _WAY] = np.eye(3) / (self._way or 1.0)
        return found

    def first(self, x: Array) -> First:
        """What parameters mean."""
        left = self.residuals(x)[:-3] * self._off
        return First(self._moving(x), 1.0 - float(np.mean(np.square(left))) / float(np.var(self._signal)))

    def _moving(self, x: Array) -> Moving:
        pose = Pose.through(x[_TIP], self._scene.instrument.rcm)
        return Moving(Estimate(pose, self._scene), x[_WAY].copy())

    def _seen(self, x: Array) -> tuple[Array, Array]:
        """The light and its derivatives by tip and way `[6, N]`, as long as they are asked for the same."""
        key = x[:_GROUND].tobytes()
        if self._last is None or self._last[0] != key:
            here = self._moving(x)
            value, rows = self._light(here, channel=self._lead)
            tied = on_rcm(rows, here.estimate.pose, self._scene)
            moving = rows[5:] if self._way > 0.0 else np.zeros_like(rows[5:])
            self._last = key, value[self._use], np.concatenate([tied, moving])[:, self._use]
        return self._last[1], self._last[2]
