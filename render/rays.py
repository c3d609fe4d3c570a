"""The camera's rays in Dr.Jit: what `Camera.rays` gives for a pixel, for all lanes of a kernel at once."""

from __future__ import annotations

from typing import TYPE_CHECKING

from conespot.render import kernel
from conespot.scene import Camera

if TYPE_CHECKING:
    from drjit.auto.ad import Float
    from mitsuba import RayDifferential3f, Spectrum


class RayGenerator:
    """Makes the rays of film positions, the one way in which the JIT variants see.

    Whatever bends, shifts or delays a ray before it is in the vitreous belongs here, and in `Camera.rays`.
    """

    def __init__(self, camera: Camera, near: float) -> None:
        """Rays begin where they are `near` [mm] below the pinhole, so that nothing above hides the retina."""
        mi, dr, _ = kernel.load()
        rows, columns = camera.shape

        def held(value: float) -> Float:
            # a literal would be a constant of the kernel, which were compiled anew for every camera
            return dr.opaque(mi.Float, value)

        self._middle = held(columns / 2.0), held(rows / 2.0)
        self._pixel = held(1.0 / camera.focal_length_px)  # at a distance of 1
        self._origin = [held(part) for part in camera.centre.tolist()]
        self._near = held(near)

    def rays(self, x: Float, y: Float, wavelengths: Spectrum) -> RayDifferential3f:
        """The rays of film positions (x, y) [px], x to the right and y down, with their wavelengths [nm]."""
        mi, dr, _ = kernel.load()
        across, down = (x - self._middle[0]) * self._pixel, (y - self._middle[1]) * self._pixel
        per_depth = dr.sqrt(dr.fma(across, across, dr.fma(down, down, 1.0)))  # length of a ray a mm down
        direction = mi.Vector3f(across, -down, -1.0) / per_depth
        origin = mi.Point3f(*self._origin) + direction * (self._near * per_depth)
        return mi.RayDifferential3f(origin, direction, wavelengths=wavelengths)
