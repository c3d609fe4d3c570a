"""The renderer: one Mitsuba scene, loaded once, moved from pose to pose."""

from __future__ import annotations

import functools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render import emitters, kernel, shaft
from render.reflectance import Reflectance
from render.retina_mesh import retina_mesh
from render.tile import Crop, Tile
from scene import Pose, Scene
from scene.illumination import Light
from scene.spotlights import spotlight_axes

Image = NDArray[np.float32]

#: samples traced in one pass: bounds the memory whatever the frame
PASS = 2**23
#: the ambient light is collimated and the texture smooth, so the background needs few samples a pixel
BACKGROUND_SAMPLES = 4
#: the background belongs to the scene and not to a run: every run sees the same one
BACKGROUND_SEED = 0


class Renderer:
    """Renders radiance: spotlight tiles at 1 W, and the background without spotlights.

    Light adds up and is linear in power, so a frame at any power is background + power * sum of tiles; the scene's
    own power value plays no part here, its convention does. `samples` a pixel are stratified over the pixel's area.
    Raises KernelError if Mitsuba cannot be used.
    """

    def __init__(self, scene: Scene, *, samples: int = 16) -> None:
        self.scene = scene
        self.samples = samples
        self.rendered = 0  #: tiles and backgrounds rendered so far
        self._mi, _, self._kernel = kernel.load()
        self._shaft = scene.instrument.shaft
        mi = self._mi
        bsdf = mi.load_dict({"type": "diffuse", "reflectance": Reflectance(scene.retina).texture(mi)})
        self._retina = retina_mesh(mi, scene, bsdf)
        self._lit = self._load(emitters.spotlight(mi, scene), scene.illumination, samples, self._shaft is not None)
        self._lit_parameters = mi.traverse(self._lit)

    def tile(self, pose: Pose, spotlight: int, seed: int) -> Tile:
        """The radiance of one spotlight at 1 W; `seed` decides its Monte Carlo noise."""
        crop = self.footprint(pose, spotlight)
        axis = spotlight_axes(pose, self.scene.spotlights)[spotlight]
        parameters = self._lit_parameters
        parameters["light.to_world"] = emitters.aim(self._mi, pose.apex, axis)
        if self._shaft is not None:
            shaft.place(self._mi, parameters, self._shaft, pose)
        self.rendered += 1
        return Tile(crop, self._render(self._lit, parameters, crop, self.samples, seed))

    def footprint(self, pose: Pose, spotlight: int) -> Crop:
        """The pixels a spotlight can reach: its cone's outline, moved along the rays by what bumps may add or hide."""
        scene = self.scene
        rays = scene.outline(pose, spotlight) - pose.apex
        length = np.linalg.norm(rays, axis=-1, keepdims=True)
        # three times the relief covers any incidence up to 70 deg
        reach = np.concatenate([length + k * scene.surface.relief for k in (-3.0, 0.0, 3.0)])
        points = pose.apex + np.tile(rays / length, (3, 1)) * np.maximum(reach, 0.0)
        return Crop.around(scene.camera.project(points), scene.camera.resolution, margin=2.0)

    def background(self, pose: Pose | None = None) -> Image:
        """The radiance `[H, W, C]` [W m-2 sr-1] in ambient light alone. With a visible shaft it needs the pose."""
        if self._shaft is None or pose is None:
            return self._empty_background
        crop = shaft.shaft_crop(self.scene, self._shaft, pose)
        if crop.height == 0 or crop.width == 0:
            return self._empty_background
        shaded = self._ambient(with_shaft=True)
        parameters = self._mi.traverse(shaded)
        shaft.place(self._mi, parameters, self._shaft, pose)
        frame = self._empty_background.copy()
        frame[crop.slices] = self._render(shaded, parameters, crop, self.samples, BACKGROUND_SEED)
        self.rendered += 1
        return frame

    @functools.cached_property
    def _empty_background(self) -> Image:
        n = self.scene.camera.resolution
        bare = self._ambient(with_shaft=False)
        self.rendered += 1
        frame = self._render(bare, self._mi.traverse(bare), Crop(0, 0, n, n), BACKGROUND_SAMPLES, BACKGROUND_SEED)
        frame.flags.writeable = False
        return frame

    @functools.lru_cache(maxsize=2)  # noqa: B019 - a renderer lives as long as its process
    def _ambient(self, with_shaft: bool) -> Any:
        samples = self.samples if with_shaft else BACKGROUND_SAMPLES
        return self._load(emitters.ambient(self.scene), self.scene.ambient.illumination, samples, with_shaft)

    def _load(self, light: dict[str, Any], spectrum: Light, samples: int, with_shaft: bool) -> Any:
        """A Mitsuba scene with the shared retina and one light, seen by a film of its spectrum."""
        mi, camera = self._mi, self.scene.camera
        film = {
            "type": "specfilm",
            "width": camera.resolution,
            "height": camera.resolution,
            "crop_width": 1,
            "crop_height": 1,
            "component_format": "float32",
            "rfilter": {"type": "box"},
            "response": emitters.response(spectrum),
        }
        sensor = {
            "type": "perspective",
            "fov": math.degrees(camera.full_fov),
            "fov_axis": "x",
            "near_clip": camera.height / 1000.0,
            "far_clip": camera.height * 2.0,
            "to_world": mi.ScalarTransform4f().look_at(origin=camera.centre.tolist(), target=[0, 0, 0], up=[0, 1, 0]),
            "film": film,
            "sampler": {"type": "stratified", "sample_count": samples},
        }
        shapes = {"retina": self._retina}
        if with_shaft and self._shaft is not None:
            shapes.update(shaft.shaft_shapes(mi, self._shaft))
        integrator = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0}
        return mi.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor, "light": light, **shapes})

    def _render(self, scene: Any, parameters: Any, crop: Crop, samples: int, seed: int) -> Image:
        """The crop's radiance `[h, w, C]`, in bands of rows that keep a pass below `PASS` samples."""
        image = np.zeros((crop.height, crop.width, 1), np.float32)
        if crop.height == 0 or crop.width == 0:
            return image
        rows = max(1, min(crop.height, PASS // (crop.width * samples)))
        for band, first in enumerate(range(0, crop.height, rows)):
            height = min(rows, crop.height - first)
            parameters["sensor.film.crop_offset"] = [crop.column, crop.row + first]
            parameters["sensor.film.crop_size"] = [crop.width, height]
            parameters.update()
            rendered = self._mi.render(scene, spp=samples, seed=(seed + 7919 * band) % 2**32)
            image[first : first + height] = np.asarray(rendered).reshape(height, crop.width, -1)
        return image
