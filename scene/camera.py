"""The camera: a pinhole above the eye that looks straight down."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from conespot.scene.model import Model
from conespot.scene.quantity import Length


class Camera(Model):
    """Pinhole at (0, 0, height), looking along -z, +x right and +y up in the image (paper, Table II).

    Pixel coordinates run x to the right and y down; the centre of the first pixel is at (0.5, 0.5).
    """

    resolution: int = Field(5000, ge=16, le=20000)  #: pixels a side [px]
    sensor_width: Length = Field(36.0, gt=0.0)
    focal_length: Length = Field(300.0, gt=0.0)
    height: Length = Field(110.0, gt=0.0)  #: pinhole above the posterior pole, the paper's d0 [mm]

    @property
    def centre(self) -> NDArray[np.float64]:
        """The pinhole `[3]` [mm]."""
        return np.array([0.0, 0.0, self.height])

    @property
    def focal_length_px(self) -> float:
        """Focal length in pixels."""
        return self.resolution * self.focal_length / self.sensor_width

    @property
    def full_fov(self) -> float:
        """Full angle of view across the image [rad]; 6.8673 deg for Table II."""
        return 2.0 * math.atan2(self.sensor_width / 2.0, self.focal_length)

    @property
    def pixel_pitch(self) -> float:
        """Side of a pixel at the posterior pole [mm]."""
        return self.height / self.focal_length_px

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """Pixel coordinates `[..., 2]` [px] of points `[..., 3]` [mm] below the pinhole."""
        p = np.asarray(points, float)
        scale = self.focal_length_px / (self.height - p[..., 2])
        half = self.resolution / 2.0
        return np.stack([half + scale * p[..., 0], half - scale * p[..., 1]], axis=-1)

    def back_project(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Unit directions `[..., 3]` from the pinhole through pixel coordinates `[..., 2]` [px]."""
        q = np.asarray(pixels, float)
        half = self.resolution / 2.0
        f = self.focal_length_px
        d = np.stack([(q[..., 0] - half) / f, (half - q[..., 1]) / f, -np.ones(q.shape[:-1])], axis=-1)
        return d / np.linalg.norm(d, axis=-1, keepdims=True)
