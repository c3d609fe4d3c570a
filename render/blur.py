"""What a lens does to a picture that is sharp: residual blur, and glare over all of the frame. Both are linear.

Weights of whole pixels cannot be a narrow Gaussian: one of half a pixel moves an edge by 0.025 px, according to where
it lies in its pixel; one of 1.5 px by 0.004. A narrower one is therefore in a patch's rays.
"""

from __future__ import annotations

import functools
import math
from typing import assert_never

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.render.tile import Tile
from conespot.scene import Camera
from conespot.scene.point_spread import GaussianSpread, PointSpread, TabulatedSpread

Array = NDArray[np.float64]
Image = NDArray[np.float32]

#: standard deviations beyond which a Gaussian is left out: 4e-6 of its light
_FAR = 5.0
#: places along a pixel's side at which a profile is read, and fewer where it is wider than so many pixels
_PLACES, _PLACES_OF_WIDE, _WIDE = 9, 3, 64
#: a Gaussian below this standard deviation [px] is in the rays
_NARROW = 1.5
#: places at which the distribution of a pixel's rays is held
_QUANTILES = 4097


class Blur:
    """The blur and the glare of a camera's lens, for pictures of linear radiance `[h, w, C]`.

    A point's light is spread by whole pixels' weights, alike all over the frame, and the sum of the weights is 1. What
    the frame's border cuts off is as if mirrored there. With `rays`, a narrow Gaussian is left to a patch's rays.
    """

    def __init__(self, camera: Camera, *, rays: bool) -> None:
        self._shape = camera.shape
        self.in_rays = _in_rays(camera) if rays else None  #: standard deviations (across, down) [px] of what rays do
        self._weights: Array | None = None
        self._glare = 0.0
        if camera.lens is None:
            return
        self._glare = camera.lens.glare
        if camera.lens.blur is not None:
            self._weights = weights(camera.lens.blur, camera.pixel_pitch, camera.pixel_pitch / camera.pixel_aspect)

    @property
    def is_none(self) -> bool:
        """Whether it leaves every picture as it is."""
        return self._weights is None and self._glare == 0.0

    @property
    def steadiness(self) -> float:
        """By how much the standard deviation of a tile's noise, each pixel's own, falls."""
        return 1.0 if self._weights is None or self.in_rays else float(1.0 / np.sqrt(np.sum(np.square(self._weights))))

    def frame(self, sharp: Image) -> Image:
        """A whole frame `[H, W, C]`, spread."""
        blurred = self.smoothed(sharp)
        mean = np.mean(blurred, axis=(0, 1), dtype=float)
        return np.asarray(blurred * np.float32(1.0 - self._glare) + (self._glare * mean).astype(np.float32))

    def tile(self, sharp: Tile) -> Tile:
        """A tile around which there is no light: with its glare, and larger by the reach of a blur not in its rays."""
        if self.is_none or not sharp.radiance.size:
            return sharp
        crop, radiance = sharp.crop, sharp.radiance
        if self._weights is not None and self.in_rays is None:
            down, right = (side // 2 for side in self._weights.shape)
            crop = crop.grown(down, right, self._shape)
            radiance = np.zeros((crop.height, crop.width, radiance.shape[-1]), np.float32)
            radiance[sharp.crop.within(crop)] = sharp.radiance
            radiance = self.smoothed(radiance)
        if self._glare == 0.0:
            return Tile(crop, radiance)
        glare = self._glare * np.sum(radiance, axis=(0, 1), dtype=float) / math.prod(self._shape)
        return Tile(crop, np.float32(1.0 - self._glare) * radiance, glare.astype(np.float32))

    @property
    def reach(self) -> int:
        """How far light is spread by what is in the rays [px]."""
        return math.ceil(_FAR * max(self.in_rays)) if self.in_rays else 0

    def smoothed(self, image: Image) -> Image:
        """A picture `[h, w, C]` whose rays are not spread yet, spread by weights of whole pixels; without glare."""
        if self._weights is None:
            return image
        image = np.ascontiguousarray(image)
        # mirrored with the border between two pixels, so that all light stays
        if self._along is not None:
            down, right = self._along
            blurred = cv2.sepFilter2D(image, -1, right, down, borderType=cv2.BORDER_REFLECT)
        else:
            blurred = cv2.filter2D(image, -1, self._weights, borderType=cv2.BORDER_REFLECT)
            blurred = np.maximum(blurred, 0.0)  # by Fourier's transform, whose rounding may leave darkness below zero
        return np.asarray(blurred, np.float32).reshape(image.shape)

    @functools.cached_property
    def _along(self) -> tuple[Array, Array] | None:
        """The weights down and across, where they are a product of the two: a Gaussian's."""
        assert self._weights is not None
        down, right = self._weights.sum(axis=1), self._weights.sum(axis=0)
        return (down, right) if np.allclose(np.outer(down, right), self._weights, rtol=1e-9, atol=0.0) else None


def weights(spread: PointSpread, width: float, height: float) -> Array:
    """The weights `[h, w]`, of odd sides, with which pixels of a `width` and `height` [mm] share a point's light."""
    match spread:
        case GaussianSpread():
            return np.outer(*(_gaussian(spread.sigma / pitch) for pitch in (height, width)))
        case TabulatedSpread():
            return _tabulated(spread, width, height)
        case None:
            return np.ones((1, 1))
        case unknown:
            assert_never(unknown)


def _in_rays(camera: Camera) -> tuple[float, float] | None:
    spread = None if camera.lens is None else camera.lens.blur
    if not isinstance(spread, GaussianSpread):
        return None
    across = spread.sigma / camera.pixel_pitch
    down = across * camera.pixel_aspect
    return (across, down) if 0.0 < max(across, down) < _NARROW else None


def places(sigma: float) -> Array:
    """Where the rays of a pixel lie that are spread by `sigma` [px]: quantiles `[n]` from 0 to 1, about its middle."""
    from scipy.special import ndtr  # every process of a campaign would wait for it

    reach = 0.5 + _FAR * sigma
    x = np.linspace(-reach, reach, 32 * _QUANTILES)

    def integral(t: Array) -> Array:
        return np.asarray(t * ndtr(t / sigma) + sigma * np.exp(-((t / sigma) ** 2) / 2.0) / math.sqrt(2.0 * math.pi))

    share = integral(x + 0.5) - integral(x - 0.5)
    return np.interp(np.linspace(share[0], share[-1], _QUANTILES), share, x)


def _gaussian(sigma: float) -> Array:
    """A Gaussian of standard deviation `sigma` [px]: integrals over pixels whose variance is its own, odd `[n]`.

    Pixels' values are integrals already; those of the very Gaussian would add a pixel's variance of 1/12 once more.
    """
    from scipy.optimize import brentq  # every process of a campaign would wait for it
    from scipy.special import ndtr

    reach = math.ceil(_FAR * sigma) + 1
    places = np.arange(-reach, reach + 1)

    def integrals(width: float) -> Array:
        edges = ndtr((np.arange(-reach, reach + 2) - 0.5) / width)
        return np.asarray(np.diff(edges) / (edges[-1] - edges[0]))

    def excess(width: float) -> float:
        return float(np.sum(places**2 * integrals(width)) - sigma**2)

    return integrals(brentq(excess, 1e-3, sigma + 1.0, xtol=1e-9))


def _tabulated(spread: TabulatedSpread, width: float, height: float) -> Array:
    """A profile's means over pixels, less a pixel's own variance, which what they are applied to has already."""
    far = spread.radii[-1]
    down, right = (math.ceil(far / pitch) + 1 for pitch in (height, width))
    places = _PLACES if max(down, right) < _WIDE else _PLACES_OF_WIDE
    within = (np.arange(places) - (places - 1) / 2.0) / places
    y = (np.arange(-down, down + 1)[:, None] + within).ravel() * height
    x = (np.arange(-right, right + 1)[:, None] + within).ravel() * width
    radii, values = np.asarray(spread.radii), np.asarray(spread.values)
    fine = np.interp(np.hypot(y[:, None], x), radii, values, right=0.0)
    means = fine.reshape(2 * down + 1, places, 2 * right + 1, places).mean(axis=(1, 3))
    padded = np.pad(means, 1)
    bend = padded[:-2, 1:-1] + padded[2:, 1:-1] + padded[1:-1, :-2] + padded[1:-1, 2:] - 4.0 * means
    # a spread much narrower than a pixel would turn negative around it
    found = np.maximum(means - bend / 24.0, 0.0)
    # nor is a ring so narrow that it lies between the places
    return np.asarray(found / found.sum()) if found.any() else np.ones((1, 1))
