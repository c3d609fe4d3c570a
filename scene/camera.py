"""The camera: a pinhole above the eye that looks straight down."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from conespot.scene.model import Model
from conespot.scene.quantity import Length

Array = NDArray[np.float64]
_STILL = np.zeros(3)


@dataclass(frozen=True, eq=False)
class Rays:
    """What pixels see along, and how that changes from pixel to pixel: x to the right, y down.

    Where all rays have the same, an array is one vector `[3]`, which goes with the others as numpy broadcasts.
    """

    origins: Array  #: `[..., 3]` [mm]
    directions: Array  #: unit, away from the camera `[..., 3]`
    origins_by_x: Array  #: `[..., 3]` [mm/px]
    origins_by_y: Array  #: `[..., 3]` [mm/px]
    directions_by_x: Array  #: across the directions `[..., 3]` [1/px]
    directions_by_y: Array  #: across the directions `[..., 3]` [1/px]


class Camera(Model):
    """Pinhole at (0, 0, height), looking along -z, +x right and +y up in the image (paper, Table II).

    Pixel coordinates run x to the right and y down; the centre of the first pixel is at (0.5, 0.5).

    Renderer, forward model, crops and occlusion know a camera by its `shape`, `rays` and `project`; the fits take
    `pixel_pitch` as their scale, and the published method has the paper's own pinhole. Another kind of camera is
    another class with these, and a sensor of Mitsuba's in `render.stage`.

    >>> camera = Camera(resolution=1000)
    >>> camera.project([0.0, 0.0, 0.0]).tolist()
    [500.0, 500.0]
    >>> camera.rays([500.0, 500.0]).directions.round(12).tolist()
    [0.0, 0.0, -1.0]
    """

    resolution: int = Field(5000, ge=16, le=20000)  #: pixels a side [px]
    sensor_width: Length = Field(36.0, gt=0.0)
    focal_length: Length = Field(300.0, gt=0.0)
    height: Length = Field(110.0, gt=0.0)  #: pinhole above the posterior pole, the paper's d0 [mm]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of a frame [px]."""
        return self.resolution, self.resolution

    @property
    def centre(self) -> Array:
        """The pinhole `[3]` [mm]."""
        return np.array([0.0, 0.0, self.height])

    @property
    def focal_length_px(self) -> float:
        """Focal length in pixels.

        >>> round(Camera().focal_length_px, 1)
        41666.7
        """
        return self.resolution * self.focal_length / self.sensor_width

    @property
    def full_fov(self) -> float:
        """Full angle of view across the image [rad].

        >>> round(math.degrees(Camera().full_fov), 4)  # Table II
        6.8673
        """
        return 2.0 * math.atan2(self.sensor_width / 2.0, self.focal_length)

    @property
    def pixel_pitch(self) -> float:
        """Side of a pixel at the posterior pole [mm].

        >>> round(Camera().pixel_pitch, 5)
        0.00264
        """
        return self.height / self.focal_length_px

    def rays(self, pixels: ArrayLike) -> Rays:
        """The rays of pixel coordinates `[..., 2]` [px], in the frame or beyond."""
        q = np.asarray(pixels, float)
        half, f = self.resolution / 2.0, self.focal_length_px
        d = np.empty((3, *q.shape[:-1]))  # components first: three times as fast as last
        d[0], d[1], d[2] = (q[..., 0] - half) / f, (half - q[..., 1]) / f, -1.0
        length = np.sqrt(d[0] * d[0] + d[1] * d[1] + 1.0)
        d /= length
        # of D / |D| with D' = (1, 0, 0) / f, and (0, -1, 0) / f down the image
        per_pixel = 1.0 / (f * length)
        by_x, by_y = -(per_pixel * d[0]) * d, (per_pixel * d[1]) * d
        by_x[0] += per_pixel
        by_y[1] -= per_pixel
        last = (*range(1, d.ndim), 0)
        return Rays(self.centre, d.transpose(last), _STILL, _STILL, by_x.transpose(last), by_y.transpose(last))

    def project(self, points: ArrayLike) -> Array:
        """Pixel coordinates `[..., 2]` [px] of points `[..., 3]` [mm], the inverse of `rays`.

        In the frame or beyond it; NaN for what no ray meets, which is all beside and above the pinhole.

        >>> Camera().project([0.0, 0.0, 120.0]).tolist()
        [nan, nan]
        """
        p = np.asarray(points, float)
        below = self.height - p[..., 2]
        scale = self.focal_length_px / np.where(below > 0.0, below, np.nan)
        half = self.resolution / 2.0
        return np.stack([half + scale * p[..., 0], half - scale * p[..., 1]], axis=-1)
