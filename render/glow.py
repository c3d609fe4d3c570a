"""Deep light as the camera's pixels see it, for Mitsuba's JIT variants.

    L = sum over wavelengths of weight * `DeepMaps` * mean of t over the pixel

The maps change with the light, and are smooth; t has the vessels in it, and is the camera's and the retina's alone. So
rays are traced for t, once for each pixel, and no wavelength is drawn by chance: there is no noise.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from conespot.render import kernel
from conespot.render.deep_light import DeepLight, DeepMaps, typical
from conespot.render.fundus_maps import fundus_maps
from conespot.render.fundus_texture import fundus_texture
from conespot.render.rays import RayGenerator
from conespot.render.reflectance import EXTENT
from conespot.render.retina_sphere import arc_uv
from conespot.scene import Scene
from conespot.scene.retina import Fundus
from conespot.scene.spectrum import Curve

Image = NDArray[np.float32]

#: between a pixel's rays at the pole, at most [mm]: the vessels' maps have texels of 5 um
_BETWEEN = 0.014
#: but no more of them along its side
_MOST = 4
#: rays traced in one pass
_PASS = 2**22


class Glow:
    """What a retina radiates of light that entered it elsewhere, in a Mitsuba scene that a camera sees.

    Raises KernelError in the scalar variant, which knows no such light.
    """

    def __init__(
        self, scene: Scene, retina: Fundus, loaded: Any, shape: Any, camera: RayGenerator | None, films: list[Curve]
    ) -> None:
        """`shape` is the retina of the scene `loaded`."""
        self._mi, self._dr, chosen = kernel.load()
        if not chosen.vectorized or camera is None:
            raise kernel.KernelError(
                f"retina.spread needs a JIT variant, and this is {chosen.variant}: leave it out, or see `doctor`"
            )
        self.deep = DeepLight(scene, retina, films)
        self._scene, self._loaded, self._shape, self._camera = scene, loaded, shape, camera
        self._alone = len(loaded.shapes()) == 1
        self._closed = self._alone and not shape.is_mesh()  # met in closed form, in the kernel itself
        self._texture: Any = fundus_texture(self._mi, self._dr, fundus_maps(retina), retina, EXTENT, "passage")
        self._typical = typical(np.array(self.deep.wavelengths)).astype(np.float32)
        self._known: NDArray[np.bool_] | None = None

    def seen(self, pixels: NDArray[np.uint32], maps: DeepMaps, *, once: bool = False) -> Image:
        """The radiance `[N, C]` of deep light in the frame's pixels `[N]`, row * columns + column.

        Where nothing but the retina can be seen, its t is kept for the next maps, unless they are shown `once`.
        """
        if self._alone and not once:
            passage, away = self._kept(pixels)
        else:
            passage, away = self._traced(pixels)
        return np.asarray((maps.weights @ (passage * maps.chart.read(maps.values, away))).T, np.float32)

    def _kept(self, pixels: NDArray[np.uint32]) -> tuple[Image, Image]:
        """`_traced` of pixels that were not asked for before."""
        if self._known is None:
            # the frame's, of which the system gives the part that is used
            size = math.prod(self._scene.camera.shape)
            self._known = np.zeros(size, bool)
            self._passage = np.zeros((len(self._typical), size), np.float32)
            self._away = np.zeros((size, 3), np.float32)
        new = pixels[~self._known[pixels]]
        if len(new):
            self._passage[:, new], self._away[new] = self._traced(new)
            self._known[new] = True
        return self._passage[:, pixels], self._away[pixels]

    def _traced(self, pixels: NDArray[np.uint32]) -> tuple[Image, Image]:
        """Mean over pixels `[N]` of t relative to the typical one `[wavelengths, N]`, and where they look `[N, 3]`.

        That is a unit direction from the eye's centre, through optics that of the middle wavelength.
        """
        passage, away = np.empty((len(self._typical), len(pixels)), np.float32), np.empty((len(pixels), 3), np.float32)
        size = _PASS // self._across**2
        for first in range(0, len(pixels), size):
            part = slice(first, first + size)
            passage[:, part], away[part] = self._pass(pixels[part])
        return passage / self._typical[:, None], away

    @property
    def _across(self) -> int:
        """Rays along a pixel's side; where each takes its place in the lens' pupil, there are many."""
        return _MOST if self._camera.has_aperture else min(_MOST, math.ceil(self._scene.camera.pixel_pitch / _BETWEEN))

    def _pass(self, pixels: NDArray[np.uint32]) -> tuple[Image, Image]:
        mi, dr, n = self._mi, self._dr, self._across
        lane = dr.arange(mi.UInt32, len(pixels) * n**2)
        pixel, k = dr.gather(mi.UInt32, mi.UInt32(pixels), lane // n**2), lane % n**2
        columns = self._scene.camera.shape[1]
        x, y = mi.Float(pixel % columns) + (k % n + 0.5) / n, mi.Float(pixel // columns) + (k // n + 0.5) / n
        place = None
        if self._camera.has_aperture:  # cells of the pupil, paired with those of the pixel in its own way
            cell = mi.permute_kensler(k, n**2, mi.sample_tea_32(pixel, 0)[0])
            unit = mi.Point2f((mi.Float(cell % n) + 0.5) / n, (mi.Float(cell // n) + 0.5) / n)
            place = mi.warp.square_to_uniform_disk_concentric(unit)
        # as constants they would make another kernel of every light
        wavelengths = [dr.opaque(mi.Float, wavelength) for wavelength in self.deep.wavelengths]
        # four at a time, the last ones again where there are no more; through optics each has a way of its own
        step = 1 if self._camera.disperses else 4
        found: list[Any] = []
        ways: list[Any] = []
        for first in range(0, len(wavelengths), step):
            four = [
                wavelengths[min(first + i, len(wavelengths) - 1)] if step == 4 else wavelengths[first] for i in range(4)
            ]
            passed, away = self._along(x, y, mi.UnpolarizedSpectrum(*four), place)
            found += [dr.block_sum(passed[i], n**2) for i in range(min(step, len(wavelengths) - first))]
            ways.append(away)
        direction = [dr.block_sum(part, n**2) for part in ways[len(ways) // 2]]
        dr.eval(found, direction)
        there = np.stack([np.asarray(part) for part in direction], axis=-1)
        length = np.linalg.norm(there, axis=-1, keepdims=True)
        passage = np.stack([np.asarray(part) for part in found]) / np.float32(n**2)
        return passage.astype(np.float32), np.asarray(there / np.maximum(length, 1e-6), np.float32)

    def _along(self, x: Any, y: Any, wavelengths: Any, place: Any) -> tuple[Any, Any]:
        """t of film positions, and the direction from the eye's centre; 0 where there is no retina, or the shaft."""
        mi, dr = self._mi, self._dr
        ray, seen = self._camera.rays(x, y, wavelengths, place)
        at = (self._shape if self._closed else self._loaded).ray_intersect(ray)
        active = at.is_valid() & seen
        if not self._alone:
            active &= at.shape == mi.ShapePtr(self._shape)
        away = dr.normalize(at.p - mi.Point3f(self._scene.eye.centre.tolist()))
        there = mi.SurfaceInteraction3f(at)
        there.wavelengths = wavelengths
        there.uv = arc_uv(mi, dr, away, self._scene.eye)
        return self._texture.eval(there, active), dr.select(active, away, 0.0)
