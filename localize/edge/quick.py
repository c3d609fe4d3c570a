"""The light of one soft beam on the bins of a band, as fast as it goes: what a fit that follows a needle needs of it.

`forward.light`, but that a pixel, a blur, what is out of focus, a core and a motion count as one Gaussian, of the
variance that they have together along the beam's variable. An edge several times as wide as they are hardly shows a
pixel's corners, or the shape of a disc.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import cross, rotation_basis
from conespot.localize.model.profile import Profile
from conespot.localize.model.sight import Sight
from conespot.localize.model.smooth import under_gaussian
from conespot.localize.model.spread import Spread
from conespot.scene.pose import Pose

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class QuickLight:
    """Where one pose puts the light."""

    value: Array  #: irradiance for unit on-axis intensity `[N]` [1/mm^2]
    rows: Array  #: its derivatives by the pose, and by the variance of the lens' blur [mm^2] `[6, N]`
    width: float  #: standard deviation of what spreads the image beside the pixels, in the mean [bins]
    cosine: Array  #: of the angle between the bins' rays and the axis `[N]`
    slopes: Array  #: square of its gradient over the image `[N]` [1/bin^2]
    blurs: Array  #: change of the variance along the cosine per variance of a blur `[N]` [1/mm^2]
    variance: Array  #: along the cosine, of pixels and all else that spreads the image `[N]`
    mixed: Array  #: light that the spread adds where it falls off across the edge `[N]` [1/mm^2]
    blur: float  #: variance beyond that of the scene's lens [mm^2]

    def offset(self, half_angle: float) -> Array:
        """Distance of the bins from the outline, positive outside `[N]` [bins], as `outline.distances` has it."""
        sine = np.sqrt(np.maximum(1.0 - np.square(self.cosine), 0.0))
        # the cosine's gradient is the angle's times the sine, and on the axis itself both are nought
        steepest = float(self.slopes.max())
        over = sine / np.sqrt(np.maximum(self.slopes, 1e-9 * steepest))
        # within a band the angle is off the half angle by less than a right angle
        return np.asarray(np.arcsin(sine * math.cos(half_angle) - self.cosine * math.sin(half_angle)) * over)


class QuickBeam:
    """The beam of a scene with one spotlight on what the bins of a sight see."""

    def __init__(self, sight: Sight, near: Estimate) -> None:
        """Near an estimate, whose scene says how the image is spread."""
        scene = near.scene
        self._profile, self._spread = Profile.of(scene.beam), Spread.of(scene, sight, near.pose)
        # components first: the sums over them are a third of the time
        every = (sight.points, sight.normals, sight.along_x, sight.along_y)
        self._points, self._normals, self._right, self._down = (np.ascontiguousarray(part.T) for part in every)
        self._per_blur, self._aspect = 1.0 / (scene.camera.pixel_pitch * sight.side) ** 2, scene.camera.pixel_aspect**2
        self.blur = self._spread.lens[0] / self._per_blur  #: variance of the scene's own blur [mm^2]
        self._radius = scene.eye.radius
        self._second: tuple[Array, Array] | None = None

    def __call__(self, pose: Pose, blur: float = 0.0) -> QuickLight:
        """The light of a pose, with `blur` [mm^2] more variance than the scene's lens has."""
        profile = self._profile
        to = self._points - pose.apex[:, None]
        d2 = _dot(to, to)
        d = np.sqrt(d2)
        to /= d
        facing = -_dot(self._normals, to)
        cosine = pose.axis @ to
        across = (pose.axis[:, None] - cosine * to) / d
        rise = _dot(across, self._right), _dot(across, self._down)
        right, down = np.square(rise[0]), np.square(rise[1])
        slopes, blurs = right + down, self._per_blur * (right + self._aspect * down)
        by_tip = self._by_tip(pose.axis, across, to)
        others, tips = self._others(pose.axis, across, by_tip, slopes)
        spread = (blur + self.blur) * blurs + others
        falloff = (self._normals / d2 + (3.0 * facing / d2) * to) / d
        if self._second is None:
            # hardly changes from step to step
            geometry = _Geometry(pose.axis, to, d, cosine, across, rise, by_tip, tips, falloff)
            self._second = self._bend(geometry), self._mix(geometry)
        bend, mix = self._second
        w, stretch = profile.variable(cosine + bend)
        variance = spread + slopes / 12.0
        mean, slope, curve = under_gaussian(profile, w, np.sqrt(variance) * stretch, 2)
        lit = facing > 0.0
        f = np.where(lit, facing, 0.0) / d2
        slope *= stretch
        mixed = np.where(lit, slope * mix, 0.0)
        slope *= f
        rows = np.empty((6, len(d)))
        rows[:3] = falloff * np.where(lit, mean, 0.0) - slope * across
        for row, vector in enumerate(rotation_basis(pose.axis)[:2], start=3):
            rows[row] = slope * (cross(vector, pose.axis) @ to)
        rows[5] = 0.5 * f * curve * blurs * np.square(stretch)
        width = math.sqrt(float(np.mean(spread / slopes)))
        return QuickLight(mean * f + mixed, rows, width, cosine, slopes, blurs, variance, mixed, blur)

    def beside(self, there: QuickLight, pose: Pose, blur: float) -> Array:
        """The light of a pose `[N]` beside another one, whose widths are taken for its own."""
        profile = self._profile
        to = self._points - pose.apex[:, None]
        d2 = _dot(to, to)
        d = np.sqrt(d2)
        assert self._second is not None
        w, stretch = profile.variable(pose.axis @ to / d + self._second[0])
        variance = there.variance if blur == there.blur else there.variance + (blur - there.blur) * there.blurs
        (mean,) = under_gaussian(profile, w, np.sqrt(variance) * stretch, 0)
        facing = np.maximum(-_dot(self._normals, to), 0.0)
        return np.asarray(mean * facing / (d2 * d) + there.mixed)

    def _by_tip(self, axis: Array, across: Array, to: Array) -> Array | None:
        """The cosine's gradient over a tip that moves `[3, N]` while the needle goes on through the RCM."""
        if self._spread.way is None:
            return None
        needle, length = self._spread.needle
        # (axis x to) x needle by the triple product
        turned = np.multiply.outer(-axis, needle @ to) + float(axis @ needle) * to
        return np.asarray(turned / length - across)

    def _others(self, axis: Array, across: Array, by_tip: Array | None, slopes: Array) -> tuple[Array, Array]:
        """Variance along the cosine `[N]` of what spreads the image beside the lens' blur; covariance of the tip."""
        spread, found, tips = self._spread, np.zeros(len(slopes)), np.zeros((3, 3))
        if spread.defocus is not None:
            found += spread.defocus * slopes
        if spread.core:
            flat = np.eye(3) - np.outer(axis, axis)
            tips += spread.core * flat
            found += np.maximum(_dot(across, (spread.core * flat) @ across), 0.0)
        if spread.way is not None and by_tip is not None:
            tips += spread.way
            found += np.maximum(_dot(by_tip, spread.way @ by_tip), 0.0)
        return found, tips

    def _bend(self, at: _Geometry) -> Array:
        """What spreads add to the cosine in the mean `[N]`: half its second derivatives by variances."""
        lens, defocus = self._spread.lens, self._spread.defocus
        normal = _dot(at.across, self._normals) / self._radius
        found = np.zeros(len(at.d))
        for step, rise, own in zip((self._right, self._down), at.rise, lens, strict=True):
            along, size = _dot(at.to, step) / at.d, _dot(step, step)
            second = -2.0 * rise * along - at.cosine * (size / at.d**2 - np.square(along)) + normal * size
            found += second * (1.0 / 12.0 + own + (0.0 if defocus is None else defocus))
        spread = at.tips @ at.to
        tip = -2.0 * _dot(at.across, spread) / at.d
        tip -= at.cosine * (float(np.trace(at.tips)) - _dot(at.to, spread)) / at.d**2
        return np.asarray((found + tip) / 2.0)

    def _mix(self, at: _Geometry) -> Array:
        """Covariance `[N]` of the cosine and of the light that falls off across the edge: `Spread.covariance`."""
        spread = self._spread
        over = at.to / (self._radius * at.d**2) - at.falloff
        defocus = 0.0 if spread.defocus is None else spread.defocus
        found = _dot(over, self._right) * at.rise[0] * (spread.lens[0] + defocus)
        found += _dot(over, self._down) * at.rise[1] * (spread.lens[1] + defocus)
        if spread.core:
            flat = at.across - np.multiply.outer(at.axis, at.axis @ at.across)
            found -= spread.core * _dot(at.falloff, flat)
        if spread.way is not None and at.by_tip is not None:
            found += _dot(at.falloff, spread.way @ at.by_tip)
        return np.asarray(found)


@dataclass(frozen=True, eq=False)
class _Geometry:
    """How bins see the tip, components first, in the words of `model.rise`."""

    axis: Array
    to: Array
    d: Array
    cosine: Array
    across: Array
    rise: tuple[Array, Array]
    by_tip: Array | None
    tips: Array  #: covariance of the tip's places `[3, 3]` [mm^2]
    falloff: Array


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
