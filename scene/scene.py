"""The scene: everything about the experiment but the pose."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, model_validator

from conespot.scene import fundus
from conespot.scene.beam import Beam, CyclesBeam
from conespot.scene.camera import Camera
from conespot.scene.dispersion import seen_light, size_sigma, wavelength_of_image
from conespot.scene.document import Document, find_document, is_file, merge, read_document
from conespot.scene.eye import Eye, Globe
from conespot.scene.illumination import Ambient, FlatBand, Illumination
from conespot.scene.model import Model, unknown_name
from conespot.scene.motion import AnyMotion, exposure_of
from conespot.scene.pose import Pose, cone_rays
from conespot.scene.power import Power
from conespot.scene.quantity import format_quantity
from conespot.scene.retina import Fundus, PhotoRetina, Retina, Spread
from conespot.scene.sensor import Sensor, Srgb8
from conespot.scene.spectrum import Curve
from conespot.scene.spotlights import RIGS, Instrument, Spotlights, spotlight_axes
from conespot.scene.storage import Storage
from conespot.scene.surface import AnySurface, Surface
from conespot.scene.text_file import at_home

#: the key of a scene's file that says how well its quantities are known
KNOWLEDGE = "knowledge"
#: by which a scene's retina may differ from that of the model eye that the camera looks into [mm]
_SAME_RETINA = 0.01


def _by_name(value: Any) -> dict[Any, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"cameras have names: write cameras: {{left: {{...}}, right: {{...}}}}, got {value!r}")
    return value


class Scene(Model):
    """Eye, camera, instrument, light and sensor: what both the renderer and a localizer may know."""

    eye: Eye = Eye()
    camera: Camera = Camera()
    instrument: Instrument = Instrument()
    spotlights: Spotlights = RIGS["single"]
    beam: Beam = CyclesBeam()
    power: Power = Power()
    illumination: Illumination = FlatBand()
    ambient: Ambient = Ambient()
    surface: AnySurface = Surface()
    retina: Retina = PhotoRetina()
    sensor: Sensor = Srgb8()
    storage: Storage = Storage()  #: of frames that come from outside; no rendering asks
    interreflection: Globe | None = None
    motion: AnyMotion = None
    #: by name, all that look at the same instant, of which `camera` is one: a stereo pair's left and right
    cameras: Annotated[dict[str, Camera], BeforeValidator(_by_name)] = Field({}, max_length=8)

    @model_validator(mode="before")
    @classmethod
    def _named_camera(cls, data: Any) -> Any:
        if not (isinstance(data, dict) and isinstance(data.get("camera"), str)):
            return data
        cameras = data.get("cameras")
        if not cameras:
            raise ValueError(
                f"camera: '{data['camera']}' would be one of cameras, and there are none; write them as"
                f" cameras: {{{data['camera']}: {{...}}}}, or here the camera's own keys"
            )
        if data["camera"] not in _by_name(cameras):
            raise unknown_name(data["camera"], [str(name) for name in cameras], "camera")
        return {**data, "camera": cameras[data["camera"]]}

    @model_validator(mode="after")
    def _fits(self) -> Scene:
        surface, radius = self.surface, self.eye.radius
        if self.cameras and self.camera not in self.cameras.values():
            raise ValueError(f"camera must be the name of one of cameras: {', '.join(self.cameras)}")
        for camera in [self.camera, *self.cameras.values()]:
            if camera.centre[2] <= 2.0 * radius * max(1.0, surface.semi_axes[2]):
                raise ValueError("camera.height must put the camera above the eye (more than twice eye.radius)")
            if not camera.is_plain and not _sees(camera, self.eye):
                checks = "look_at, tilt, principal_point and the pupil of optics"
                raise ValueError(f"camera: no ray of it meets the retina; check {checks}")
        return self

    @model_validator(mode="after")
    def _looks_into_its_own_eye(self) -> Scene:
        optics, cameras = self.camera.optics, self.cameras
        if any(camera.optics != optics for camera in cameras.values()):
            raise ValueError("cameras: all look into one eye; give each the same optics")
        if optics is None:
            return self
        own = np.array(optics.model.retina)
        if np.abs(self.eye.radius * np.array(self.surface.semi_axes) - own).max() > _SAME_RETINA:
            shape = " x ".join(f"{axis:.6g}" for axis in own)
            ratios = ", ".join(f"{ratio:.6g}" for ratio in own / own[2])
            raise ValueError(
                f"camera.optics: the retina of the {optics.eye} eye has semi-axes of {shape} mm;"
                f" write eye: {{radius: {format_quantity(own[2], 'length')}}} and surface: {{semi_axes: [{ratios}]}}"
            )
        if any(camera.centre[2] <= optics.top for camera in (self.camera, *cameras.values())):
            raise ValueError("camera.height must put the camera above the eye's optics")
        # a scene is frozen once it is validated: its cameras see at the light's own wavelength
        wavelength = self.effective_wavelength
        self.__dict__["camera"] = self.camera.seeing(wavelength)
        self.__dict__["cameras"] = {name: camera.seeing(wavelength) for name, camera in cameras.items()}
        return self

    @model_validator(mode="after")
    def _has_the_eye_in_focus(self) -> Scene:
        lowest = self.eye.radius * min(0.0, 1.0 - self.surface.semi_axes[2]) - self.surface.relief
        for camera in [self.camera, *self.cameras.values()]:
            if camera.lens is None:
                continue
            pupil = format_quantity(round(camera.pupil, 3), "length")
            if not lowest <= camera.lens.focus <= 2.0 * self.eye.radius - lowest:
                where = "behind" if camera.lens.focus < lowest else "in front of"
                raise ValueError(
                    f"camera.lens.focus: {format_quantity(camera.lens.focus, 'length')} is {where} the eye; give the"
                    f" height above the posterior pole, from 0 mm to {format_quantity(2.0 * self.eye.radius, 'length')}"
                )
            if camera.pupil == 0.0:
                continue
            if camera.pupil > camera.height:
                raise ValueError(
                    f"camera.lens: an entrance pupil of {pupil} is wider than the working distance is long"
                    f" (camera.height, {format_quantity(camera.height, 'length')})"
                )
            top = 2.0 * self.eye.radius if camera.optics is None else camera.optics.top
            if camera.centre[2] - camera.pupil / 2.0 * math.sin(camera.tilt) <= top:
                raise ValueError(f"camera.lens: an entrance pupil of {pupil} reaches into the eye; raise the camera")
            if not math.isfinite(camera.vergence):
                raise ValueError("camera.lens.focus: no ray of the camera meets that point; check pupil and tilt")
        return self

    @model_validator(mode="after")
    def _has_a_surface(self) -> Scene:
        surface, radius = self.surface, self.eye.radius
        for bump in surface.bumps:
            if np.hypot(bump.x, bump.y) >= radius:
                raise ValueError(f"the bump at ({bump.x:g}, {bump.y:g}) mm lies outside the eye")
        if surface.height_map is not None and surface.height_map.reach > math.pi / 2.0 * radius:
            raise ValueError("the height map reaches beyond the lower half of the eye")
        if surface.relief > radius / 2.0:
            raise ValueError(f"the surface rises or sinks by up to {surface.relief:g} mm, over half the eye's radius")
        if self.interreflection is not None and surface != Surface(bumps=surface.bumps):
            raise ValueError("interreflection is worked out in a sphere: leave semi_axes and height_map out of surface")
        if self.interreflection is not None and self.spread is not None:
            raise ValueError("interreflection and retina.spread: no rendering has both; leave one of them out")
        return self

    @model_validator(mode="after")
    def _smears_what_it_can(self) -> Scene:
        if self.interreflection is not None and (self.motion is not None or self.beam.source_diameter):
            key = "beam.source_diameter" if self.motion is None else "motion"
            raise ValueError(f"interreflection is worked out for a still point of light: leave {key} out")
        if self.motion is not None:
            if self.instrument.shaft is not None:
                raise ValueError("motion: a visible shaft would have to move too; leave instrument.shaft out")
            exposure_of(self.motion, self.sensor)
        return self

    @property
    def spread(self) -> Spread | None:
        """How light spreads under the retina, where it does."""
        return self.retina.spread if isinstance(self.retina, Fundus) else None

    def through(self, name: str) -> Scene:
        """The scene as another of its `cameras` sees it at the same instant. Raises KeyError for no such camera."""
        return self.model_copy(update={"camera": self.cameras[name]})

    @property
    def effective_wavelength(self) -> float:
        """Wavelength of the spotlights' light as the sensor sees it, over all its channels [nm].

        What the camera's rays and a localizer's forward model see at, where every wavelength goes its own way: that
        whose image is as large as the light's; without optics its centroid. From a living fundus light comes in the
        perifovea's colour.
        """
        light, optics = self._seen(fundus.SITES["perifovea"]), self.camera.optics
        if not light.integral() > 0.0:
            return self.illumination.spectrum.mean_wavelength
        return light.mean_wavelength if optics is None else wavelength_of_image(optics, self.camera.height, light)

    @property
    def image_size_sigma(self) -> float:
        """Standard deviation of the image's size, relative: through optics it changes with the retina's colour."""
        optics = self.camera.optics
        if optics is None or not self.retina.is_spectral:
            return 0.0
        places = [replace(site, melanin=m) for site in fundus.SITES.values() for m in fundus.MELANIN.values()]
        return size_sigma(optics, self.camera.height, [self._seen(place) for place in places])

    def _seen(self, place: fundus.Pigments) -> Curve:
        """The spotlights' light as the sensor sees it, from a place of a living fundus."""
        seen = place if self.retina.is_spectral else None
        return seen_light(self.illumination.spectrum, seen, self.camera.optics, self.sensor.responses)

    def sway(self, time: float = 0.0, seed: int = 0) -> NDArray[np.float64] | None:
        """A pose's `sway` `[K, 3]` [mm] at a `time` [s], for the `seed` of a tremor; None without motion."""
        return None if self.motion is None else self.motion.sway(time, exposure_of(self.motion, self.sensor), seed)

    def pose(self, apex: NDArray[np.float64], time: float = 0.0, seed: int = 0) -> Pose:
        """The pose of the tip at `apex` `[3]` [mm] at a `time` [s]; a tremor is another for another `seed`.

        Raises ValueError if it is outside the eye or in its wall.
        """
        if self.depth(apex) <= 0.0:
            raise ValueError(
                f"the tip at ({', '.join(f'{c:g}' for c in apex)}) mm is outside the eye"
                f" (radius {self.eye.radius:g} mm)"
            )
        return Pose.through(apex, self.instrument.rcm, self.sway(time, seed))

    def depth(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """How far inside the surface points `[..., 3]` lie `[...]` [mm], along rays from the eye's centre.

        Negative outside.
        """
        offset = np.asarray(points, float) - self.eye.centre
        distance = np.linalg.norm(offset, axis=-1)
        if self.surface.is_sphere:
            return np.asarray(self.eye.radius - distance)
        away = np.where(distance[..., None] > 0.0, offset, [0.0, 0.0, -1.0])
        direction = away / np.linalg.norm(away, axis=-1, keepdims=True)
        return np.asarray(self.eye.radius - self.surface.displacement(self.eye, direction) - distance)

    def outline(self, pose: Pose, spotlight: int, points: int = 256) -> NDArray[np.float64]:
        """Where the edge of a spotlight's cone meets the surface `[points, 3]` [mm], as `cone_rays` counts round it."""
        axis = spotlight_axes(pose, self.spotlights)[spotlight]
        rays = cone_rays(axis, self.beam.half_angle, np.arange(points) * 2.0 * np.pi / points)
        return self.surface.intersect(self.eye, pose.apex, rays)


def _sees(camera: Camera, eye: Eye) -> bool:
    """Whether some of the camera's rays meet the eye."""
    rows, columns = camera.shape
    x, y = np.meshgrid(np.linspace(0.0, columns, 65), np.linspace(0.0, rows, 65))
    rays = camera.rays(np.stack([x, y], axis=-1))
    return bool(np.any(np.isfinite(eye.intersect(rays.origins, rays.directions))))


def read_scene(document: Document, *, at: tuple[str | int, ...] = ()) -> Scene:
    """The scene in a document: a mapping that may start from a `preset`. Raises InputError."""
    return expand(document, at).validate(Scene, at=at)


def expand(document: Document, at: tuple[str | int, ...]) -> Document:
    """The document with the mapping or preset name at `at` laid on the preset it names. Raises InputError."""
    data: Any = document.data
    for key in at:
        data = data[key]
    if isinstance(data, str):
        data = {"preset": data}
    if not isinstance(data, dict) or "preset" not in data:
        return document
    name = str(data["preset"])
    beside = document.folder / at_home(Path(name))
    path = beside if is_file(beside) else find_document(name, "scene", "presets", "scene preset")
    preset = _read_preset(path, path.stat().st_mtime_ns)
    full = merge(preset.data, {k: v for k, v in data.items() if k != "preset"}, Scene)
    for key in reversed(at):
        full = {str(key): full}
    lines = {**{(*at, *k): v for k, v in preset.lines.items() if k}, **document.lines}
    return Document(document.source, merge_at(document.data, full, at), lines, document.folder)


@functools.lru_cache(maxsize=16)
def _read_preset(path: Path, changed: int) -> Document:
    """The document as it was at that time; a sweep lays each of its combinations on the same one."""
    return without_knowledge(read_document(path))


def without_knowledge(document: Document) -> Document:
    """A scene's document without how well its quantities are known (`knowledge:`), which is for who localizes."""
    data = {key: value for key, value in document.data.items() if key != KNOWLEDGE}
    return replace(document, data=data)


def merge_at(data: dict[str, Any], new: dict[str, Any], at: tuple[str | int, ...]) -> dict[str, Any]:
    """`data` with the value at `at` replaced by the one in `new`."""
    if not at:
        return new
    key = str(at[0])
    return {**data, key: merge_at(data.get(key, {}), new[key], at[1:]) if at[1:] else new[key]}


def load_scene(name: str | Path) -> Scene:
    """A scene by preset name (`paper`, `paper-code`) or from a YAML file. Raises InputError."""
    return read_scene(without_knowledge(read_document(find_document(str(name), "scene", "presets", "scene preset"))))
