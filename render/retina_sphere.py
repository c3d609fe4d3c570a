"""The smooth retina as Mitsuba's sphere: met in closed form, several times faster than a mesh, for JIT variants."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from conespot.render.reflectance import EXTENT
from conespot.scene import Eye

if TYPE_CHECKING:
    from mitsuba import (
        Bool,
        Float,
        Point2f,
        Properties,
        SurfaceInteraction3f,
        Texture,
        UnpolarizedSpectrum,
        Vector3f,
    )


def retina_sphere(eye: Eye, bsdf: dict[str, object]) -> dict[str, object]:
    """The whole sphere, seen from inside: the camera needs a near plane that lets it see past the upper half."""
    return {
        "type": "sphere",
        "center": eye.centre.tolist(),
        "radius": eye.radius,
        "flip_normals": True,
        "bsdf": bsdf,
    }


def arc_uv(mi: Any, dr: Any, direction: Vector3f, eye: Eye) -> Point2f:
    """Texture coordinates (see reflectance.py) in directions from the eye's centre."""
    rho = dr.sqrt(dr.square(direction.x) + dr.square(direction.y))
    # the angle from the pole over its sine, 1 to the last bit where both vanish
    stretch = dr.select(rho > 1e-4, dr.atan2(rho, -direction.z) / rho, 1.0) * (eye.radius / (2.0 * EXTENT))
    return mi.Point2f(0.5 + stretch * direction.x, 0.5 - stretch * direction.y)


def on_sphere(mi: Any, dr: Any, texture: Texture | dict[str, object], eye: Eye) -> Texture:
    """A texture over arc coordinates (see reflectance.py) for the eye's sphere, whose own coordinates are polar."""
    centre = eye.centre.tolist()
    inner: Any = mi.load_dict(texture) if isinstance(texture, dict) else texture

    class OnSphere(mi.Texture):  # type: ignore[misc]
        """The inner texture at the arc coordinates of the place on the sphere."""

        def __init__(self, properties: Properties) -> None:
            super().__init__(properties)
            self.inner = inner

        def eval(self, si: SurfaceInteraction3f, active: Bool | bool = True) -> UnpolarizedSpectrum:
            """Reflectance at the four wavelengths of `si`."""
            there = mi.SurfaceInteraction3f(si)
            there.uv = arc_uv(mi, dr, (si.p - mi.Point3f(centre)) / eye.radius, eye)
            return self.inner.eval(there, active)

        def mean(self) -> Float:
            """The inner texture's; Mitsuba only weighs lobes with it."""
            return self.inner.mean()

        def max(self) -> float:
            """Bound of the reflectance."""
            return float(self.inner.max())

        def is_spatially_varying(self) -> bool:
            """It is."""
            return True

        def to_string(self) -> str:
            """For Mitsuba's printing of scenes."""
            return f"OnSphere[{self.inner}]"

    return OnSphere(mi.Properties())
