"""A stage: the camera's picture of the retina in one light, as a Mitsuba scene that is loaded once and updated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from conespot.render import globe, kernel, spectral, wavefront
from conespot.render.reflectance import Reflectance
from conespot.render.retina_mesh import retina_mesh
from conespot.render.tile import Crop
from conespot.scene import Scene
from conespot.scene.illumination import Light
from conespot.scene.spectrum import Curve

Image = NDArray[np.float32]

#: samples traced in one pass
PASS = 2**23


class Stage:
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
        like: Stage | None = None,
    ) -> None:
        """Load it. `like` is another stage of the same scene, whose retina is shared where the light plays no part."""
        mi, dr, chosen = kernel.load()
        self._mi, self._vectorized = mi, chosen.vectorized
        self._columns = scene.camera.shape[1]
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
            # without the robust test one ray in a million slips between two triangles and leaves its pixel 6 % dark
            settings = {"type": "scene", "embree_use_robust_intersections": True, "integrator": integrator}
            self._scenes.append(mi.load_dict({**settings, "sensor": sensor, **everything}))
        self._parameters = [mi.traverse(loaded) for loaded in self._scenes]

    def update(self, values: Mapping[str, Any]) -> None:
        """Set parameters of the Mitsuba scene; they take effect with the next rendering."""
        for parameters in self._parameters:
            for key, value in values.items():
                parameters[key] = value

    def render(self, crop: Crop, samples: int, seed: int) -> Image:
        """The crop's radiance `[h, w, C]`, in bands of rows that bound the memory whatever the frame."""
        image = np.zeros((crop.height, crop.width, self.channels), np.float32)
        rows = max(1, PASS // (max(crop.width, 1) * samples))
        for first in range(0, crop.height if crop.width else 0, rows):
            band = Crop(crop.row + first, crop.column, min(rows, crop.height - first), crop.width)
            values = self.pixels(band.pixels(self._columns), samples, seed)
            image[first : first + rows] = values.reshape(band.height, band.width, -1)
        return image

    def pixels(self, pixels: NDArray[np.uint32], samples: int, seed: int) -> Image:
        """The radiance `[N, C]` of the frame's pixels `[N]`, row * columns + column, ascending."""
        values = np.zeros((len(pixels), self.channels), np.float32)
        size = max(1, PASS // samples)
        for first in range(0, len(pixels), size):
            part = pixels[first : first + size]
            layers = [self._traced(i, part, samples, seed % 2**32) for i in range(len(self._scenes))]
            if layers:
                values[first : first + size, self._seen] = np.concatenate(layers, axis=-1)
        return values

    def _traced(self, scene: int, pixels: NDArray[np.uint32], samples: int, seed: int) -> Image:
        """What one of the Mitsuba scenes makes of the pixels `[N, channels of it]`."""
        loaded, parameters = self._scenes[scene], self._parameters[scene]
        if self._vectorized:
            parameters.update()
            return wavefront.trace(loaded, pixels, self._columns, samples, seed)
        # without a JIT the loop over samples must be Mitsuba's own, which knows rectangles alone
        values: list[Image] = []
        places = []
        for crop in Crop.covering(pixels, self._columns):
            parameters["sensor.film.crop_offset"] = [crop.column, crop.row]
            parameters["sensor.film.crop_size"] = [crop.width, crop.height]
            parameters.update()
            places.append(crop.pixels(self._columns))
            # the first pixel tells the rectangles' noise apart
            rendered = self._mi.render(loaded, spp=samples, seed=(seed + 7919 * int(places[-1][0])) % 2**32)
            values.append(np.asarray(rendered).reshape(crop.height * crop.width, -1))
        return np.concatenate(values)[np.argsort(np.concatenate(places))]


def _sensor(mi: Any, scene: Scene, channels: list[spectral.Channel], samples: int, near: float) -> dict[str, Any]:
    camera = scene.camera
    # Mitsuba orders the channels by their keys
    responses = {f"channel_{i:02d}": spectral.film_spectrum(channel.film) for i, channel in enumerate(channels)}
    film = {
        "type": "specfilm",
        "width": camera.shape[1],
        "height": camera.shape[0],
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
