"""Even spreads of an image, as a beam's variable sees them: lens, defocus, a core, a motion, light under the retina.

Across an edge the variable is a plane, so a spread of any kind is one along it, with the variance that it has there.
Where the light falls off across it, or the outline is curved, it moves the edge as well: by the covariance of light and
variable, and by half the variance times the second derivative.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.point_spread import lens_variance
from conespot.localize.model.profile import Profile
from conespot.localize.model.rise import Rise
from conespot.localize.model.sight import Sight
from conespot.localize.model.smear import Smeared, way_covariance
from conespot.localize.model.smooth import Smooth, smeared, smoothed
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: standard deviations on either side of an edge where its bend counts
_FAR = 4.0
_STEP = 0.01  # of the tip [mm], for second differences


#: the means over pixels of a profile at variables `[N]` that rise by 2 px and 2 py along their sides
Averaging = Callable[[Profile, Array, Array, Array], Smooth]


@dataclass(frozen=True)
class Widths:
    """Variances `[N]` that spreads have along one beam's cosine."""

    lens: Array  #: of a Gaussian
    defocus: Array  #: of discs: out of focus,
    core: Array  #: and of the tip
    way: Array  #: of a steady motion
    wall: Array  #: of a Gaussian on the wall

    @property
    def variance(self) -> Array:
        """All of it; below zero where a way that is being sought takes off more than the others have."""
        return np.asarray(self.lens + self.defocus + self.core + self.way + self.wall)

    def average(self, least: Array | float, stretch: Array | float) -> Averaging:
        """Means over pixels of a profile whose variable rises by `stretch` of the cosine, at centres `[N]`.

        A motion is exact where nothing else but a Gaussian spreads the image. Other mixtures are a Gaussian and a disc
        of the same variance and fourth cumulant: a disc's is minus the square of its variance, a steady motion's 1.2
        times as much. What has less variance than `least` is continued in a straight line from there, as light is
        linear in it: a way that is being sought takes off more than there is.
        """
        short = np.minimum(self.variance - least, 0.0)
        whole = self.variance - short
        way = np.maximum(self.way, 0.0)
        straight = bool(np.any(way)) and not (np.any(self.defocus) or np.any(self.core))
        own = way if straight else np.sqrt(np.square(self.defocus) + np.square(self.core) + 1.2 * np.square(way))
        own = np.minimum(own, whole)
        spread, reach = (smeared, np.sqrt(3.0 * own)) if straight else (smoothed, 2.0 * np.sqrt(own))

        def over(profile: Profile, w: Array, px: Array, py: Array) -> Smooth:
            found = spread(profile, w, px, py, (whole - own) * np.square(stretch), reach * stretch)
            more = short * np.square(stretch) / 2.0
            if not np.any(more):
                return found
            mean, slope = found.mean + more * found.curvature, found.slope + more * found.third
            return replace(found, mean=mean, slope=slope)

        return over


