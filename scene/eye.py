"""The eye: a sphere that touches the origin with its posterior pole."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from conespot.scene.model import Model
from conespot.scene.quantity import Length


class Eye(Model):
    """Sphere of radius r [mm]; centre (0, 0, r), posterior pole at the origin (paper, section 3.1)."""

    radius: Length = Field(12.0, gt=0.0, le=100.0)

    @property
    def centre(self) -> NDArray[np.float64]:
        """Centre of the eye `[3]` [mm]."""
        return np.array([0.0, 0.0, self.radius])

    def intersect(self, origin: ArrayLike, direction: ArrayLike) -> NDArray[np.float64]:
        """Distance to the far wall along rays `[..., 3]` -> `[...]` [mm]; NaN where a ray misses.

        The larger root of |o + t d - c|^2 = r^2: for a ray from inside the eye the wall in front of it, for one
        from the camera the retina at the bottom.

        >>> Eye(radius=12.0).intersect([0.0, 0.0, 110.0], [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]).tolist()
        [110.0, nan]
        """
        o = np.asarray(origin, float) - self.centre
        d = np.asarray(direction, float)
        d2 = _dot(d, d)
        b = _dot(o, d) / d2
        disc = b * b - (_dot(o, o) - self.radius**2) / d2
        return -b + np.sqrt(np.where(disc >= 0.0, disc, np.nan))

    def height(self, x: ArrayLike, y: ArrayLike) -> NDArray[np.float64]:
        """z [mm] of the lower wall above (x, y) [mm]; NaN outside the eye's shadow.

        >>> Eye(radius=12.0).height([0.0, 12.0, 13.0], 0.0).tolist()
        [0.0, 12.0, nan]
        """
        rho2 = np.square(np.asarray(x, float)) + np.square(np.asarray(y, float))
        inside = np.where(rho2 <= self.radius**2, self.radius**2 - rho2, np.nan)
        return self.radius - np.sqrt(inside)

    def arc(self, directions: ArrayLike) -> NDArray[np.float64]:
        """Arc coordinates `[..., 2]` [mm] of directions `[..., 3]` from the centre: azimuthal equidistant.

        >>> (Eye(radius=12.0).arc([1.0, 0.0, 0.0]) / 12.0).round(6).tolist()  # a quarter of a turn from the pole
        [1.570796, 0.0]
        """
        d = np.asarray(directions, float)
        rho = np.hypot(d[..., 0], d[..., 1])
        along = self.radius * np.arctan2(rho, -d[..., 2])
        return d[..., :2] * (along / np.where(rho > 0.0, rho, 1.0))[..., None]

    def arc_gradient(self, directions: ArrayLike, by_arc: ArrayLike) -> NDArray[np.float64]:
        """Gradient `[..., 3]` over the unit sphere of what has the gradient `by_arc` `[..., 2]` over arc coordinates.

        Along the meridian an angle is radius times as long as an arc; across it, sin(angle) / angle shorter.
        """
        d, g = np.asarray(directions, float), np.asarray(by_arc, float)
        rho = np.hypot(d[..., 0], d[..., 1])
        stretch = 1.0 / np.sinc(np.arctan2(rho, -d[..., 2]) / np.pi)
        outwards = d[..., :2] / np.where(rho > 0.0, rho, 1.0)[..., None]
        along = np.sum(outwards * g, axis=-1)[..., None]
        # at the pole there is no meridian, and both stretches are 1
        across = (g - along * outwards) * stretch[..., None]
        sideways = across - along * outwards * d[..., 2:]
        return self.radius * np.concatenate([sideways, along * rho[..., None]], axis=-1)


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scalar products `[...]` of vectors `[..., 3]`, in a third of the time of a sum over the last axis."""
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])


class Globe(Model):
    """The whole eyeball, closed but for a pupil that swallows light: adds what its walls reflect to each other.

    Light bounces up to `bounces` times between walls that reflect like the retina's perifovea (or its grey).
    """

    pupil: Annotated[Length, Field(ge=0.0, le=16.0)] = 8.0  #: diameter [mm]
    bounces: int = Field(8, ge=1, le=64)
