"""A view: the camera's picture of the retina in one light, as a Mitsuba scene that is loaded once and updated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from render import globe, kernel, spectral
from render.reflectance import Reflectance
from render.retina_mesh import retina_mesh
from render.tile import Crop
from scene import Scene
from scene.illumination import Light
from scene.spectrum import Curve

Image = NDArray[np.float32]

#: samples traced in one pass: bounds the memory whatever the frame
PASS = 2**23


class View:
    """The retina in one light, seen by a film with the sensor's channels.

    The JIT variants evaluate a spectral map at every sampled wavelength. The scalar one cannot, so there each channel
    is a Mitsuba scene of its own, with the map averaged over the channel's band: the same for light reflected once.
    """

    def __init__(
        self,
        scene: Scene,
        emitter: Mapping[str, Any],
        light: Light,
        *,
        samples: int,
        shapes: Mapping[str, Any],
        responses: dict[str, Curve] | None = None,
        closed: bool = False,
        like: View | None = None,
    ) -> None:
        """Load it. `like` is another view of the same scene, whose retina is shared where the light plays no part."""
        mi, dr, chosen = kernel.load()
        self._mi = mi
        reflectance = Reflectance(scene.retina)
        channels = spectral.channels(scene, light, responses)
        self.channels = len(channels)
        apart = reflectance.is_spectral_map and not chosen.vectorized
        # a channel whose filter blocks all of the light stays black; Mitsuba could not sample a wavelength for it
        self._seen = [i for i, channel in enumerate(channels) if channel.film.integral() > 0.0]
        self._scenes = []
        self.retina: Any = None
        for group in [[channels[i]] for i in self._seen] if apart else [[channels[i] for i in self._seen]]:
            if not group:
                continue
            if apart or like is None or like.retina is None:
                bsdf = mi.load_dict(reflectance.bsdf(mi, dr, group[0].film if apart else None))
                self.retina = retina_mesh(mi, scene, bsdf)
            else:
                self.retina = like.retina
            integrator: dict[str, Any] = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0}
            everything = {"retina": self.retina, "light": dict(emitter), **shapes}
            near = scene.camera.height / 1000.0
            if closed and scene.interreflection is not None:
                near = globe.near_plane(scene)
                everything.update(globe.globe_shapes(mi, scene, scene.interreflection))
                depth = scene.interreflection.bounces + 1
                integrator = {"type": "path", "max_depth": depth, "rr_depth": depth}
            sensor = _sensor(mi, scene, group, samples, near)
            self._scenes.append(
                mi.load_dict({"type": "scene", "integrator": integrator, "sensor": sensor, **everything})
            )
        self._parameters = [mi.traverse(loaded) for loaded in self._scenes]

    def update(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the Mitsuba scene; they take effect with the next rendering."""
        for parameters in self._parameters:
            for key, value in values.items():
                parameters[key] = value

    def render(self, crop: Crop, samples: int, seed: int) -> Image:
        """The crop's radiance `[h, w, C]`, in bands of rows that keep a pass below `PASS` samples."""
        image = np.zeros((crop.height, crop.width, self.channels), np.float32)
        if crop.height == 0 or crop.width == 0 or not self._scenes:
            return image
        rows = max(1, min(crop.height, PASS // (crop.width * samples)))
        for band, first in enumerate(range(0, crop.height, rows)):
            height = min(rows, crop.height - first)
            layers = []
            for loaded, parameters in zip(self._scenes, self._parameters, strict=True):
                parameters["sensor.film.crop_offset"] = [crop.column, crop.row + first]
                parameters["sensor.film.crop_size"] = [crop.width, height]
                parameters.update()
                rendered = self._mi.render(loaded, spp=samples, seed=(seed + 7919 * band) % 2**32)
                layers.append(np.asarray(rendered).reshape(height, crop.width, -1))
            image[first : first + height, :, self._seen] = np.concatenate(layers, axis=-1)
        return image


def _sensor(mi: Any, scene: Scene, channels: list[spectral.Channel], samples: int, near: float) -> dict[str, Any]:
    camera = scene.camera
    # Mitsuba orders the channels by their keys
    responses = {f"channel_{i:02d}": spectral.film_spectrum(channel.film) for i, channel in enumerate(channels)}
    film = {
        "type": "specfilm",
        "width": camera.resolution,
        "height": camera.resolution,
        "crop_width": 1,
        "crop_height": 1,
        "component_format": "float32",
        "rfilter": {"type": "box"},
        **responses,
    }
    return {
        "type": "perspective",
        "fov": math.degrees(camera.full_fov),
        "fov_axis": "x",
        "near_clip": near,
        "far_clip": camera.height * 2.0,
        "to_world": mi.ScalarTransform4f().look_at(origin=camera.centre.tolist(), target=[0, 0, 0], up=[0, 1, 0]),
        "film": film,
        "sampler": {"type": "stratified", "sample_count": samples},
    }
