"""How far the curve in which a cone meets the eye's sphere is from an ellipse (paper, Eqs. 8-21, Table I).

Everything stands in the cone's frame: apex at the origin, axis along +z into the light, x^2 + y^2 = c^2 z^2 with
c = tan beta, and the sphere's centre at (x0, 0, z0). Any cone and sphere come to this by turning about the axis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.localize.theory.settings import THEORY

Array = NDArray[np.float64]

#: Table I: a vertical axis, the apex 5 mm above the pole of a 12 mm sphere and x0 aside
_TABLE_RADIUS, _TABLE_X0, _TABLE_Z0 = 12.0, 4.45, -7.0
#: the volume of interest (sections 1 and 3.3): half width [mm], height above the pole [mm], and the RCM [mm]
_HALF_WIDTH, _HEIGHT, _RCM = 5.0, 5.0, (6.0, 0.0, 22.0)


@dataclass(frozen=True)
class ConeSphere:
    """A cone of `half_angle` [rad] inside a sphere of `radius` whose centre is (x0, 0, z0) from the apex [mm].

    Raises ValueError for an apex that is not inside the sphere.
    """

    half_angle: float
    x0: float
    z0: float
    radius: float

    def __post_init__(self) -> None:
        if not math.hypot(self.x0, self.z0) < self.radius:
            raise ValueError("the apex must be inside the sphere")

    @property
    def slope(self) -> float:
        """c = tan beta."""
        return math.tan(self.half_angle)

    @property
    def interval(self) -> tuple[float, float]:
        """Smallest and largest x of the curve [mm], where it crosses the plane y = 0 (Eqs. 13-15).

        The cone's two lines z = x/c and z = -x/c meet the sphere at the roots with
        (x0 +- z0/c)^2 - (1 + 1/c^2) (x0^2 + z0^2 - r^2) under them; of each pair one is in the light, z > 0.
        """
        c, q = self.slope, 1.0 + 1.0 / self.slope**2
        level = q * (self.x0**2 + self.z0**2 - self.radius**2)
        right, left = self.x0 + self.z0 / c, self.x0 - self.z0 / c
        return (left - math.sqrt(left**2 - level)) / q, (right + math.sqrt(right**2 - level)) / q

    def curve(self, x: ArrayLike) -> tuple[Array, Array]:
        """y >= 0 and z of the cone-sphere curve at x inside the interval [mm] (Eqs. 8-12)."""
        at = np.asarray(x, float)
        c2 = self.slope**2
        level = self.x0**2 + self.z0**2 - self.radius**2
        z = (self.z0 + np.sqrt(self.z0**2 - (1.0 + c2) * (level - 2.0 * at * self.x0))) / (1.0 + c2)
        return np.sqrt(np.maximum(c2 * z * z - at * at, 0.0)), z

    def ellipse(self, x: ArrayLike) -> tuple[Array, Array]:
        """y' >= 0 and z' of the ellipse at x inside the interval [mm] (Eqs. 16-21).

        The ellipse is the cone's section with the plane through the curve's two ends A, B that is parallel to y.
        """
        at = np.asarray(x, float)
        low, high = self.interval
        z_a, z_b = high / self.slope, -low / self.slope
        z = z_b + (z_a - z_b) * (at - low) / (high - low)
        return np.sqrt(np.maximum(self.slope**2 * z * z - at * at, 0.0)), z

    def in_plane_difference(self, points: int = THEORY.in_plane_points) -> float:
        """Largest |y - y'| at equal x [mm], the number of Table I."""
        low, high = self.interval
        x = (low + high) / 2.0 + (high - low) / 2.0 * np.cos(np.linspace(0.0, math.pi, points))
        return float(np.max(np.abs(self.curve(x)[0] - self.ellipse(x)[0])))

    def distance(self, points: int = THEORY.space_points) -> float:
        """Largest distance in space between curve and ellipse along the cone's generators [mm]."""
        return float(_distances(self.half_angle, np.array([self.x0]), np.array([self.z0]), self.radius, points)[0])


def _distances(half_angle: float, x0: Array, z0: Array, radius: float, points: int) -> Array:
    """Largest distance `[N]` between curve and ellipse for sphere centres `[N]`, see `ConeSphere.distance`."""
    phi = np.linspace(0.0, math.pi, points)
    along_x, along_z = math.sin(half_angle) * np.cos(phi), math.cos(half_angle)
    middle = x0[:, None] * along_x + z0[:, None] * along_z
    level = (x0**2 + z0**2 - radius**2)[:, None]
    curve = middle + np.sqrt(middle**2 - level)  # how far along each generator the sphere is
    # the plane through the two ends: n . p = n . A with n across A - B in the plane y = 0
    ax, az = curve[:, 0] * along_x[0], curve[:, 0] * along_z
    bx, bz = curve[:, -1] * along_x[-1], curve[:, -1] * along_z
    nx, nz = -(az - bz), ax - bx
    ellipse = (nx * ax + nz * az)[:, None] / (nx[:, None] * along_x + nz[:, None] * along_z)
    return np.asarray(np.max(np.abs(curve - ellipse), axis=1))


def volume_distance(half_angle: float, radius: float = _TABLE_RADIUS, cells: int = THEORY.volume_cells) -> float:
    """Largest distance between curve and ellipse [mm] for tips in the volume of interest, axis through the RCM.

    The volume is the 10 x 10 x 5 mm above the pole, as far as it is inside the eye, on a grid of `cells` x `cells`
    x `cells` cells, corners included.
    """
    side, up = np.linspace(-_HALF_WIDTH, _HALF_WIDTH, cells + 1), np.linspace(0.0, _HEIGHT, cells + 1)
    tips = np.stack(np.meshgrid(side, side, up, indexing="ij"), axis=-1).reshape(-1, 3)
    centre = np.array([0.0, 0.0, radius]) - tips
    inside = np.linalg.norm(centre, axis=-1) < radius
    axis = tips - np.array(_RCM)
    axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
    z0 = np.sum(centre * axis, axis=-1)
    x0 = np.linalg.norm(centre - z0[:, None] * axis, axis=-1)
    return float(np.max(_distances(half_angle, x0[inside], z0[inside], radius, THEORY.volume_points)))


@dataclass(frozen=True)
class TableRow:
    """One column of Table I, lengths in micrometres."""

    half_angle_deg: float
    in_plane_um: float  #: largest |y - y'| at equal x, as published
    distance_um: float  #: largest distance in space, same cone
    volume_distance_um: float  #: largest distance in space over the volume of interest


def table_1(half_angles: Sequence[float] = THEORY.half_angles) -> list[TableRow]:
    """Table I for half angles [rad], in the paper's sense and in space.

    Raises ValueError for an angle outside 0 to 45 deg.
    """
    rows = []
    for angle in half_angles:
        if not 0.0 < angle < math.pi / 4.0:
            raise ValueError(f"half angle {math.degrees(angle):g} deg is outside 0 to 45 deg")
        cone = ConeSphere(angle, _TABLE_X0, _TABLE_Z0, _TABLE_RADIUS)
        row = (cone.in_plane_difference(), cone.distance(), volume_distance(angle))
        rows.append(TableRow(round(math.degrees(angle), 9), *(1e3 * mm for mm in row)))
    return rows
