"""The optic disc as a step of the log albedo across a rim that is nearly an ellipse."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from conespot.localize.disc.settings import DISC

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Disc:
    """A disc in a frame in which places are counted in mm.

    Its rim is r = R (1 + a cos 2 phi + b sin 2 phi), about what an ellipse is, and the step across it a logistic one.
    Both `[7]`: column and row of its middle [mm], log of R [mm], a, b, log of the rim's width [mm], the step's height.
    """

    first: Array  #: what is expected of it
    now: Array

    @classmethod
    def at(cls, middle: Array, radius: float) -> Disc:
        """A disc as most are about a `middle` `[2]` [mm], of a `radius` [mm] within what a disc may have."""
        size = float(np.clip(radius, *DISC.radii))
        first = np.array([*middle, math.log(size), 0.0, 0.0, math.log(DISC.rim), DISC.height])
        return cls(first, first)

    @property
    def precision(self) -> Array:
        """Of what is expected of it `[7]`."""
        return 1.0 / np.square(np.array(DISC.sigmas))

    @property
    def unlikely(self) -> float:
        """How unlikely it is beforehand, as squares of sigmas."""
        return float(self.precision @ np.square(self.now - self.first))

    def moved(self, step: Array) -> Disc:
        """It after a step `[7]`, shorter where a coordinate goes too far."""
        return replace(self, now=self.now + step / max(1.0, float(np.max(np.abs(step) / np.array(DISC.longest)))))

    def step(self, x: Array, y: Array) -> tuple[Array, Array]:
        """The log albedo `[h, w]` that it adds at columns and rows `[h, w]` [mm], and its derivatives `[7, h, w]`."""
        column, row, log_radius, a, b, log_width, height = self.now
        dx, dy = x - column, y - row
        rho = np.maximum(np.hypot(dx, dy), 1e-6)
        cos, sin = dx / rho, dy / rho
        cos2, sin2 = cos * cos - sin * sin, 2.0 * cos * sin
        radius, width = math.exp(log_radius), math.exp(log_width)
        rim = radius * (1.0 + a * cos2 + b * sin2)
        inside = expit((rim - rho) / width)
        slope = height * inside * (1.0 - inside) / width
        # a middle that moves turns phi as well
        turn = 2.0 * radius * (b * cos2 - a * sin2) / rho
        rows = [cos + turn * sin, sin - turn * cos, rim, radius * cos2, radius * sin2, rho - rim]
        return height * inside, np.stack([*(slope * each for each in rows), inside])

    def shared(self, x: Array, y: Array, patch: NDArray[np.bool_], bin_mm2: float) -> float:
        """What a `patch` `[h, w]` and it have in common over what both cover, 0 to 1; bins are of `bin_mm2` [mm2]."""
        inside = self.step(x, y)[0] > 0.5 * self.now[6]
        common = bin_mm2 * float(np.count_nonzero(inside & patch))
        # it may reach beyond the window
        own = math.pi * math.exp(2.0 * self.now[2]) * (1.0 + 0.5 * float(self.now[3:5] @ self.now[3:5]))
        return common / (own + bin_mm2 * float(np.count_nonzero(patch)) - common)
