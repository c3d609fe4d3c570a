"""Exact refraction of rays at conics, for numpy's arrays and Dr.Jit's alike: the same lines trace for both.

A vector is a tuple of its three components. Nothing is tested: where a ray misses a surface, or is reflected in all,
the square root of a negative number makes it NaN, in both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from conespot.scene.media import Medium, Numbers

Vector = tuple[Numbers, Numbers, Numbers]
Root = Callable[[Numbers], Numbers]


@dataclass(frozen=True)
class Interface:
    """A conic about the z axis: x^2 + y^2 + (1 + Q) s^2 = 2 R s at a depth s below its vertex."""

    z: float  #: of its vertex [mm]
    curvature: float  #: 1 / R [1/mm], positive if the centre lies below; 0 is a plane
    asphericity: float  #: Q
    below: Medium


def to_plane(z: float, origin: Vector, direction: Vector) -> Vector:
    """Where rays meet the plane at height `z` [mm]."""
    t = (z - origin[2]) / direction[2]
    return origin[0] + t * direction[0], origin[1] + t * direction[1], z


def refract(at: Interface, ratio: Numbers, origin: Vector, direction: Vector, sqrt: Root) -> tuple[Vector, Vector]:
    """Where downward rays of unit `direction` meet a conic, and their unit directions behind it.

    `ratio` is the index above over that below. Of the conic's two meetings it is the one nearer its vertex.
    """
    # from the vertex plane on no large numbers cancel, which Dr.Jit's single precision needs
    x, y, _ = to_plane(at.z, origin, direction)
    dx, dy, dz = direction
    k, p = at.curvature, 1.0 + at.asphericity
    a = k * (dx * dx + dy * dy + p * dz * dz)
    b = k * (x * dx + y * dy) + dz
    c = k * (x * x + y * y)
    t = c / (sqrt(b * b - a * c) - b)
    x, y, rise = x + t * dx, y + t * dy, t * dz
    nx, ny, nz = k * x, k * y, 1.0 + k * p * rise
    scale = 1.0 / sqrt(nx * nx + ny * ny + nz * nz)
    nx, ny, nz = scale * nx, scale * ny, scale * nz
    cosine = -(nx * dx + ny * dy + nz * dz)
    along = ratio * cosine - sqrt(1.0 - ratio * ratio * (1.0 - cosine * cosine))
    bent = ratio * dx + along * nx, ratio * dy + along * ny, ratio * dz + along * nz
    return (x, y, at.z + rise), bent


def through(
    interfaces: Sequence[Interface], indices: Sequence[Numbers], origin: Vector, direction: Vector, sqrt: Root
) -> tuple[Vector, Vector]:
    """Rays behind the last of several interfaces, from the top; `indices` has one more: of what is above the first."""
    for at, above, below in zip(interfaces, indices[:-1], indices[1:], strict=True):
        origin, direction = refract(at, above / below, origin, direction, sqrt)
    return origin, direction
