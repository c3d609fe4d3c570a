"""Deep light where a camera's ray meets the retina, for Mitsuba's JIT variants."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from conespot.render import kernel
from conespot.render.chart import CELL
from conespot.render.deep_light import DeepLight, DeepMaps
from conespot.render.fundus_maps import fundus_maps
from conespot.render.fundus_texture import fundus_texture
from conespot.render.reflectance import EXTENT
from conespot.render.retina_sphere import arc_uv
from conespot.scene import Eye, Pose
from conespot.scene.retina import Fundus

if TYPE_CHECKING:
    from mitsuba import RayDifferential3f, Scene, Shape, Spectrum


class Glow:
    """What the `shape` of a retina radiates of light that entered it elsewhere: `DeepMaps` times t(x) / pi.

    Raises KernelError in the scalar variant, which knows no such light.
    """

    def __init__(self, eye: Eye, retina: Fundus, shape: Shape, deep: DeepLight) -> None:
        self.deep = deep
        self._shape = shape
        self._mi, self._dr, chosen = kernel.load()
        if not chosen.vectorized:
            raise kernel.KernelError(
                f"retina.spread needs a JIT variant, and this is {chosen.variant}: leave it out, or see `doctor`"
            )
        self._eye = eye
        self._passage: Any = fundus_texture(self._mi, self._dr, fundus_maps(retina), retina, EXTENT, "passage")
        self._maps: Any = None

    def show_spotlight(self, pose: Pose, spotlight: int) -> None:
        """From now on, the light of a spotlight at 1 W."""
        self._show(self.deep.spotlight(pose, spotlight))

    def show_ambient(self) -> None:
        """From now on, the microscope's light."""
        self._show(self.deep.ambient())

    def _show(self, deep: DeepMaps) -> None:
        mi, dr = self._mi, self._dr
        clamp = {"filter_mode": dr.FilterMode.Linear, "wrap_mode": dr.WrapMode.Clamp, "use_accel": False}
        self._maps = mi.Texture3f(mi.TensorXf(deep.values[..., None]), **clamp)
        self._scale = mi.Texture1f(mi.TensorXf(deep.scale.astype(np.float32)[:, None]), **clamp)
        chart = deep.chart
        # as constants they would make another kernel of every pose
        axes = (*chart.across, chart.centre)
        self._axes = [mi.Vector3f(*(dr.opaque(mi.Float, float(part)) for part in axis)) for axis in axes]
        self._radius, self._side = dr.opaque(mi.Float, chart.radius), dr.opaque(mi.Float, chart.side * CELL)
        wavelengths = self.deep.wavelengths
        self._first = dr.opaque(mi.Float, wavelengths[0])
        self._span = dr.opaque(mi.Float, max(wavelengths[-1] - wavelengths[0], 1.0))
        self._count = len(wavelengths)

    def along(self, loaded: Scene, ray: RayDifferential3f) -> Spectrum:
        """What leaves the retina along rays of a Mitsuba scene; 0 where they meet nothing, or the shaft."""
        mi, dr = self._mi, self._dr
        at = loaded.ray_intersect(ray)
        direction = dr.normalize(at.p - mi.Point3f(self._eye.centre.tolist()))
        x, y, along = (dr.dot(direction, axis) for axis in self._axes)
        stretch = self._radius * dr.sqrt(2.0 / dr.maximum(1.0 + along, 1e-6)) / self._side
        u, v = 0.5 + stretch * x, 0.5 + stretch * y
        active = (
            at.is_valid() & (at.shape == mi.ShapePtr(self._shape)) & (dr.abs(u - 0.5) < 0.5) & (dr.abs(v - 0.5) < 0.5)
        )
        there = mi.SurfaceInteraction3f(at)
        there.uv = arc_uv(mi, dr, direction, self._eye)
        passed = self._passage.eval(there, active)
        result = mi.UnpolarizedSpectrum(0.0)
        for i in range(len(at.wavelengths)):
            step = (at.wavelengths[i] - self._first) / self._span * (self._count - 1)
            entered = self._maps.eval(mi.Point3f(u, v, (step + 0.5) / self._count), active)[0]
            scale = self._scale.eval(mi.Float((at.wavelengths[i] - 300.0 + 0.5) / 801.0), active)[0]
            result[i] = passed[i] * scale * entered / math.pi
        return result & active
