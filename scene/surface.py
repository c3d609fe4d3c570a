"""The retina's surface: the eye's sphere, or an ellipsoid, with bumps and a height map raised towards the inside.

Whatever it is made of, it is one radius over the unit directions seen from the eye's centre, with its gradient.
"""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from conespot.scene.bump import Bump
from conespot.scene.eye import Eye
from conespot.scene.height_map import HeightMap
from conespot.scene.model import Model, named
from conespot.scene.population import semi_axes_of
from conespot.scene.quantity import format_quantity

Array = NDArray[np.float64]
_Ratio = Annotated[float, Field(gt=0.5, lt=2.0)]
_SPHERE = (1.0, 1.0, 1.0)
#: a Newton step [mm] below which the next one would be lost in rounding
_CONVERGED = 1e-9


class Surface(Model):
    """The wall with `bumps` and a `height_map` that add up; smooth without any.

    The wall touches the origin with its posterior pole. It is an ellipsoid with `semi_axes` along x, y and z in units
    of the eye's radius: (1, 1, 1.1) is a myopic eye, longer than wide. In their place `population` names an eye by its
    number, or the `mean` one, for an eye.radius of 10.311 mm.

    >>> eye, surface = Eye(), Surface(bumps=(Bump(x=0.0, y=0.0, height=0.1),))
    >>> surface.points(eye, [0.0, 0.0, -1.0]).round(9).tolist()
    [0.0, 0.0, 0.1]
    """

    semi_axes: tuple[_Ratio, _Ratio, _Ratio] = _SPHERE
    bumps: tuple[Bump, ...] = Field((), max_length=10000)
    height_map: HeightMap | None = None

    stand_ins = ("population",)

    @model_validator(mode="before")
    @classmethod
    def _of_population(cls, data: Any) -> Any:
        if not (isinstance(data, dict) and "population" in data):
            return data
        eye = data["population"]
        if "semi_axes" in data:
            raise ValueError("give either population or semi_axes")
        if eye != "mean" and not (type(eye) is int and 0 <= eye < 2**32):
            raise ValueError(f"population: the number of an eye (0, 1, ...) or mean, got {eye!r}")
        return {key: value for key, value in data.items() if key != "population"} | {"semi_axes": semi_axes_of(eye)}

    @property
    def is_sphere(self) -> bool:
        """Whether it is the eye's sphere itself."""
        return self.semi_axes == _SPHERE and self.is_smooth

    @property
    def is_smooth(self) -> bool:
        """Whether nothing is raised above the wall."""
        return not self.bumps and self.height_map is None

    @property
    def relief(self) -> float:
        """A bound of how far anything is raised above the wall, or sunk below it [mm]."""
        total = float(sum(sorted((b.height for b in self.bumps), reverse=True)[:4]))
        if self.height_map is not None:
            total += self.height_map.spline.bound
        return total

    @property
    def words(self) -> str:
        """The surface in words, as tables state it: what it is made of, how much of it and how large."""
        parts = []
        if self.semi_axes != _SPHERE:
            parts.append(f"ellipsoid {' x '.join(f'{ratio:g}' for ratio in self.semi_axes)}")
        if self.bumps:
            count = f"{len(self.bumps)} bump{'s' * (len(self.bumps) > 1)}"
            across, high = _range([b.diameter for b in self.bumps]), _range([b.height for b in self.bumps])
            parts.append(f"{count} ({across} across, {high} high)")
        if self.height_map is not None:
            parts.append(self.height_map.words)
        return " with ".join(filter(None, [parts[0], " and ".join(parts[1:])])) if parts else "smooth"

    def displacement(self, eye: Eye, directions: ArrayLike) -> Array:
        """Displacement off the eye's sphere towards its centre `[...]` [mm] in unit directions `[..., 3]`."""
        d = np.asarray(directions, float)
        return eye.radius - self._radius(eye, d.reshape(-1, 3))[0].reshape(d.shape[:-1])

    def points(self, eye: Eye, directions: ArrayLike) -> Array:
        """Surface points `[..., 3]` [mm] in unit directions `[..., 3]` seen from the eye's centre."""
        d = np.asarray(directions, float)
        return eye.centre + (eye.radius - self.displacement(eye, d))[..., None] * d

    def normals(self, eye: Eye, directions: ArrayLike) -> Array:
        """Unit normals `[..., 3]` towards the inside, exact: for r(u) u they are along -(r u - grad r)."""
        d = np.asarray(directions, float)
        radius, gradient = self._radius(eye, d.reshape(-1, 3))
        n = gradient.reshape(d.shape) - radius.reshape(d.shape[:-1])[..., None] * d
        return n / np.linalg.norm(n, axis=-1, keepdims=True)

    def intersect(self, eye: Eye, origin: ArrayLike, direction: ArrayLike) -> Array:
        """Where rays (origins, unit directions `[..., 3]`) meet the far wall: points `[..., 3]` [mm], NaN for none.

        Sphere and ellipsoid in closed form, what is raised above them by Newton's method between the ray's point
        nearest the eye's centre and the outside, to 1e-9 mm. A ray that grazes a flank may meet it more than once;
        then it is the meeting that is found from the wall.
        """
        o, d = np.asarray(origin, float), np.asarray(direction, float)
        along = self._to_wall(eye, o, d)
        if not self.is_smooth:
            o, d = np.broadcast_arrays(o, d)
            flat = self._to_surface(eye, o.reshape(-1, 3), d.reshape(-1, 3), along.ravel())
            along = flat.reshape(along.shape)
        return o + along[..., None] * d

    def _to_wall(self, eye: Eye, o: Array, d: Array) -> Array:
        """Distance `[...]` [mm] along rays to the far wall of sphere or ellipsoid."""
        if self.semi_axes == _SPHERE:
            return eye.intersect(o, d)
        # squeezed along its axes the ellipsoid is a sphere about the same pole, met at the same distances
        squeeze = 1.0 / np.array(self.semi_axes)
        return eye.intersect(o * squeeze, d * squeeze)

    def _to_surface(self, eye: Eye, o: Array, d: Array, wall: Array) -> Array:
        """Distance `[N]` [mm] to the surface from that to the wall; NaN where a ray has none."""
        v = o - eye.centre
        b = np.einsum("ij,ij->i", v, d)
        axes = eye.radius * np.array(self.semi_axes)
        outside = abs(axes[2] - eye.radius) + axes.max() + self.relief
        span = b * b - np.einsum("ij,ij->i", v, v) + outside**2
        result = np.full(len(o), np.nan)
        low, high = np.maximum(-b, 0.0), np.sqrt(np.maximum(span, 0.0)) - b
        left = np.flatnonzero(high > low)
        low, high = low[left], high[left]
        t = np.clip(np.where(np.isfinite(wall[left]), wall[left], low), low, high)
        for _ in range(100):
            v_, d_ = v[left], d[left]
            at = v_ + t[:, None] * d_
            distance = np.linalg.norm(at, axis=1)
            u = at / np.maximum(distance, 1e-300)[:, None]
            radius, gradient = self._radius(eye, u)
            beyond = distance - radius
            slope = np.einsum("ij,ij->i", u, d_) - np.einsum("ij,ij->i", gradient, d_) / np.maximum(distance, 1e-300)
            low, high = np.where(beyond < 0.0, t, low), np.where(beyond > 0.0, t, high)
            step = -beyond / np.where(np.abs(slope) > 1e-6, slope, np.inf)
            newton = (np.abs(slope) > 1e-6) & (t + step >= low) & (t + step <= high)
            t = np.where(newton, t + step, 0.5 * (low + high))
            closed = high - low < 1e-12
            # the bracket of a ray that begins outside closes where there is no surface
            done = np.where(closed, np.abs(beyond), np.where(newton, np.abs(step), np.inf)) < _CONVERGED
            result[left[done]] = t[done]
            going = ~done & ~closed
            if not going.any():
                break
            left, t, low, high = left[going], t[going], low[going], high[going]
        return result

    def _radius(self, eye: Eye, d: Array) -> tuple[Array, Array]:
        """Distance from the eye's centre `[N]` [mm] in unit directions `[N, 3]`, and its gradient there `[N, 3]`."""
        radius, gradient = self._wall(eye, d)
        for bump, axis in zip(self.bumps, self._axes(eye) if self.bumps else (), strict=True):
            widest = math.cos(min(bump.reach / eye.radius, math.pi))
            near = np.flatnonzero(d @ axis > widest)
            if not len(near):  # a tip's wall is near few of them, and asked for a few points at a time
                continue
            here = d[near]
            # the chord gives the arc to full precision where the cosine would lose half the digits
            arc = 2.0 * eye.radius * np.arcsin(np.clip(np.linalg.norm(here - axis, axis=-1) / 2.0, 0.0, 1.0))
            height, slope = bump.at(arc)
            radius[near] -= height
            away = here * np.sum(here * axis, axis=-1, keepdims=True) - axis  # tangential, away from the centre
            length = np.linalg.norm(away, axis=-1)
            gradient[near] -= (slope * eye.radius / np.where(length > 0.0, length, 1.0))[:, None] * away
        if self.height_map is not None:
            height, by_arc = self.height_map.at(eye.arc(d))
            radius -= height
            gradient -= eye.arc_gradient(d, by_arc)
        return radius, gradient

    def _wall(self, eye: Eye, d: Array) -> tuple[Array, Array]:
        """`_radius` of sphere or ellipsoid."""
        if self.semi_axes == _SPHERE:
            return np.full(len(d), eye.radius), np.zeros_like(d)
        axes = eye.radius * np.array(self.semi_axes)
        v = (eye.centre - [0.0, 0.0, axes[2]]) / axes
        w = d / axes
        a, b = np.einsum("ij,ij->i", w, w), w @ v
        radius = (np.sqrt(b * b - a * (v @ v - 1.0)) - b) / a
        outwards = (v + radius[:, None] * w) / axes
        along = np.einsum("ij,ij->i", outwards, d)
        return radius, -radius[:, None] * (outwards / along[:, None] - d)

    def _axes(self, eye: Eye) -> Array:
        xy = np.array([(b.x, b.y) for b in self.bumps]).reshape(-1, 2)
        on_wall = np.column_stack([xy, eye.height(xy[:, 0], xy[:, 1])]) - eye.centre
        return on_wall / eye.radius


