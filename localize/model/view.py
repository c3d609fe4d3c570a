"""A window of the image, binned, with what its bins see and what the model predicts for them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.localize.image import Frame, Reference
from conespot.localize.model.deep import Deep
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import ambient_irradiance
from conespot.localize.model.irradiance import Irradiance, Lights
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.occlusion import covered
from conespot.localize.model.rise import Rise
from conespot.localize.model.sight import look, window
from conespot.localize.model.spread import Spread
from conespot.scene.scene import Scene
from conespot.scene.spotlights import spotlight_axes

Array = NDArray[np.float64]
_POINTS = 96  # of an outline


@dataclass(frozen=True)
class ViewSettings:
    """Tuned numbers of windows and references; halved and doubled by `benchmarks/tuned_numbers.py view`."""

    #: bins a side without which a window is left out: less than the modes of the albedo need. No answer changes
    fewest_bins: int = 6
    #: bins by which outlines may still move once the light has its place; a level ends within two. No answer changes
    reach: int = 4
    #: standard deviations of what spreads the image by which its light reaches farther: a normal distribution's end
    widths: float = 4.0
    #: variance of the log albedo that a retina has within a bin or two: a reference noisier than this is smoothed. Half
    #: of it takes 6 % off the error, the double adds 2 %
    detail: float = 1e-4
    #: blur [bins] where a reference is as noisy as that; it grows with the fourth root, since detail falls as fast as
    #: noise does. A half changes the error by 1 %, the double takes 13 % off and widens no ellipsoid: not critical
    smoothing: float = 0.5
    #: largest blur [bins]
    widest_blur: float = 2.5
    #: share of the median light below which a reference's bin counts as that dark, so that its logarithm is finite
    darkest: float = 0.1


VIEW = ViewSettings()


@dataclass(frozen=True)
class Window:
    """Bins of `side` x `side` pixels that start at pixel (row, column)."""

    row: int
    column: int
    height: int  #: [bins]
    width: int  #: [bins]
    side: int

    @classmethod
    def around(cls, estimate: Estimate, spotlight: int, bins: int, margin: float) -> Window | None:
        """A spotlight's outline with `margin` times its size around, at most `bins` bins across; None if outside."""
        points, scene = outline(estimate, spotlight), estimate.scene
        if not len(points):
            return None
        low, high = points.min(axis=0), points.max(axis=0)
        size = float(np.max(high - low))
        side = max(1, int(np.ceil(size / bins)))
        edge = np.array(scene.camera.shape[::-1]) // side
        low = np.clip(np.floor((low - margin * size) / side), 0, edge).astype(int)
        high = np.clip(np.ceil((high + margin * size) / side), 0, edge).astype(int)
        if np.any(high - low < VIEW.fewest_bins):
            return None
        return cls(int(low[1]) * side, int(low[0]) * side, int(high[1] - low[1]), int(high[0] - low[0]), side)

    @property
    def pixels(self) -> Array:
        """The bins' centres `[h * w, 2]` [px]."""
        return window(self.row, self.column, self.height, self.width, self.side)

    def light(self, frame: Frame) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """The light of the window's pixels [white], and which of them are clipped: `[rows, columns, C]` each."""
        rows = slice(self.row, self.row + self.height * self.side)
        return frame.light(rows, slice(self.column, self.column + self.width * self.side))

    def binned(self, pixels: NDArray[np.float32]) -> Array:
        """Means over the bins `[h, w]` of the window's pixels."""
        if self.side == 1:
            return pixels.astype(float)
        return cv2.resize(pixels, (self.width, self.height), interpolation=cv2.INTER_AREA).astype(float)


def outline(estimate: Estimate, spotlight: int, points: int = _POINTS) -> Array:
    """Pixels `[N, 2]` [px] of a spotlight's outline, in the frame or beyond."""
    pixels = estimate.scene.camera.project(estimate.scene.outline(estimate.pose, spotlight, points))
    return np.asarray(pixels[np.all(np.isfinite(pixels), axis=1)])


def _inside(pixels: Array, scene: Scene) -> NDArray[np.bool_]:
    within = np.all((pixels > 0.0) & (pixels < scene.camera.shape[::-1]), axis=1)
    return np.asarray(within & scene.camera.shows(pixels))


def edge_width(estimate: Estimate) -> float:
    """Standard deviation of what spreads the image across the outlines that the frame shows, in the mean [px]."""
    scene, squares = estimate.scene, []
    if not Spread.in_scene(scene):
        return 0.0
    for spotlight, axis in enumerate(spotlight_axes(estimate.pose, scene.spotlights)):
        pixels = outline(estimate, spotlight)
        pixels = pixels[_inside(pixels, scene)]
        sight = look(scene, pixels)
        spread = Spread.of(scene, sight, estimate.pose)
        if not len(pixels):
            continue
        to = sight.points - estimate.pose.apex
        d = np.linalg.norm(to, axis=1)
        rise = Rise.of(sight, axis, to / d[:, None], d, estimate.profile)
        variance = np.maximum(spread.widths(rise).variance, 0.0)
        squares.append(variance / (np.square(rise.gx) + np.square(rise.gy)))
    return float(np.sqrt(np.mean(np.concatenate(squares)))) if squares else 0.0


def outlines(estimate: Estimate, points: int = _POINTS) -> Array:
    """Pixels `[N, 2]` [px] of all spotlights' outlines that are in the frame."""
    pixels = np.concatenate([outline(estimate, k, points) for k in range(len(estimate.scene.spotlights))])
    return np.asarray(pixels[_inside(pixels, estimate.scene)])


def visible(estimate: Estimate) -> float:
    """Share of the spotlights' outlines that is in the frame."""
    return len(outlines(estimate)) / (_POINTS * len(estimate.scene.spotlights))


