"""A window of the image, binned, with what its bins see and what the model predicts for them."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.forward import Sight, ambient_irradiance, light, light_by_surface, look, window
from conespot.localize.model.noise import NoiseModel, linear_light
from conespot.localize.model.occlusion import covered
from conespot.localize.model.prior import BEAM, Estimate, Knowns, value, with_value
from conespot.scene.scene import Scene
from conespot.scene.spotlights import spotlight_axes

Array = NDArray[np.float64]
_STEP = 1e-3  # of eye radius and camera height [mm], for differences


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
        if np.any(high - low < 6):
            return None
        return cls(int(low[1]) * side, int(low[0]) * side, int(high[1] - low[1]), int(high[0] - low[0]), side)

    def cut(self, image: NDArray[np.generic]) -> NDArray[np.generic]:
        """The window's pixels of a full frame."""
        return image[self.row : self.row + self.height * self.side, self.column : self.column + self.width * self.side]

    def binned(self, pixels: NDArray[np.float32]) -> Array:
        """Means over the bins `[h, w]` of the window's pixels."""
        if self.side == 1:
            return pixels.astype(float)
        return cv2.resize(pixels, (self.width, self.height), interpolation=cv2.INTER_AREA).astype(float)


def outline(estimate: Estimate, spotlight: int, points: int = 96) -> Array:
    """Pixels `[N, 2]` [px] of a spotlight's outline, in the frame or beyond."""
    pixels = estimate.scene.camera.project(estimate.scene.outline(estimate.pose, spotlight, points))
    return np.asarray(pixels[np.all(np.isfinite(pixels), axis=1)])


def _inside(pixels: Array, scene: Scene) -> NDArray[np.bool_]:
    return np.asarray(np.all((pixels > 0.0) & (pixels < scene.camera.shape[::-1]), axis=1))


def outlines(estimate: Estimate, points: int = 96) -> Array:
    """Pixels `[N, 2]` [px] of all spotlights' outlines that are in the frame."""
    pixels = np.concatenate([outline(estimate, k, points) for k in range(len(estimate.scene.spotlights))])
    return np.asarray(pixels[_inside(pixels, estimate.scene)])


def visible(estimate: Estimate) -> float:
    """Share of the spotlights' outlines that is in the frame."""
    count = len(estimate.scene.spotlights)
    return len(outlines(estimate)) / (96 * count)


@dataclass(frozen=True)
class Channel:
    """What one channel of the image shows in a window."""

    signal: Array  #: mean of each bin [white] `[h, w]`
    usable: NDArray[np.bool_]  #: bins without a clipped pixel
    clipped: NDArray[np.bool_]  #: bins with every pixel clipped: lower bounds
    template: Array  #: log albedo known from elsewhere, 0 if nothing is `[h, w]`
    template_variance: Array  #: of that log albedo

    def at(self, row: NDArray[np.intp], column: NDArray[np.intp]) -> Channel:
        """The same in some of the bins `[N]`."""
        return Channel(*(plane[row, column] for plane in vars(self).values()))


@dataclass(frozen=True, eq=False)
class Unlit:
    """The same view in ambient light alone: `pixels` `[H, W]` or `[H, W, 3]`, a mean over `frames` frames."""

    pixels: NDArray[np.generic]
    frames: float
    noise: NoiseModel

    def log_albedo(self, scene: Scene, at: Window) -> tuple[Array, Array]:
        """Log albedo of a window's bins and its variance, `[C, h, w]`.

        Smoothed as far as its noise exceeds the retina's own detail.
        """
        sight = look(scene, window(at.row, at.column, at.height, at.width, at.side), at.side)
        irradiance = np.maximum(ambient_irradiance(sight, scene).reshape(at.height, at.width), 1e-3)
        light_ = linear_light(np.ascontiguousarray(at.cut(self.pixels)), scene)[0]
        found = []
        for shown in light_.reshape(*light_.shape[:2], -1).transpose(2, 0, 1):
            plane = at.binned(np.ascontiguousarray(shown))
            level = max(float(np.median(plane)), 1e-9)
            variance = float(self.noise.variance(np.array(level))) / self.frames / at.side**2 / level**2
            width = float(np.clip(0.5 * (variance / 1e-4) ** 0.25, 0.0, 2.5))
            if width > 0.3:
                plane = np.asarray(cv2.GaussianBlur(plane, (0, 0), width), float)
                variance /= max(1.0, 4.0 * np.pi * width**2)
            plane = np.maximum(plane, 0.1 * level)
            found.append((np.log(plane / irradiance), variance * (level / plane) ** 2))
        return np.stack([f[0] for f in found]), np.stack([f[1] for f in found])