@dataclass(frozen=True)
class Spread:
    """Spreads of an image whose pixels are bins of some side, and of the tip."""

    lens: tuple[float, float]  #: variances of a Gaussian along and down the image [bins^2]
    defocus: Array | None  #: variance of the disc at each pixel `[N]` [bins^2]
    core: float  #: variance of the disc at the tip, across the cone's axis [mm^2]
    way: Array | None  #: covariance of the tip's places `[3, 3]` [mm^2]; the needle goes on through the RCM
    needle: tuple[Array, float]  #: its axis `[3]`, and how far the tip is from the RCM [mm]
    wall: float  #: variance of a Gaussian on the wall [mm^2]: light that comes back beside where it fell
    sought: bool  #: whether the way is being estimated, and may be no covariance yet

    @classmethod
    def of(cls, scene: Scene, sight: Sight, pose: Pose, wall: float = 0.0) -> Spread:
        """The spreads of a scene for what a sight's pixels see, for an instrument near a pose.

        Of `wall` [mm^2] a scene tells by its retina (`model.deep`).
        """
        variance, core, way = lens_variance(scene), scene.beam.source_diameter / 2.0, way_covariance(scene)
        along = variance / (scene.camera.pixel_pitch * sight.side) ** 2
        return cls(
            (along, along * scene.camera.pixel_aspect**2),
            sight.confusion / (4.0 * sight.side**2) if len(sight.confusion) else None,
            core**2 / 4.0,
            way if np.any(way) else None,
            (pose.axis, float(np.linalg.norm(pose.apex - np.asarray(scene.instrument.rcm)))),
            wall,
            isinstance(scene.motion, Smeared),
        )

    @staticmethod
    def in_scene(scene: Scene) -> bool:
        """Whether a scene has any, but that on the wall."""
        sharp = scene.camera.pupil == 0.0 and not np.any(way_covariance(scene))
        return not sharp or lens_variance(scene) > 0.0 or scene.beam.source_diameter > 0.0

    @property
    def is_none(self) -> bool:
        """Whether all is sharp."""
        return not (any(self.lens) or self.core or self.wall) and self.defocus is None and self.way is None

    def widths(self, rise: Rise) -> Widths:
        """The variances along a beam's cosine."""
        squares, nothing = (np.square(rise.gx), np.square(rise.gy)), np.zeros_like(rise.gx)
        core, way, wall = nothing, nothing, nothing
        if self.core:
            flat = np.einsum("ij,ij->i", rise.across, rise.across) - np.square(rise.across @ rise.axis)
            core = self.core * np.maximum(flat, 0.0)
        if self.way is not None:
            tip = self._by_tip(rise)
            way = np.einsum("ij,jk,ik->i", tip, self.way, tip)
        if self.wall:
            along = rise.along_wall
            wall = self.wall * np.einsum("ij,ij->i", along, along)
        return Widths(
            self.lens[0] * squares[0] + self.lens[1] * squares[1],
            nothing if self.defocus is None else self.defocus * (squares[0] + squares[1]),
            core,
            way,
            wall,
        )

    def covariance(self, rise: Rise, gradient: Array, radius: float) -> Array:
        """Covariance `[N]` of the cosine and the light, whose `gradient` over the tip is `[N, 3]`.

        Over the surface point it is that turned round, and what the normal's turn on a wall of that radius adds.
        """
        over = rise.to / (radius * np.square(rise.d))[:, None] - gradient
        x, y = (np.einsum("ij,ij->i", over, a) for a in (rise.sight.along_x, rise.sight.along_y))
        defocus = 0.0 if self.defocus is None else self.defocus
        found = x * rise.gx * (self.lens[0] + defocus) + y * rise.gy * (self.lens[1] + defocus)
        if self.core:
            flat = rise.across - (rise.across @ rise.axis)[:, None] * rise.axis
            found = found - self.core * np.einsum("ij,ij->i", gradient, flat)
        if self.way is not None:
            found = found + np.einsum("ij,jk,ik->i", gradient, self.way, self._by_tip(rise))
        if self.wall:
            found = found + self.wall * np.einsum("ij,ij->i", over, rise.along_wall)
        return np.asarray(found)

    def bent(self, rise: Rise, widths: Widths, profile: Profile, radius: float) -> tuple[Array, Array, Array]:
        """The variable `[N]` in the mean over pixel and spread, on a surface of that radius.

        And how fast that grows with it, and what its skewness adds, `[N]` each.

        To a displacement x with a second derivative h the mean owes h E[x^2 g'] / 2. For a smooth profile and a
        variance v that is h v / 2 times the mean of g' and v times that of its third derivative: the second array is
        the latter's factor. A step is where it is, and tells of the x that lead to it.
        """
        pixel = (np.square(rise.gx) + np.square(rise.gy)) / 12.0
        whole = np.maximum(np.maximum(widths.variance, 0.0) + pixel, 1e-300)
        missing = (profile.knots[0] - rise.w) / rise.stretch
        step = profile.begins_with_a_step
        near = np.square(missing) < _FAR**2 * whole
        at = np.flatnonzero(near if step else near | (missing < 0.0))
        by, pace, skew = np.zeros(len(at)), np.ones(len(rise.w)), np.zeros(len(rise.w))
        for second, own in self._seconds(rise, widths, at, radius):
            if step:
                share = own / whole[at]
                by += second * (1.0 - share + share * np.square(missing[at]) / whole[at]) / 2.0
                pace[at] -= second * share * missing[at] / whole[at]
            else:
                by += second / 2.0
                skew[at] += second * own / 2.0
        return rise.raised(at, by), pace, skew

    def _seconds(
        self, rise: Rise, widths: Widths, at: NDArray[np.intp], radius: float
    ) -> Iterator[tuple[Array, Array | float]]:
        """Of every displacement: the cosine's second derivative times its variance, and its variance in the cosine."""
        square = np.square(rise.gx[at]) + np.square(rise.gy[at])
        image = square / 12.0 + (widths.lens + widths.defocus)[at]
        tangential, normal = (h * image / np.maximum(square, 1e-300) for h in rise.in_image(at, radius))
        yield tangential, 0.0
        yield normal, image
        if self.core:
            tangential, normal = (h * self.core for h in rise.at_tip(at))
            yield tangential, 0.0
            yield normal, widths.core[at]
        if self.wall:
            tangential, normal = (h * self.wall for h in rise.on_wall(at, radius))
            yield tangential, 0.0
            yield normal, widths.wall[at]
        if self.way is not None:
            tip, (values, axes) = self._by_tip(rise)[at], np.linalg.eigh(self.way)
            for variance, along in zip(values, axes.T, strict=True):
                yield variance * self._second(rise, at, along), variance * np.square(tip @ along)

    def _by_tip(self, rise: Rise) -> Array:
        """The cosine's gradient over the tip `[N, 3]` [1/mm] while the needle goes on through the RCM."""
        axis, length = self.needle
        return np.asarray(-rise.across + np.cross(np.cross(rise.axis, rise.to), axis) / length)

    def _second(self, rise: Rise, at: NDArray[np.intp], along: Array) -> Array:
        """The cosine's second derivative at some pixels by a millimetre of the tip, the needle through the RCM."""
        needle, length = self.needle
        off = rise.to[at] * rise.d[at, None]

        def cosine(step: float) -> Array:
            to = off - step * along
            turn = np.cross(needle, step * along) / length
            axis = rise.axis + np.cross(turn, rise.axis)
            return np.asarray(to @ (axis / np.linalg.norm(axis)) / np.linalg.norm(to, axis=1))

        return np.asarray((cosine(_STEP) - 2.0 * rise.c[at] + cosine(-_STEP)) / _STEP**2)