@dataclass(frozen=True)
class Shown:
    """What one channel of the image shows in a window's bins."""

    signal: Array  #: mean of each bin [white] `[h, w]`
    usable: NDArray[np.bool_]  #: bins without a clipped pixel
    clipped: NDArray[np.bool_]  #: bins with every pixel clipped: lower bounds
    template: Array  #: log albedo known from elsewhere, 0 if nothing is `[h, w]`
    template_variance: Array  #: of that log albedo

    @classmethod
    def each(cls, frame: Frame, at: Window) -> list[Shown]:
        """The channels of a frame in a window, of an albedo that is not known."""
        signal, clip = at.light(frame)
        nothing = np.zeros((at.height, at.width))
        found = []
        for c in range(signal.shape[2]):
            share = at.binned(clip[..., c].astype(np.float32)) if clip[..., c].any() else nothing
            plane = at.binned(np.ascontiguousarray(signal[..., c]))
            found.append(cls(plane, share == 0.0, share == 1.0, nothing, nothing))
        return found

    @classmethod
    def in_cells(cls, frame: Frame, at: Window, row: NDArray[np.intp], column: NDArray[np.intp]) -> list[Shown]:
        """The same in some of the window's bins `[N]`; where those are pixels no others are looked at."""
        if at.side > 1:
            return [plane.at(row, column) for plane in cls.each(frame, at)]
        signal, clip = frame.at(at.row + row, at.column + column)
        nothing = np.zeros(len(row))
        planes = zip(signal.T.astype(float), clip.T, strict=True)
        return [cls(plane, ~clipped, clipped, nothing, nothing) for plane, clipped in planes]

    def told(self, log_albedo: Array, variance: Array) -> Shown:
        """The same where something else tells the log albedo of each bin, and its variance."""
        return replace(self, template=log_albedo, template_variance=variance)

    def at(self, row: NDArray[np.intp], column: NDArray[np.intp]) -> Shown:
        """The same in some of the bins `[N]`."""
        at = row * self.signal.shape[1] + column
        return Shown(*(plane.ravel()[at] for plane in vars(self).values()))


def log_albedo(reference: Reference, scene: Scene, at: Window, noise: NoiseModel) -> tuple[Array, Array]:
    """Log albedo that a reference shows in a window's bins, and its variance, `[C, h, w]`.

    Smoothed as far as its noise exceeds the retina's own detail.
    """
    irradiance = ambient_irradiance(look(scene, at.pixels, at.side), scene)
    irradiance = np.fmax(irradiance.reshape(at.height, at.width), 1e-3)  # also where no retina is seen
    found = []
    for shown in at.light(Frame(reference.pixels, scene.sensor))[0].transpose(2, 0, 1):
        plane = at.binned(np.ascontiguousarray(shown))
        level = max(float(np.median(plane)), 1e-9)
        variance = float(noise.variance(np.array(level))) / reference.frames / at.side**2 / level**2
        width = float(np.clip(VIEW.smoothing * (variance / VIEW.detail) ** 0.25, 0.0, VIEW.widest_blur))
        if width > 0.0:
            plane = np.asarray(cv2.GaussianBlur(plane, (0, 0), width), float)
            # the mean of white noise under a Gaussian: its square integrates to 1 / (4 pi width^2)
            variance /= max(1.0, 4.0 * np.pi * width**2)
        plane = np.maximum(plane, VIEW.darkest * level)
        found.append((np.log(plane / irradiance), variance * (level / plane) ** 2))
    return np.stack([f[0] for f in found]), np.stack([f[1] for f in found])


class Bins:
    """A window's bins as the model sees them: light is computed only where the spotlights' may be."""

    def __init__(self, at: Window, estimate: Estimate, knowns: Knowns, spotlight: int) -> None:
        """The window is that of one `spotlight`.

        Bins nearer to another spotlight's axis are not seen: they count in that one's window. Nor are those where the
        shaft may be.
        """
        self.at, self.knowns = at, knowns
        scene = estimate.scene
        pixels = at.pixels
        mask = np.zeros((at.height, at.width), np.uint8)
        for k in range(len(scene.spotlights)):
            points = outline(estimate, k)
            if len(points) > 2:
                corners = (points - [at.column, at.row]) / at.side - 0.5
                cv2.fillPoly(mask, [np.round(corners).astype(np.int32)], 1)
        blur = math.ceil(VIEW.widths * edge_width(estimate) / at.side)
        reach = 2 * (VIEW.reach + blur) + 1
        sight = look(scene, pixels, at.side)
        ambient = ambient_irradiance(sight, scene)
        self.seen = np.isfinite(ambient)
        near = self.seen & (cv2.dilate(mask, np.ones((reach, reach), np.uint8)).ravel() > 0)
        # light from under the retina is everywhere
        self.lit = np.flatnonzero(near if Deep.of(scene) is None else self.seen)
        self.ambient = np.where(self.seen, ambient, 1.0)
        self.seen &= ~covered(pixels, estimate.pose, scene, side=at.side)
        if len(scene.spotlights) > 1:
            to = sight.points - estimate.pose.apex
            cosines = to @ spotlight_axes(estimate.pose, scene.spotlights).T
            self.seen &= np.argmax(cosines, axis=1) == spotlight
        self._made_of = sight.part(self.lit), pixels[self.lit], at.side, estimate, knowns, near[self.lit]

    @cached_property
    def _irradiance(self) -> Irradiance:
        return Irradiance(*self._made_of)

    def spotlight(self, estimate: Estimate, knowns: Knowns | None = None) -> Lights:
        """The spotlights' irradiance on the lit bins, with derivatives by all that is free."""
        return self._irradiance(estimate, knowns)