def shown_in(image: NDArray[np.generic], scene: Scene, at: Window, unlit: Unlit | None) -> list[Channel]:
    """The channels of an image `[H, W]` or `[H, W, 3]` in a window."""
    light_, clip = linear_light(np.ascontiguousarray(at.cut(image)), scene)
    signal, clip = light_.reshape(*light_.shape[:2], -1), clip.reshape(*light_.shape[:2], -1)
    nothing = np.zeros((signal.shape[2], at.height, at.width))
    template, spread = (nothing, nothing) if unlit is None else unlit.log_albedo(scene, at)
    found = []
    for c in range(signal.shape[2]):
        share = at.binned(clip[..., c].astype(np.float32)) if clip[..., c].any() else nothing[c]
        plane = at.binned(np.ascontiguousarray(signal[..., c]))
        found.append(Channel(plane, share == 0.0, share == 1.0, template[c], spread[c]))
    return found


class Grid:
    """A window's bins as the model sees them: light is computed only where the cones may reach."""

    def __init__(self, at: Window, estimate: Estimate, knowns: Knowns, spotlight: int, *, reach: int = 4) -> None:
        """`reach` [bins] is how far the outlines may still move; the window is that of one `spotlight`.

        Bins nearer to another spotlight's axis are not seen: they count in that one's window. Nor are those where the
        shaft may be.
        """
        self.at, self.knowns = at, knowns
        scene = estimate.scene
        pixels = window(at.row, at.column, at.height, at.width, at.side)
        self._pixels = pixels
        mask = np.zeros((at.height, at.width), np.uint8)
        for k in range(len(scene.spotlights)):
            points = outline(estimate, k)
            if len(points) > 2:
                bins = (points - [at.column, at.row]) / at.side - 0.5
                cv2.fillPoly(mask, [np.round(bins).astype(np.int32)], 1)
        near = cv2.dilate(mask, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
        self.lit = np.flatnonzero(near)
        sight = look(scene, pixels, at.side)
        ambient = ambient_irradiance(sight, scene)
        self.seen = np.isfinite(ambient)
        self.ambient = np.where(self.seen, ambient, 1.0)
        self.seen &= ~covered(pixels, estimate.pose, scene, side=at.side)
        if len(scene.spotlights) > 1:
            to = sight.points - estimate.pose.apex
            cosines = to @ spotlight_axes(estimate.pose, scene.spotlights).T
            self.seen &= np.argmax(cosines, axis=1) == spotlight
        self._sight = Sight(*(field[self.lit] for field in vars(sight).values()))

    def spotlight(self, estimate: Estimate, *, roll: bool) -> tuple[Array, Array]:
        """The spotlights' irradiance on the lit bins `[N]` and its derivatives by pose and free quantities `[P, N]`."""
        return spotlight_irradiance(self._sight, estimate, self.knowns, self._pixels[self.lit], self.at.side, roll=roll)


def spotlight_irradiance(
    sight: Sight, estimate: Estimate, knowns: Knowns, pixels: Array, side: int, *, roll: bool
) -> tuple[Array, Array]:
    """The spotlights' irradiance on bins `[N]` and its derivatives by pose and free quantities `[P, N]`.

    `sight` is what the bins of `side` px at `pixels` `[N, 2]` see of the nominal surface.
    """
    free = knowns.free
    seen = look(estimate.scene, pixels, side) if {"eye_radius", "camera_height"} & set(free) else sight
    profile = estimate.profile
    changes = estimate.beam_changes(free)
    here = light(seen, estimate.pose, estimate.scene, profile, roll=roll, changes=changes)
    rows = [here.jacobian]
    for name in (name for name in free if name not in BEAM):
        plus, minus = (
            look(with_value(estimate.scene, name, value(estimate.scene, name) + step), pixels, side)
            for step in (_STEP, -_STEP)
        )
        rows.append(light_by_surface(here, seen, estimate.pose, (plus, minus), _STEP)[None])
    return here.value, np.concatenate(rows)
