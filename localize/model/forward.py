"""The image model the estimators share: beam, inverse square, cosine and pixel integration, with its Jacobian.

Radiance of a Lambertian surface of albedo a at P, lit from the apex A by K cones of profile g and on-axis radiant
intensity I0, under an ambient irradiance E:

    L = a / pi * (E + I0 f sum_k G_k),   f = n.(A - P) / |A - P|^3,   G_k = mean of g over the pixel.

A pixel is a square box that averages. Across a pixel the profile's own variable w (the cosine off the axis, or minus
the angle) is a plane, so the mean of g over the square is the second difference of g's second antiderivative
(`Profile.mean`). For a hard edge that is the exact area of a box cut by a half plane. What spreads the image is a
kernel along w as well (`model.spread`), under which the profile is known in closed form (`model.smooth`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.profile import Profile
from conespot.localize.model.rise import Rise
from conespot.localize.model.sight import Sight
from conespot.localize.model.smooth import Smooth
from conespot.localize.model.spread import Spread
from conespot.scene.pose import Pose, tangents
from conespot.scene.scene import Scene
from conespot.scene.spotlights import spotlight_axes

Array = NDArray[np.float64]


def rotation_basis(axis: Array) -> Array:
    """Rotation vectors `[3, 3]`, one a row, that move `axis` along U, along V, and roll about it [rad]."""
    u, v = tangents(axis)
    return np.stack([-v, u, axis])


def moved(pose: Pose, step: Array) -> Pose:
    """`pose` after `step` = (dx, dy, dz [mm], du, dv[, droll] [rad]), the parameters of every fit."""
    basis = rotation_basis(pose.axis)
    vector = step[3:] @ basis[: len(step) - 3]
    rotation = _rotation(vector) @ pose.rotation()
    axis = rotation @ np.array([0.0, 0.0, -1.0])
    axis = axis / np.linalg.norm(axis)
    bare = Pose(pose.apex + step[:3], axis)
    if len(step) == 5:
        return bare
    turn = bare.rotation().T @ rotation
    return Pose(bare.apex, axis, float(np.arctan2(turn[1, 0], turn[0, 0])))


def _rotation(vector: Array) -> Array:
    """Rodrigues: the rotation `[3, 3]` by `vector` `[3]` [rad]."""
    angle = float(np.linalg.norm(vector))
    k = np.array([[0.0, -vector[2], vector[1]], [vector[2], 0.0, -vector[0]], [-vector[1], vector[0], 0.0]])
    if angle < 1e-8:
        return np.asarray(np.eye(3) + k + k @ k / 2.0)
    return np.asarray(np.eye(3) + np.sin(angle) / angle * k + (1.0 - np.cos(angle)) / angle**2 * (k @ k))


@dataclass(frozen=True)
class Light:
    """Spotlight irradiance at N pixels, for unit on-axis intensity, and its derivatives."""

    value: Array  #: f sum_k G_k `[N]` [1/mm^2]
    jacobian: Array  #: `[P, N]`: per mm of the apex, per rad along U, V (and roll), then per unit of every change


def light(
    sight: Sight,
    pose: Pose,
    scene: Scene,
    profile: Profile,
    *,
    pose_size: int = 5,
    changes: Sequence[tuple[Profile, Profile, float]] = (),
    widenings: Sequence[tuple[Scene, float]] = (),
    wall: float = 0.0,
) -> Light:
    """The spotlights' irradiance on what `sight` sees: the cones' pixel means times cosine over distance squared.

    The Jacobian has a row for each of `pose_size` pose parameters, the sixth being the roll, and one for each of the
    `changes`: the profile at a little more and a little less of some quantity, and how much lies between them; then
    one for each of the `widenings`: the scene with a wider spread of the image, and how much wider. Where light spreads
    on the wall as well, by a Gaussian of the variance `wall` [mm^2], the last row is that one's.
    """
    cones = Cones(sight, pose, scene, profile, pose_size=pose_size, wall=wall)
    rows = [cones.by_beam(*change) for change in changes] + [cones.by_spread(*wider) for wider in widenings]
    if wall > 0.0:
        rows.append(cones.by_spread(scene, wall, 2.0 * wall))
    return Light(cones.value, np.stack([*cones.rows, *rows]))


class Cones:
    """The cones of a pose on what a sight sees: their light, and derivatives of it as one after the other is asked."""

    value: Array  #: of `Light` `[N]`
    rows: Array  #: its derivatives by the pose `[5 or 6, N]`

    def __init__(
        self, sight: Sight, pose: Pose, scene: Scene, profile: Profile, *, pose_size: int = 5, wall: float = 0.0
    ) -> None:
        """As `light` takes them."""
        self._sight, self._pose, self._wall, self._profile = sight, pose, wall, profile
        radius = scene.eye.radius
        basis = rotation_basis(pose.axis)[: pose_size - 3]
        to = sight.points - pose.apex
        d2 = np.einsum("ij,ij->i", to, to)
        d = np.sqrt(d2)
        to /= d[:, None]
        cosine = -np.einsum("ij,ij->i", sight.normals, to)
        self._f = f = np.maximum(cosine, 0.0) / d2
        falloff = (sight.normals / d2[:, None] + 3.0 * (cosine / d2)[:, None] * to) / d[:, None]
        self._spread = spread = Spread.of(scene, sight, pose, wall)
        total, rows = np.zeros(len(d)), np.zeros((3 + len(basis), len(d)))
        mixed = np.zeros(len(d))  # light that a spread brings where it falls off across the edge
        self._each = []
        for axis in spotlight_axes(pose, scene.spotlights):
            cone = _Cone.of(Rise.of(sight, axis, to, d, profile), spread, profile, radius)
            self._each.append(cone)
            rise, here = cone.rise, cone.here
            total += here.mean
            slope = here.slope * rise.stretch
            if not spread.is_none:
                mixed += slope * spread.covariance(rise, falloff, radius)
            slope = slope * cone.pace * f
            turns = np.array([cross(vector, axis) for vector in basis])
            rows[:3] -= slope * rise.across.T
            rows[3:] += slope * (turns @ to.T)
            if profile.is_a_step:
                # what a pixel shows of a step is where it lies [px]: where the cosine rises faster, nearer
                at = np.flatnonzero(slope)
                rows[:, at] -= slope[at] * (rise.c[at] - profile.knots[0]) * rise.steeper(at, turns)
        lit = cosine > 0.0
        rows[:3] += np.where(lit, total, 0.0) * falloff.T
        self.rows = rows
        self.value = total * f if spread.is_none else total * f + np.where(lit, mixed, 0.0)

    def by_beam(self, wide: Profile, narrow: Profile, between: float) -> Array:
        """The light's derivative `[N]` by what makes the profile the one or the other, `between` which lies so much."""
        off = sum(cone.pace * (cone.average(wide).mean - cone.average(narrow).mean) for cone in self._each)
        return np.asarray(self._f * off / between)

    def by_pixels(self, sides: tuple[Sight, Sight], step: float) -> Array:
        """The light's derivative `[N]` by a quantity as far as pixels become larger or smaller on the wall with it.

        `sides` are what they see at +-`step` of it; where they look to, `light_by_surface` takes in.
        """
        found = np.zeros(len(self._f))
        if self._profile.is_a_step:
            x, y = ((getattr(sides[0], k) - getattr(sides[1], k)) / (2.0 * step) for k in ("along_x", "along_y"))
            for cone in self._each:
                found -= cone.pace * cone.here.slope * (cone.rise.c - self._profile.knots[0]) * cone.rise.larger(x, y)
        return np.asarray(self._f * found)

    def by_spread(self, wider: Scene, step: float, wall: float | None = None) -> Array:
        """The light's derivative `[N]` by what makes the image's spread that of another scene, or on the `wall`.

        A spread wider by a variance adds that much of half the second derivative: the heat equation.
        """
        more = Spread.of(wider, self._sight, self._pose, self._wall if wall is None else wall)
        found = np.zeros(len(self._f))
        for cone in self._each:
            found += cone.bend * (more.widths(cone.rise).variance - cone.variance)
        return np.asarray(self._f * found / step)


