"""The camera's rays in Dr.Jit: what `Camera.rays` gives for a pixel, for all lanes of a kernel at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from conespot.render import kernel
from conespot.render.blur import places
from conespot.scene import Camera
from conespot.scene.distortion import Distortion

if TYPE_CHECKING:
    from drjit.auto.ad import Bool, Float, UInt32
    from mitsuba import Point2f, RayDifferential3f, Spectrum

#: Newton's steps against distortion end where they are this close to the inverse [px]
_CLOSE = 1e-3


class RayGenerator:
    """Makes the rays of film positions, the one way in which the JIT variants see.

    Whatever bends, shifts or delays a ray before it is in the vitreous belongs here, and in `Camera.rays`.
    """

    def __init__(self, camera: Camera, near: float, blur: tuple[float, float] | None = None) -> None:
        """Rays begin `near` [mm] down the camera's axis, or in the vitreous, so that nothing above hides the retina.

        Those of a pixel lie all over it, or are spread by a Gaussian's `blur` across and down [px] besides.
        """
        mi, _, _ = kernel.load()
        self._places = None if blur is None else [mi.Float(places(sigma)) for sigma in blur]
        focal_length = camera.focal_length_px
        self._middle = _held(camera.principal.tolist())
        self._pixel = _held([1.0 / focal_length, 1.0 / (focal_length * camera.pixel_aspect)])  # at a distance of 1
        self._lens = None if camera.distortion is None else _Lens(camera, camera.distortion)
        self._origin = mi.Point3f(*_held(camera.centre.tolist()))
        upright = camera.tilt == camera.roll == 0.0
        self._axes = None if upright else [mi.Vector3f(*_held(axis)) for axis in camera.axes.tolist()]
        self._near = _held([near])[0]
        self._optics = camera.optics
        self.has_aperture = camera.pupil > 0.0  #: whether rays come through places all over a pupil
        self._pupil = _held([camera.pupil / 2.0, camera.vergence]) if self.has_aperture else None

    @property
    def disperses(self) -> bool:
        """Whether light of each wavelength has a way of its own; then all of a ray's must be alike."""
        return self._optics is not None

    def on_film(self, column: UInt32, row: UInt32, across: Float, down: Float) -> tuple[Float, Float]:
        """Where on the film (x, y) [px] a pixel's sample lies, by its place (0 to 1) in the pixel's cells."""
        mi, dr, _ = kernel.load()
        if self._places is None:
            return mi.Float(column) + across, mi.Float(row) + down
        placed = []
        for table, share in zip(self._places, (across, down), strict=True):
            step = share * (dr.width(table) - 1)
            entry = dr.minimum(mi.UInt32(step), dr.width(table) - 2)
            low, high = dr.gather(mi.Float, table, entry), dr.gather(mi.Float, table, entry + 1)
            placed.append(dr.lerp(low, high, step - mi.Float(entry)) + 0.5)
        return mi.Float(column) + placed[0], mi.Float(row) + placed[1]

    def rays(
        self, x: Float, y: Float, wavelengths: Spectrum, place: Point2f | None = None
    ) -> tuple[RayDifferential3f, Bool | bool]:
        """The rays of film positions (x, y) [px], x to the right and y down, with their wavelengths [nm].

        And which of them reach the vitreous: the iris stops some. They come through the pinhole, or through the `place`
        in the entrance pupil, as a unit disc.
        """
        mi, dr, _ = kernel.load()
        across, down = (x - self._middle[0]) * self._pixel[0], (y - self._middle[1]) * self._pixel[1]
        if self._lens is not None:
            across, down = self._lens.undistorted(across, down)
        through = self._origin
        if place is not None and self._pupil is not None:
            radius, vergence = self._pupil
            place = place * radius
            across, down = across - vergence * place.x, down + vergence * place.y
            right, up, _ = self._axes or (mi.Vector3f(1.0, 0.0, 0.0), mi.Vector3f(0.0, 1.0, 0.0), None)
            through = through + right * place.x + up * place.y
        per_depth = dr.sqrt(dr.fma(across, across, dr.fma(down, down, 1.0)))  # length of a ray a mm down the axis
        if self._axes is None:
            direction = mi.Vector3f(across, -down, -1.0) / per_depth
        else:
            right, up, back = self._axes
            direction = (right * across - up * down - back) / per_depth
        origin = through + direction * (self._near * per_depth)
        if self._optics is None:
            return mi.RayDifferential3f(origin, direction, wavelengths=wavelengths), True
        entry, way, off = self._optics.enter(tuple(origin), tuple(direction), wavelengths[0], dr.sqrt)
        seen = off <= 1.0  # nor is what is no number
        # those that are stopped go down the axis, since nothing should trace a ray without direction
        origin = dr.select(seen, mi.Point3f(*entry), mi.Point3f(0.0, 0.0, self._optics.iris))
        direction = dr.select(seen, mi.Vector3f(*way), mi.Vector3f(0.0, 0.0, -1.0))
        return mi.RayDifferential3f(origin, direction, wavelengths=wavelengths), seen


class _Lens:
    """`Distortion.undistorted` in Dr.Jit."""

    def __init__(self, camera: Camera, lens: Distortion) -> None:
        self._coefficients = _held(lens.coefficients)
        rows, columns = camera.shape
        x, y = np.meshgrid(np.linspace(0.0, columns, 33), np.linspace(0.0, rows, 33))
        self._steps = lens.steps(*camera.on_plane(np.stack([x, y], axis=-1)), _CLOSE / camera.focal_length_px)

    def undistorted(self, to_x: Float, to_y: Float) -> tuple[Float, Float]:
        k1, k2, p1, p2, k3 = self._coefficients
        x, y = to_x, to_y
        for _ in range(self._steps):
            r2 = x * x + y * y
            radial = r2 * (k1 + r2 * (k2 + r2 * k3))
            twice = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
            # differences from (x, y) first, which are small
            off_x = (to_x - x) - (x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x))
            off_y = (to_y - y) - (y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y)
            xx = 1.0 + radial + twice * x * x + 2.0 * p1 * y + 6.0 * p2 * x
            xy = twice * x * y + 2.0 * p1 * x + 2.0 * p2 * y
            yy = 1.0 + radial + twice * y * y + 6.0 * p1 * y + 2.0 * p2 * x
            per = 1.0 / (xx * yy - xy * xy)
            x, y = x + per * (yy * off_x - xy * off_y), y + per * (xx * off_y - xy * off_x)
        return x, y


def _held(values: Sequence[float]) -> list[Float]:
    """Numbers as data of a kernel: literals would be its constants, and every camera had a kernel of its own."""
    mi, dr, _ = kernel.load()
    return [dr.opaque(mi.Float, value) for value in values]
