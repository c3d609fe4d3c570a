"""The retina's surface: the eye's sphere, smooth or with bumps raised towards the inside."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from scene.eye import Eye
from scene.model import Model, named
from scene.quantity import Length

Array = NDArray[np.float64]


class Bump(Model):
    """A raised-cosine bump above (x, y): h = height cos^2(pi rho / diameter) for rho < diameter / 2.

    rho is the distance along the sphere from the bump's centre. The paper (4.2) states diameter and height only;
    the raised cosine has no kink at its foot.
    """

    x: Length
    y: Length
    diameter: Length = Field(0.5, gt=0.0)
    height: Length = Field(0.1, ge=0.0)


class Surface(Model):
    """The sphere with `bumps`; smooth without any."""

    bumps: tuple[Bump, ...] = Field((), max_length=10000)

    @property
    def relief(self) -> float:
        """Highest possible displacement towards the inside [mm]."""
        return float(sum(sorted((b.height for b in self.bumps), reverse=True)[:4])) if self.bumps else 0.0

    def displacement(self, eye: Eye, directions: ArrayLike) -> Array:
        """Displacement towards the centre `[...]` [mm] in unit directions `[..., 3]` seen from the eye's centre."""
        d = np.asarray(directions, float)
        total = np.zeros(d.shape[:-1])
        for bump, axis in zip(self.bumps, self._axes(eye), strict=True):
            # the chord gives the arc to full precision where the cosine would lose half the digits
            arc = 2.0 * eye.radius * np.arcsin(np.clip(np.linalg.norm(d - axis, axis=-1) / 2.0, 0.0, 1.0))
            phase = np.pi * arc / bump.diameter
            total += np.where(arc < bump.diameter / 2.0, bump.height * np.cos(phase) ** 2, 0.0)
        return total

    def points(self, eye: Eye, directions: ArrayLike) -> Array:
        """Surface points `[..., 3]` [mm] in unit directions `[..., 3]` seen from the eye's centre."""
        d = np.asarray(directions, float)
        return eye.centre + (eye.radius - self.displacement(eye, d))[..., None] * d

    def normals(self, eye: Eye, directions: ArrayLike) -> Array:
        """Unit normals `[..., 3]` towards the inside, exact: for r(u) u they are along -(r u - grad r)."""
        d = np.asarray(directions, float)
        radius = eye.radius - self.displacement(eye, d)
        gradient = np.zeros_like(d)  # of the radius over the unit sphere, tangential
        for bump, axis in zip(self.bumps, self._axes(eye), strict=True):
            chord = np.linalg.norm(d - axis, axis=-1)
            arc = 2.0 * eye.radius * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0))
            inside = (arc < bump.diameter / 2.0) & (chord > 0.0)
            slope = np.pi * bump.height / bump.diameter * np.sin(2.0 * np.pi * arc / bump.diameter)
            away = d * np.sum(d * axis, axis=-1, keepdims=True) - axis  # tangential, away from the bump's centre
            length = np.linalg.norm(away, axis=-1)
            unit = away / np.where(length > 0.0, length, 1.0)[..., None]
            gradient += np.where(inside, slope * eye.radius, 0.0)[..., None] * unit
        n = gradient - radius[..., None] * d
        return n / np.linalg.norm(n, axis=-1, keepdims=True)

    def intersect(self, eye: Eye, origin: ArrayLike, direction: ArrayLike) -> Array:
        """Where rays (origins, unit directions `[..., 3]`) meet the far wall: points `[..., 3]` [mm], NaN for none.

        Fixed point on the radius: the displaced wall is met where the sphere of the radius found last is. A ray that
        grazes a bump's flank may meet it more than once; the meeting nearest the undisturbed sphere is returned.
        """
        o, d = np.broadcast_arrays(np.asarray(origin, float), np.asarray(direction, float))
        point = o + eye.intersect(o, d)[..., None] * d
        if not self.bumps:
            return point
        v = o - eye.centre
        b = np.sum(v * d, axis=-1)
        c = np.sum(v * v, axis=-1)
        for _ in range(60):
            outward = point - eye.centre
            radius = eye.radius - self.displacement(eye, outward / np.linalg.norm(outward, axis=-1, keepdims=True))
            disc = b * b - c + radius**2
            moved = o + (np.sqrt(np.where(disc >= 0.0, disc, np.nan)) - b)[..., None] * d
            step = np.nanmax(np.abs(moved - point), initial=0.0)
            point = moved
            if step < 1e-12:
                break
        return point

    def _axes(self, eye: Eye) -> Array:
        xy = np.array([(b.x, b.y) for b in self.bumps]).reshape(-1, 2)
        on_wall = np.column_stack([xy, eye.height(xy[:, 0], xy[:, 1])]) - eye.centre
        return on_wall / eye.radius


def bump_grid() -> Surface:
    """The paper's deformation (4.2): 15 bumps in a 3 x 5 grid, centred in equal cells of the 10 x 10 mm area."""
    return Surface(
        bumps=tuple(
            Bump(x=10.0 * ((i + 0.5) / 3.0 - 0.5), y=10.0 * ((j + 0.5) / 5.0 - 0.5)) for j in range(5) for i in range(3)
        )
    )


SURFACES = {"smooth": Surface(), "bumps": bump_grid()}


AnySurface = Annotated[Surface, named(SURFACES, "surface")]


def surface_name(surface: Surface) -> str:
    """`smooth`, `bumps`, or the number of bumps for a surface of one's own."""
    return next((name for name, known in SURFACES.items() if known == surface), f"{len(surface.bumps)} bumps")