@dataclass(frozen=True, eq=False)
class _Cone:
    """One of them, averaged over pixels and what spreads the image."""

    rise: Rise
    here: Smooth
    pace: Array  #: how fast the variable in the mean over a pixel grows with that in its middle `[N]`
    average: Callable[[Profile], Smooth]  #: of any profile in the beam's place
    curved: Callable[[], Array]  #: second derivative of the mean by the variable `[N]`, which hardly anybody asks for
    spread: Spread

    @classmethod
    def of(cls, rise: Rise, spread: Spread, profile: Profile, radius: float) -> _Cone:
        """Of a beam's profile, on a wall of that radius."""
        px, py = rise.halves
        if spread.is_none:
            (sharp, pace), nothing = rise.on_pixels(profile, radius), np.zeros(0)
            here = Smooth(*profile.mean(sharp, px, py), nothing, nothing)

            def mean(of: Profile) -> Smooth:
                return Smooth(*of.mean(sharp, px, py), nothing, nothing)

            return cls(rise, here, pace, mean, lambda: profile.curvature(sharp, px, py), spread)
        widths = spread.widths(rise)
        w, pace, skew = spread.bent(rise, widths, profile, radius)
        # of what is sought, less than a pixel's own variance
        least = (np.square(rise.gx) + np.square(rise.gy)) / 12.0 if spread.sought else 0.0
        over = widths.average(least, rise.stretch)

        def average(of: Profile) -> Smooth:
            found = over(of, w, px, py)
            return replace(found, mean=found.mean + skew * rise.stretch**3 * found.third)

        here = average(profile)
        return cls(rise, here, pace, average, lambda: here.curvature, spread)

    @cached_property
    def bend(self) -> Array:
        """Half the second derivative of the mean by the cosine `[N]`."""
        return np.asarray(self.curved() * np.square(self.rise.stretch) / 2.0)

    @cached_property
    def variance(self) -> Array:
        """What spreads the image, along the cosine `[N]`."""
        return self.spread.widths(self.rise).variance


def cross(a: Array, b: Array) -> Array:
    """The cross product of two vectors `[3]`, in a tenth of the time of numpy's."""
    return np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def light_by_surface(here: Light, sight: Sight, pose: Pose, sides: tuple[Sight, Sight], step: float) -> Array:
    """Derivative of the light `[N]` by a quantity that moves the surface, from what the pixels see at +-`step` of it.

    The light depends on points less apex and on normals, so the apex' own Jacobian is used: the size of the whole
    scene, which no image tells, then stays exactly unobservable.
    """
    points = (sides[0].points - sides[1].points) / (2.0 * step)
    normals = (sides[0].normals - sides[1].normals) / (2.0 * step)
    to = sight.points - pose.apex
    cosine = np.einsum("ij,ij->i", sight.normals, to)
    turned = np.einsum("ij,ij->i", normals, to) / np.where(np.abs(cosine) > 1e-9, cosine, np.inf)
    return np.asarray(here.value * turned - np.einsum("ji,ij->i", here.jacobian[:3], points))


def ambient_irradiance(sight: Sight, scene: Scene) -> Array:
    """The microscope's irradiance on what `sight` sees `[N]`, relative to that on a plane across its beam."""
    return np.maximum(sight.normals @ scene.ambient.towards, 0.0)