def _range(lengths: list[float]) -> str:
    """The lengths from the smallest to the largest, such as "0.2 to 0.5 mm"."""
    low, high = min(lengths), max(lengths)
    return format_quantity(low, "length") if low == high else f"{low:g} to {format_quantity(high, 'length')}"


_GAUSSIAN, _COSINE = Bump(x=0.0, y=0.0, profile="gaussian"), Bump(x=0.0, y=0.0, profile="cosine")


def bump_grid(apart: tuple[float, float] = (5.0, 2.5), like: Bump = _GAUSSIAN) -> Surface:
    """15 bumps `like` one in a 3 x 5 grid about the pole, so far `apart` in x and y [mm].

    The paper's deformation (4.2) is bumps "around 0.5 mm in diameter", 0.1 mm high, in "a 3 x 5 grid across the area
    of interest" of 10 x 10 mm. The defaults are the reading that explains Table V: Gaussians, in a grid from edge to
    edge of the area. docs/reproduction.md has the others that were tried.
    """
    columns, rows = apart[0] * np.arange(-1.0, 2.0), apart[1] * np.arange(-2.0, 3.0)
    return Surface(bumps=tuple(like.model_copy(update={"x": float(x), "y": float(y)}) for y in rows for x in columns))


#: `bumps-literal` is what Table V does not fit: raised cosines, each in the middle of one of 15 equal cells
SURFACES = {"smooth": Surface(), "bumps": bump_grid(), "bumps-literal": bump_grid((10.0 / 3.0, 2.0), _COSINE)}


AnySurface = Annotated[Surface, named(SURFACES, "surface")]


def surface_name(surface: Surface) -> str:
    """`smooth`, `bumps`, or what a surface of one's own is made of."""
    for name, known in SURFACES.items():
        if surface.height_map is None and known.model_dump_json() == surface.model_dump_json():
            return name  # as they are written: a third of a millimetre read back from a file is another float
    parts = []
    if surface.semi_axes != _SPHERE:
        parts.append(f"ellipsoid {' x '.join(f'{ratio:g}' for ratio in surface.semi_axes)}")
    if surface.bumps:
        parts.append(f"{len(surface.bumps)} bump{'s' * (len(surface.bumps) > 1)}")
    if surface.height_map is not None:
        parts.append("height map")
    return " with ".join(filter(None, [parts[0], " and ".join(parts[1:])]))
