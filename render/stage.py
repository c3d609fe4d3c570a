"""A stage: the camera's picture of the retina in one light, as a Mitsuba scene that is loaded once and updated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from conespot.render import globe, kernel, spectral, wavefront
from conespot.render.deep_light import DeepMaps
from conespot.render.glow import Glow
from conespot.render.rays import RayGenerator
from conespot.render.reflectance import Reflectance
from conespot.render.retina_mesh import retina_mesh
from conespot.render.retina_sphere import on_sphere, retina_sphere
from conespot.render.source import Source
from conespot.render.tile import Crop
from conespot.scene import Scene
from conespot.scene.illumination import Light
from conespot.scene.retina import Fundus
from conespot.scene.spectrum import Curve

if TYPE_CHECKING:
    from mitsuba import Scene as MitsubaScene
    from mitsuba import Shape

Image = NDArray[np.float32]

#: samples traced in one pass
PASS = 2**23
#: pixels that deep light is read for at once
_GLOWING = 2**19


class Stage:
    """The retina in one light, seen by a film with the sensor's channels.

    The JIT variants evaluate a spectral map at every sampled wavelength. The scalar one cannot, so there each channel
    is a Mitsuba scene of its own, with the map averaged over the channel's band: the same for light reflected once.
    """

    def __init__(
        self,
        scene: Scene,
        emitter: Mapping[str, object],
        light: Light,
        *,
        samples: int,
        shapes: Mapping[str, object],
        responses: dict[str, Curve] | None = None,
        closed: bool = False,
        source: Source | None = None,
        blur: tuple[float, float] | None = None,
        like: Stage | None = None,
    ) -> None:
        """Load it. `blur` is what the rays are spread by across and down [px].

        `like` is another stage of the same scene, whose retina is shared where the light plays no part.
        """
        mi, _, chosen = kernel.load()
        self._mi, self._vectorized = mi, chosen.vectorized
        self._columns = scene.camera.shape[1]
        if not chosen.vectorized and scene.camera.pupil > 0.0:
            raise kernel.KernelError(
                "a lens with an aperture needs a JIT variant of Mitsuba, and the scalar one is in use;"
                " `campaign doctor` says why"
            )
        if not (chosen.vectorized or scene.camera.is_plain):
            raise kernel.KernelError(
                "a camera that is aslant, distorts, or has a principal point or oblong pixels needs a JIT variant of"
                " Mitsuba, and the scalar one is in use; `campaign doctor` says why"
            )
        if not chosen.vectorized and source is not None:
            raise kernel.KernelError(
                "motion and beam.source_diameter need a JIT variant of Mitsuba, and the scalar one is in use;"
                " `campaign doctor` says why"
            )
        self._source = source
        self._reflectance = Reflectance(scene.retina)
        channels = spectral.channels(scene, light, responses, from_outside=like is not None)
        self.channels = len(channels)
        apart = self._reflectance.is_spectral_map and not chosen.vectorized
        # a channel whose filter blocks all of the light stays black; Mitsuba could not sample a wavelength for it
        self._seen = [i for i, channel in enumerate(channels) if channel.film.integral() > 0.0]
        grey = [channels[i].film.integral() for i in self._seen]
        self._grey = grey if self._reflectance.is_grey else None
        self._scenes: list[MitsubaScene] = []
        self.retina: Shape | None = None
        walls = scene.interreflection if closed else None
        self.transport: wavefront.Transport = "path" if walls is not None else "direct"
        if self._vectorized and walls is None and scene.surface.is_sphere and not shapes:
            self.transport = "unblocked"
        begin_inside = self.transport != "direct" and scene.camera.optics is None
        near = globe.near_plane(scene) if begin_inside else scene.camera.height / 1000.0
        self._rays = RayGenerator(scene.camera, near, blur) if self._vectorized else None
        for group in [[channels[i]] for i in self._seen] if apart else [[channels[i] for i in self._seen]]:
            if not group:
                continue
            if apart or like is None or like.retina is None or like.transport != self.transport:
                self.retina = self._retina(scene, group[0].film if apart else None)
            else:
                self.retina = like.retina
            integrator: dict[str, object] = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0}
            everything = {"retina": self.retina, "light": dict(emitter), **shapes}
            if walls is not None:
                everything.update(globe.globe_shapes(mi, scene, walls))
                depth = walls.bounces + 1
                integrator = {"type": "path", "max_depth": depth, "rr_depth": depth}
            sensor = _sensor(mi, scene, group, samples, near)
            # without the robust test one ray in a million slips between two triangles and leaves its pixel 6 % dark
            settings = {"type": "scene", "embree_use_robust_intersections": True, "integrator": integrator}
            self._scenes.append(mi.load_dict({**settings, "sensor": sensor, **everything}))
        self._parameters = [mi.traverse(loaded) for loaded in self._scenes]
        self.glow = None
        if isinstance(scene.retina, Fundus) and scene.retina.spread is not None and self.retina is not None:
            films = [channels[i].film for i in self._seen]
            self.glow = Glow(scene, scene.retina, self._scenes[0], self.retina, self._rays, films)

    @property
    def tells_noise(self) -> bool:
        """Whether `halves` tells how noisy a rendering is: light reflected once in a JIT variant."""
        return self._vectorized and self.transport != "path"

    def _retina(self, scene: Scene, band: Curve | None) -> Shape:
        """The Mitsuba shape: a sphere where it may be one, else a mesh."""
        mi, dr, _ = kernel.load()
        texture = self._reflectance.texture(mi, dr, band)
        if self.transport != "unblocked":
            return retina_mesh(mi, scene, mi.load_dict(self._reflectance.bsdf(mi, texture)))
        if not self._reflectance.is_even:
            texture = on_sphere(mi, dr, texture, scene.eye)
        return mi.load_dict(retina_sphere(scene.eye, self._reflectance.bsdf(mi, texture)))

    def update(self, values: Mapping[str, object]) -> None:
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
            layers = [self._traced(i, part, samples, seed) for i in range(len(self._scenes))]
            if layers:
                values[first : first + size, self._seen] = np.concatenate(layers, axis=-1)
        return values

    def halves(self, pixels: NDArray[np.uint32], samples: int, seed: int) -> Image:
        """The radiance `[N, 2, C]` of pixels by each half of the samples alone, where the stage `tells_noise`."""
        values = np.zeros((len(pixels), 2, self.channels), np.float32)
        size = PASS // samples
        for first in range(0, len(pixels) if self._seen else 0, size):
            part = pixels[first : first + size]
            values[first : first + size, :, self._seen] = self._wavefront(part, samples, seed, halves=True)
        return values

    def glowing(self, crop: Crop, maps: DeepMaps, *, once: bool = False) -> Image:
        """The crop's radiance `[h, w, C]` of deep light alone, where the retina has a `glow`: see `Glow.seen`."""
        assert self.glow is not None
        self._parameters[0].update()
        image = np.zeros((crop.height, crop.width, self.channels), np.float32)
        flat, pixels = image.reshape(-1, self.channels), crop.pixels(self._columns)
        for first in range(0, len(pixels), _GLOWING):
            part = slice(first, first + _GLOWING)
            flat[part, self._seen] = self.glow.seen(pixels[part], maps, once=once)
        return image

    def _wavefront(
        self,
        pixels: NDArray[np.uint32],
        samples: int,
        seed: int,
        halves: bool = False,
    ) -> Image:
        assert self._rays is not None
        self._parameters[0].update()
        return wavefront.trace(
            self._scenes[0],
            self._rays,
            pixels,
            self._columns,
            samples,
            seed % 2**32,
            transport=self.transport,
            source=self._source,
            grey=self._grey,
            halves=halves,
        )

    def _traced(self, scene: int, pixels: NDArray[np.uint32], samples: int, seed: int) -> Image:
        """What one of the Mitsuba scenes makes of the pixels `[N, channels of it]`."""
        if self._vectorized:
            return self._wavefront(pixels, samples, seed)
        loaded, parameters = self._scenes[scene], self._parameters[scene]
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


def _sensor(
    mi: ModuleType, scene: Scene, channels: list[spectral.Channel], samples: int, near: float
) -> dict[str, object]:
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
