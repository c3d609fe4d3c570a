"""A bump on the retina: its place, its size and the profile that the paper (4.2) leaves open."""

from __future__ import annotations

import math
from typing import Literal, assert_never

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from conespot.scene.model import Model
from conespot.scene.quantity import Length

Array = NDArray[np.float64]


class Bump(Model):
    """A bump above (x, y): rho, the distance along the sphere from its centre, decides how high it is.

    `cosine`: height cos^2(pi rho / diameter) up to half the diameter, without a kink at its foot.
    `cap`: a part of a sphere that stands on a circle of that diameter, with a kink.
    `gaussian`: height exp(-rho^2 / 2 s^2) with six s to the diameter, where 1 % of the height is left.

    >>> Bump(x=0.0, y=0.0).at(np.array([0.0, 0.125, 0.25]))[0].round(9).tolist()
    [0.1, 0.05, 0.0]
    """

    x: Length
    y: Length
    diameter: Length = Field(0.5, gt=0.0)
    height: Length = Field(0.1, ge=0.0)
    profile: Literal["cosine", "cap", "gaussian"] = "cosine"

    @model_validator(mode="after")
    def _no_overhang(self) -> Bump:
        if self.profile == "cap" and self.height > self.diameter / 2.0:
            raise ValueError("a cap's height can be at most half its diameter; the profile gaussian has no such limit")
        return self

    @property
    def reach(self) -> float:
        """The distance from the centre [mm] beyond which nothing is raised (of a Gaussian 2e-8 of the height)."""
        return self.diameter if self.profile == "gaussian" else self.diameter / 2.0

    def at(self, rho: Array) -> tuple[Array, Array]:
        """Height `[N]` [mm] at distances `[N]` [mm] within `reach`, and its derivative there `[N]`, not positive."""
        match self.profile:
            case "cosine":
                phase = math.pi * rho / self.diameter
                steepest = math.pi * self.height / self.diameter
                return self.height * np.cos(phase) ** 2, -steepest * np.sin(2.0 * phase)
            case "cap":
                curvature = 2.0 * self.height / (self.diameter**2 / 4.0 + self.height**2)
                cosine = np.sqrt(np.maximum(1.0 - (curvature * rho) ** 2, 1e-12))
                return self.height - curvature * rho**2 / (1.0 + cosine), -curvature * rho / cosine
            case "gaussian":
                sigma = self.diameter / 6.0
                height = self.height * np.exp(-0.5 * (rho / sigma) ** 2)
                return height, -rho / sigma**2 * height
            case _:
                assert_never(self.profile)
