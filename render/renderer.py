"""The renderer: one Mitsuba scene, loaded once, moved from pose to pose."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from conespot.render import emitters, kept, kernel, monte_carlo, shaft, spectral
from conespot.render.blur import Blur
from conespot.render.deep_light import DeepMaps
from conespot.render.rim import rim_pixels
from conespot.render.source import Source, outermost
from conespot.render.stage import Stage
from conespot.render.tile import Crop, Tile
from conespot.scene import Pose, Scene
from conespot.scene.identity import digest
from conespot.scene.illumination import Light
from conespot.scene.spectrum import Curve
from conespot.scene.spotlights import spotlight_axes

Image = NDArray[np.float32]

#: the ambient light is collimated and the texture smooth, so the background needs few samples a pixel
BACKGROUND_SAMPLES = 4
#: what varies with the wavelength needs more: it leaves 0.3 % of noise in white light where 4 leave 2.4 %. So does what
#: is seen through all of a lens' aperture
VARIED_BACKGROUND_SAMPLES = 16
#: the background belongs to the scene and not to a run: every run sees the same one
BACKGROUND_SEED = 0
#: what is rendered around a patch [px]
_MARGIN = 2


class Renderer:
    """Renders radiance: spotlight tiles at 1 W, and the background without spotlights.

    Light adds up and is linear in power, so a frame at any power is background + power * sum of tiles; the scene's
    own power value plays no part here, its convention does. `samples` a pixel are stratified over the pixel's area, and
    so are the few that pixels get where these leave no more noise than `noise`, relative to the pixel's radiance: what
    the sensor forgives by default, and 0 gives every pixel all of them. Pixels on a patch's hard edge, which need many
    more than any other, get `edge_samples` if that is not 0.
    Channels are those of the scene's sensor, in W m-2 sr-1 (or A m-2 sr-1 for an EMVA 1288 camera), or `responses`.
    Interreflection adds to the spotlights alone; the microscope's light comes in from outside and is seen once.
    Raises KernelError if Mitsuba cannot be used.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        samples: int = 16,
        edge_samples: int = 0,
        noise: float | None = None,
        responses: dict[str, Curve] | None = None,
    ) -> None:
        self.scene = scene
        self.samples, self.edge_samples = samples, edge_samples
        self.noise = monte_carlo.tolerance(scene.sensor.camera) if noise is None else noise
        self.rendered = 0  #: tiles and backgrounds rendered so far
        self._mi, _, self._kernel = kernel.load()
        self._blur = Blur(scene.camera, rays=self._kernel.vectorized)
        self.noise *= self._blur.steadiness  # it is rendered sharp and then spread
        self._shaft = scene.instrument.shaft
        self._responses = responses
        self._source = Source.of(scene)
        emitter = emitters.spotlight(self._mi, scene)
        self._lit = self._stage(emitter, scene.illumination, samples, self._shaft is not None)

    def tile(self, pose: Pose, spotlight: int, seed: int) -> Tile:
        """The radiance of one spotlight at 1 W; `seed` decides its Monte Carlo noise.

        It is that of the whole core, and the mean over an exposure in which the tip sways as the pose says.
        With interreflection the light reaches the whole frame, and so does the tile. Where the retina spreads light it
        reaches all but `deep_light.LOST` of what comes back.
        Raises ValueError where the scene moves and the pose does not say how: a still tile would look like any other.
        """
        if self.scene.motion is not None and pose.sway is None:
            raise ValueError("scene.motion: the pose does not move; take scene.pose(tip) in place of Pose.through")
        shape = self.scene.camera.shape
        crop = self.footprint(pose, spotlight) if self.scene.interreflection is None else Crop.whole(shape)
        axis = spotlight_axes(pose, self.scene.spotlights)[spotlight]
        self._lit.update({"light.to_world": emitters.aim(self._mi, pose.apex, axis)})
        if self._source is not None:
            self._source.aim(pose, axis)
        if spectral.has_water(self.scene):
            self._lit.update({"light.intensity.values": emitters.through_water(self.scene, pose, axis)})
        if self._shaft is not None:
            self._lit.update(shaft.placed(self._mi, self._shaft, pose))
        self.rendered += 1
        if self.scene.camera.optics is None:
            inside = crop.hull(self._reach(pose, spotlight), self._margin(pose, spotlight))
        else:  # other colours end between those that were asked
            inside = np.ones((crop.height, crop.width), bool)
        patch = Tile(crop, self._radiance(crop, inside, self._edge(crop, pose, spotlight), seed))
        if self._lit.glow is not None:
            patch = self._on_glow(patch, pose, spotlight)
        return self._blur.tile(patch)

    def _on_glow(self, patch: Tile, pose: Pose, spotlight: int) -> Tile:
        """The tile of what comes back where it falls, with the deep light in it and around it."""
        assert self._lit.glow is not None
        camera = self.scene.camera
        rim = camera.project(self._lit.glow.deep.outline(pose, spotlight))
        crop = Crop.around(np.concatenate([rim, patch.crop.corners]), camera.shape, _MARGIN)
        if camera.optics is not None and not np.isfinite(rim).all():
            crop = Crop.whole(camera.shape)
        radiance = self._lit.glowing(crop, self._lit.glow.deep.spotlight(pose, spotlight))
        if self._blur.in_rays:
            radiance = self._blur.smoothed(radiance)
        row, column = patch.crop.row - crop.row, patch.crop.column - crop.column
        radiance[row : row + patch.crop.height, column : column + patch.crop.width] += patch.radiance
        return Tile(crop, radiance)

    @property
    def _few_first(self) -> bool:
        """Whether a pilot of few samples says where all of them are needed."""
        return self.samples > monte_carlo.PILOT and self.noise > 0.0 and self._lit.tells_noise

    def _edge(self, crop: Crop, pose: Pose, spotlight: int) -> NDArray[np.bool_]:
        """Which pixels `[h, w]` need other samples than a pilot's or the rest's: a patch's hard edge."""
        pixels = crop.pixels(self.scene.camera.shape[1])
        # the few samples of a pixel that the edge barely enters may all miss it, and then show no noise either
        if pixels.size and (self.edge_samples > self.samples or self._few_first):
            edge = np.isin(pixels, rim_pixels(self.scene, pose, spotlight, self._blur.reach))
        else:
            edge = np.zeros(pixels.shape, bool)
        return edge.reshape(crop.height, crop.width)

    def _radiance(self, crop: Crop, inside: NDArray[np.bool_], edge: NDArray[np.bool_], seed: int) -> Image:
        """The crop `[h, w, C]` by few samples, and by all of them where few leave too much noise and on the edge.

        Light is `inside` `[h, w]` alone.
        """
        doubt = np.zeros_like(edge)
        pixels = crop.pixels(self.scene.camera.shape[1]).reshape(edge.shape)
        if self._few_first and edge.size:
            halves = np.zeros((*edge.shape, 2, self._lit.channels), np.float32)
            halves[inside] = self._lit.halves(pixels[inside], monte_carlo.PILOT, ~seed)
            radiance, doubt = monte_carlo.mean_and_doubt(halves, self.noise)
        else:
            radiance = self._lit.render(crop, self.samples, seed)
        for where, samples in ((doubt & ~edge, self.samples), (edge, max(self.edge_samples, self.samples))):
            if where.any():
                radiance[where] = self._lit.pixels(pixels[where], samples, seed)
        return radiance

    def footprint(self, pose: Pose, spotlight: int) -> Crop:
        """The pixels a spotlight can reach; deep light, and what the lens does not resolve, lie around them."""
        camera, reach = self.scene.camera, self._reach(pose, spotlight)
        if camera.optics is not None and not np.isfinite(reach).all():
            return Crop.whole(camera.shape)  # an outline that no ray meets may run around all that the pupil shows
        return Crop.around(reach, camera.shape, self._margin(pose, spotlight))

    def _margin(self, pose: Pose, spotlight: int) -> int:
        """What is rendered around its outline [px]: more where that is out of focus."""
        scene = self.scene
        if scene.camera.pupil == 0.0:
            return _MARGIN + self._blur.reach
        points, light = self._reached(pose, spotlight), scene.illumination.spectrum
        blurred = [scene.camera.confusion(points, wavelength) for wavelength in (light.low, light.high)]
        return _MARGIN + self._blur.reach + math.ceil(np.nanmax(blurred, initial=0.0))

    def _reach(self, pose: Pose, spotlight: int) -> NDArray[np.float64]:
        """Its outline `[N, 2]` in the image [px]."""
        camera, points = self.scene.camera, self._reached(pose, spotlight)
        if camera.optics is None:
            return camera.project(points)
        light = self.scene.illumination.spectrum  # whose colours end in different places
        return np.concatenate([camera.seeing(w).project(points) for w in (light.low, light.high)])

    def _reached(self, pose: Pose, spotlight: int) -> NDArray[np.float64]:
        """Its cone's outline on the retina `[N, 3]` [mm], moved along the rays by what bumps may add or hide."""
        scene = self.scene
        return np.concatenate([self._cone(one, spotlight) for one in outermost(scene, pose, spotlight)])

    def _cone(self, pose: Pose, spotlight: int) -> NDArray[np.float64]:
        """The outline `[N, 3]` [mm] of a still point's cone, moved along the rays by what bumps may add or hide."""
        rays = self.scene.outline(pose, spotlight) - pose.apex
        length, relief = np.linalg.norm(rays, axis=-1, keepdims=True), self.scene.surface.relief
        # three times the relief covers any incidence up to 70 deg
        around = (-3.0 * relief, 0.0, 3.0 * relief) if relief else (0.0,)
        reach = np.concatenate([length + more for more in around])
        return np.asarray(pose.apex + np.tile(rays / length, (len(around), 1)) * np.maximum(reach, 0.0))

    def background(self, pose: Pose | None = None) -> Image:
        """The radiance `[H, W, C]` [W m-2 sr-1] in ambient light alone. With a visible shaft it needs the pose."""
        if self._shaft is None or pose is None:
            return self._empty_background
        crop = shaft.shaft_crop(self.scene, self._shaft, pose)
        if crop.height == 0 or crop.width == 0:
            return self._empty_background
        shaded = self._ambient(with_shaft=True)
        shaded.update(shaft.placed(self._mi, self._shaft, pose))
        frame = self._kept_background(sharp=True).copy()
        frame[crop.slices] = self._in_ambient(shaded, crop, self.samples)
        self.rendered += 1
        return frame if self._blur.is_none else self._blur.frame(frame)

    @functools.cached_property
    def _empty_background(self) -> Image:
        return self._kept_background(sharp=self._blur.is_none)

    def _kept_background(self, *, sharp: bool) -> Image:
        """Kept on disk under all that it shows: not the instrument, nor its light. `sharp` is before it is spread."""
        scene, (rows, columns) = self.scene, self.scene.camera.shape
        channels = spectral.channels(scene, scene.ambient.illumination, self._responses, from_outside=True)
        shown = scene.model_dump(include={"eye", "camera", "surface", "retina", "ambient"})
        films = [(channel.film.wavelengths.tolist(), channel.film.values.tolist()) for channel in channels]
        how = (self._kernel.variant, self._kernel.llvm, self._background_samples, BACKGROUND_SEED, sharp)
        address = digest([repr(part) for part in (shown, films, how, kept.made_by())])

        def render() -> Image:
            frame = self._rendered_background()
            return frame if sharp else self._blur.frame(frame)

        return kept.kept(address, (rows, columns, len(channels)), render)

    def _rendered_background(self) -> Image:
        crop = Crop.whole(self.scene.camera.shape)
        self.rendered += 1
        frame = self._in_ambient(self._ambient(with_shaft=False), crop, self._background_samples)
        frame.flags.writeable = False
        return frame

    def _in_ambient(self, stage: Stage, crop: Crop, samples: int) -> Image:
        frame = stage.render(crop, samples, BACKGROUND_SEED)
        if self._deep_ambient is not None:
            frame += stage.glowing(crop, self._deep_ambient, once=True)
        return frame

    @functools.cached_property
    def _deep_ambient(self) -> DeepMaps | None:
        """The microscope's light that went through the tissue."""
        glow = self._ambient(with_shaft=False).glow
        return None if glow is None else glow.deep.ambient()

    @property
    def _background_samples(self) -> int:
        varied = self.scene.retina.is_spectral or self.scene.camera.pupil > 0.0
        return VARIED_BACKGROUND_SAMPLES if varied else BACKGROUND_SAMPLES

    @functools.lru_cache(maxsize=2)  # noqa: B019 - a renderer lives as long as its process
    def _ambient(self, with_shaft: bool) -> Stage:
        samples = self.samples if with_shaft else self._background_samples
        emitter = emitters.ambient(self.scene)
        return self._stage(emitter, self.scene.ambient.illumination, samples, with_shaft, like=self._lit)

    def _stage(
        self, emitter: dict[str, object], light: Light, samples: int, with_shaft: bool, like: Stage | None = None
    ) -> Stage:
        """The spotlights' stage, or one `like` it in ambient light, which sees no interreflection."""
        return Stage(
            self.scene,
            emitter,
            light,
            samples=samples,
            shapes=shaft.shaft_shapes(self._mi, self._shaft) if with_shaft and self._shaft is not None else {},
            responses=self._responses,
            closed=like is None,
            source=self._source if like is None else None,
            blur=self._blur.in_rays if like is None else None,
            like=like,
        )
