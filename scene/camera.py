"""The camera: a pinhole above the eye, straight or aslant, whose lens may distort."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BeforeValidator, Field, PrivateAttr, ValidationInfo, model_validator

from conespot.scene import attitude, defocus
from conespot.scene.calibration_file import calibrated
from conespot.scene.distortion import Distortion
from conespot.scene.lens import AnyLens
from conespot.scene.model import Model, Text
from conespot.scene.optics import SODIUM, AnyOptics
from conespot.scene.quantity import Angle, Length, Quantity, parse_quantity
from conespot.scene.rays import Rays
from conespot.scene.refracted import found, pitch, refracted
from conespot.scene.resolution import Resolution

Array = NDArray[np.float64]
_STILL = np.zeros(3)
#: a lens that folds the image this close to the frame's corners, relative to their distance from the principal point,
#: is refused: what lies just outside the frame must not come back into it
_MARGIN = 1.05


def _pixels(value: object) -> float:
    return parse_quantity(value, "pixels")


_Pixels = Annotated[float, BeforeValidator(_pixels), Text(Quantity("pixels").pattern)]


class Camera(Model):
    """Pinhole at (0, 0, height), looking along -z, +x right and +y up in the image (paper, Table II), or moved.

    Pixel coordinates run x to the right and y down; the centre of the first pixel is at (0.5, 0.5).

    It stands `height` from the point that it looks at, `tilt` off the vertical towards `azimuth` (from +x to +y), and
    is turned by `roll` about its axis, its right side down. `calibration` names a file of OpenCV's with resolution,
    focal length, pixel aspect, principal point and distortion, which are then not given beside it.

    Renderer, forward model, crops and occlusion know a camera by its `shape`, `rays` and `project`; the fits take
    `pixel_pitch` as their scale, and the published method has the paper's own pinhole. In Dr.Jit the same rays are
    `render.rays.RayGenerator`'s.

    >>> camera = Camera(resolution=1000)
    >>> camera.project([0.0, 0.0, 0.0]).tolist()
    [500.0, 500.0]
    >>> camera.rays([500.0, 500.0]).directions.round(12).tolist()
    [0.0, 0.0, -1.0]
    """

    stand_ins = ("calibration",)

    resolution: Resolution = 5000  #: pixels a side, or width and height [px]
    sensor_width: Length = Field(36.0, gt=0.0)
    focal_length: Length = Field(300.0, gt=0.0)
    height: Length = Field(110.0, gt=0.0)  #: pinhole above the posterior pole (from `look_at`), the paper's d0 [mm]
    pixel_aspect: float = Field(1.0, ge=0.1, le=10.0)  #: width of a pixel over its height
    principal_point: tuple[_Pixels, _Pixels] | None = None  #: (x, y) [px]; the frame's centre if not given
    distortion: Distortion | None = None
    tilt: Angle = Field(0.0, ge=0.0, le=math.pi / 3.0)
    azimuth: Angle = 0.0
    roll: Angle = 0.0
    #: where the axis goes through, were there no optics [mm]
    look_at: tuple[Length, Length, Length] = (0.0, 0.0, 0.0)
    optics: AnyOptics = None  #: of the eye that it looks into; with none the retina lies in the open
    lens: AnyLens = None  #: its own aperture, blur and glare; with none it is a pinhole that sees all sharp
    _wavelength: float = PrivateAttr(SODIUM)

    @model_validator(mode="before")
    @classmethod
    def _calibrated(cls, data: Any, info: ValidationInfo) -> Any:
        return calibrated(data, Path((info.context or {}).get("folder", ".")))

    @model_validator(mode="after")
    def _one_to_one(self) -> Camera:
        if self.distortion is None:
            return self
        rows, columns = self.shape
        along = np.linspace(0.0, 1.0, 17)
        border = np.concatenate([[(t, 0.0), (t, 1.0), (0.0, t), (1.0, t)] for t in along]) * [columns, rows]
        x, y = self.on_plane(self.principal + _MARGIN * (border - self.principal))
        if not np.all(np.isfinite(self.distortion.undistorted(x, y))):
            raise ValueError(
                "distortion: these coefficients fold the image within the frame or at its rim"
                f" ({', '.join(f'{c:g}' for c in self.distortion.coefficients)} as k1, k2, p1, p2, k3);"
                " check their order and the focal length"
            )
        return self

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of a frame [px]."""
        if isinstance(self.resolution, int):
            return self.resolution, self.resolution
        return self.resolution[1], self.resolution[0]

    @property
    def size_words(self) -> str:
        """The frame's size in words: 5000 px a side, or 1920 x 1080 px."""
        return f"{self.resolution} px" if isinstance(self.resolution, int) else "{} x {} px".format(*self.resolution)

    @property
    def is_plain(self) -> bool:
        """Whether it is the paper's: in air straight above the pole, square pixels, no distortion, a centred axis."""
        moved = self.tilt != 0.0 or self.roll != 0.0 or self.look_at != (0.0, 0.0, 0.0) or self.optics is not None
        return not moved and self.pixel_aspect == 1.0 and self.principal_point is None and self.distortion is None

    @property
    def centre(self) -> Array:
        """The pinhole `[3]` [mm]."""
        return np.asarray(self.look_at) + self.height * self.axes[2]

    @property
    def axes(self) -> Array:
        """Unit vectors `[3, 3]`, one a row: to the right in the image, up in the image, and back along the axis."""
        return attitude.axes(self.tilt, self.azimuth, self.roll)

    @property
    def principal(self) -> Array:
        """Where the axis goes through the image `[2]` [px]."""
        rows, columns = self.shape
        return np.array(self.principal_point or (columns / 2.0, rows / 2.0))

    @property
    def focal_length_px(self) -> float:
        """Focal length in pixels, counted along a row.

        >>> round(Camera().focal_length_px, 1)
        41666.7
        """
        return self.shape[1] * self.focal_length / self.sensor_width

    @property
    def full_fov(self) -> float:
        """Full angle of view across the image's width, without distortion and its axis in the middle [rad].

        >>> round(math.degrees(Camera().full_fov), 4)  # Table II
        6.8673
        """
        return 2.0 * math.atan2(self.sensor_width / 2.0, self.focal_length)

    @property
    def pixel_pitch(self) -> float:
        """Width of a pixel at the posterior pole (at `look_at`) [mm].

        >>> round(Camera().pixel_pitch, 5)
        0.00264
        """
        return _traced(self.model_copy(update={"lens": None})) if self.optics else self.height / self.focal_length_px

    def seeing(self, wavelength: float) -> Camera:
        """The same camera, whose `rays` and `project` are those of a wavelength [nm] where none is named."""
        camera = self.model_copy()
        camera._wavelength = wavelength
        return camera

    def with_columns(self, columns: int) -> Camera:
        """The same view with that many pixels along a row, and as many rows as keep its shape [px]."""
        scale = columns / self.shape[1]
        update: dict[str, Any] = {"resolution": columns}
        if not isinstance(self.resolution, int):
            update["resolution"] = (columns, round(scale * self.resolution[1]))
        if self.principal_point is not None:
            update["principal_point"] = tuple(scale * c for c in self.principal_point)
        return self.model_copy(update=update)

    def rays(self, pixels: ArrayLike, wavelength: float | None = None, pupil: ArrayLike | None = None) -> Rays:
        """The rays of pixel coordinates `[..., 2]` [px], in the frame or beyond; NaN where the lens puts nothing.

        Through the eye's optics they are those in the vitreous, of a `wavelength` [nm] or the camera's own, and NaN
        where the iris stops them: such a pixel is black. They go through the pinhole, the middle of the entrance
        pupil, or through places in the `pupil` `[..., 2]` [mm], to the right and up in the image.
        """
        seen = self._in_air(pixels) if pupil is None else self._in_air(pixels, pupil, self.vergence)
        if self.optics is None:
            return seen
        return refracted(self.optics, seen, wavelength or self._wavelength)

    @property
    def pupil(self) -> float:
        """Diameter of the lens' entrance pupil [mm]; 0 is a pinhole."""
        return 0.0 if self.lens is None else self.lens.pupil(self.height)

    @property
    def vergence(self) -> float:
        """Of the light that the lens has in focus: 1 over the distance of that plane down the axis in air [1/mm]."""
        sharp = np.array([0.0, 0.0, 0.0 if self.lens is None else self.lens.focus])
        if self.optics is None:
            return 1.0 / float((self.centre - sharp) @ self.axes[2])
        at = np.tile(self.project(sharp), (4, 1))
        return defocus.vergence(lambda places, v: self._unstopped(at, None, places, v), sharp, 1.0 / self.height)

    def confusion(self, points: ArrayLike, wavelength: float | None = None) -> Array:
        """Radius `[...]` [px] of what the lens makes of points `[..., 3]` [mm]; NaN where no ray meets them.

        At a `wavelength` [nm] or the camera's own: the eye's optics have no other in focus at the same place.
        """
        p = np.asarray(points, float)
        if self.pupil == 0.0:
            return np.zeros(p.shape[:-1])
        at, there = p.reshape(-1, 3), self.vergence
        q = self.project(at)
        radius = defocus.blurred(lambda place: self._unstopped(q, wavelength, place, there), at, self.pupil / 2.0)
        return radius.reshape(p.shape[:-1])

    def shows(self, pixels: ArrayLike) -> NDArray[np.bool_]:
        """Which pixel coordinates `[..., 2]` [px] lie in the frame, and are not black for the iris: `[...]`."""
        q = np.asarray(pixels, float)
        inside = np.all((q >= 0.0) & (q <= self.shape[::-1]), axis=-1)
        return inside if self.optics is None else inside & np.isfinite(self.rays(q).directions[..., 0])

    def _unstopped(
        self, pixels: ArrayLike, wavelength: float | None = None, pupil: ArrayLike = (0.0, 0.0), vergence: float = 0.0
    ) -> Rays:
        """The rays as if the iris let them through, so that an outline goes on behind it."""
        seen = self._in_air(pixels, pupil, vergence)
        if self.optics is None:
            return seen
        return refracted(self.optics, seen, wavelength or self._wavelength, stopped=False)

    def _in_air(self, pixels: ArrayLike, pupil: ArrayLike = (0.0, 0.0), vergence: float = 0.0) -> Rays:
        """`rays` of the camera alone, for a `vergence` [1/mm] of the light that is in focus."""
        q = np.asarray(pixels, float)
        x, y = self.on_plane(q)
        if self.distortion is not None:
            x, y = self.distortion.undistorted(x, y)
        place = np.asarray(pupil, float)
        moved = bool(np.any(place))
        ahead = (x - vergence * place[..., 0], y + vergence * place[..., 1]) if moved else (x, y)
        d = np.empty((3, *np.shape(ahead[0])))  # components first: three times as fast as last
        d[0], d[1], d[2] = ahead[0], 0.0 - ahead[1], -1.0  # no negative zero
        length = np.sqrt(d[0] * d[0] + d[1] * d[1] + 1.0)
        d /= length
        per_x = 1.0 / (self.focal_length_px * length)
        per_y = per_x if self.pixel_aspect == 1.0 else per_x / self.pixel_aspect
        # of D / |D| with D' = (1, 0, 0) / f, and (0, -1, 0) / f down the image
        by_x, by_y = -(per_x * d[0]) * d, (per_y * d[1]) * d
        by_x[0] += per_x
        by_y[1] -= per_y
        if self.distortion is not None:
            # from changes on the plane to changes before the lens, by the inverse of its Jacobian
            xx, xy, yy = self.distortion.jacobian(x, y)
            per = 1.0 / (xx * yy - xy * xy)
            aspect = self.pixel_aspect
            by_x, by_y = per * (yy * by_x - xy * aspect * by_y), per * (xx * by_y - xy / aspect * by_x)
        last = (*range(1, d.ndim), 0)
        seen = [part.transpose(last) for part in (d, by_x, by_y)]
        if self.tilt or self.roll:
            seen = [part @ self.axes for part in seen]
        origin = self.centre + place @ self.axes[:2] if moved else self.centre
        return Rays(origin, seen[0], _STILL, _STILL, seen[1], seen[2])

    def project(self, points: ArrayLike) -> Array:
        """Pixel coordinates `[..., 2]` [px] of points `[..., 3]` [mm], the inverse of `rays`.

        In the frame or beyond it, and behind the iris as far as the eye's optics go on there, so that an outline does
        not end at the pupil (`shows` tells). NaN for what no ray meets: all beside and above the pinhole, or the lens.

        >>> Camera().project([0.0, 0.0, 120.0]).tolist()
        [nan, nan]
        """
        if self.optics is None:
            return self._from_air(points)
        return found(self._unstopped, np.asarray(points, float), self._from_air([0.0, 0.0, self.optics.iris]))

    def _from_air(self, points: ArrayLike) -> Array:
        """`project` of the camera alone."""
        p = np.asarray(points, float)
        if self.tilt or self.roll or self.look_at != (0.0, 0.0, 0.0):
            p = (p - self.centre) @ self.axes.T
            below = -p[..., 2]
        else:
            below = self.height - p[..., 2]
        below = np.where(below > 0.0, below, np.nan)
        (cx, cy), f = self.principal, self.focal_length_px
        if self.distortion is not None:
            x, y = self.distortion.distorted(p[..., 0] / below, -p[..., 1] / below)
            return np.stack([cx + f * x, cy + f * self.pixel_aspect * y], axis=-1)
        scale = f / below
        return np.stack([cx + scale * p[..., 0], cy - scale * self.pixel_aspect * p[..., 1]], axis=-1)

    def on_plane(self, pixels: Array) -> tuple[Array, Array]:
        """Pixel coordinates `[..., 2]` [px] as (x, y), y down, on the plane at distance 1, where the lens put them."""
        (cx, cy), f = self.principal, self.focal_length_px
        return (pixels[..., 0] - cx) / f, (pixels[..., 1] - cy) / (f * self.pixel_aspect)


@lru_cache(maxsize=16)
def _traced(camera: Camera) -> float:
    """`pixel_pitch` through the eye's optics, whatever the lens: a fit asks often, and to trace it takes 30 ms."""
    return pitch(camera._unstopped(camera.project(np.zeros(3))))
