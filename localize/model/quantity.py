"""What of a scene may be free beside the pose: how each is read and written, and what of an image changes with it.

A quantity more is an entry of `QUANTITIES` and a field of `Knowns` that says how well it is known.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from conespot.localize.model.point_spread import lens_variance
from conespot.localize.model.smear import ENTRIES, way_covariance, with_way
from conespot.scene.document import InputError
from conespot.scene.lens import Lens
from conespot.scene.motion import Tremor
from conespot.scene.point_spread import WIDEST, GaussianSpread
from conespot.scene.scene import Scene

#: a softness below is a hard edge to every camera
_HARDEST = 1e-3


@dataclass(frozen=True)
class Quantity:
    """A number of the scene that a fit may estimate, in the unit held inside."""

    name: str
    read: Callable[[Scene], float | None]  #: its value; None where the scene has no such thing
    write: Callable[[Scene, float], Scene]  #: the scene with another value
    #: the beam's profile, how the image is spread (lens, core, motion), what the pixels see (surface, camera), or light
    #: that comes back from under the retina; in this order in the table, as in every Jacobian
    changes: Literal["beam", "spread", "sight", "glow"]
    step: float  #: of central differences of the light; of a spread's variance forwards, in which light is linear
    known: str  #: the field of `Knowns` that has its sigma
    per_unit: float = 1.0  #: the unit of that field in the one held inside
    unit: str = ""  #: of that field, as it is written
    power: int = 1  #: of the field in what is held inside: 2 for the variance of a width
    widens: float = 0.0  #: by how much the outline's angle off the axis grows with it [rad]
    remedy: str = ""  #: what a scene without it should say

    def value(self, scene: Scene) -> float:
        """Its value in a scene. Raises InputError where the scene has no such thing."""
        found = self.read(scene)
        if found is None:
            raise InputError(f"knowns: this scene has no {self.name}; {self.remedy}")
        return found


def _with_softness(scene: Scene, new: float) -> Scene:
    # a fit may look a little beyond the softest beam there is
    return scene.model_copy(update={"beam": scene.beam.model_copy(update={"blend": max(new, _HARDEST)})})


def _semi_axis(name: str, along: int) -> Quantity:
    """One of the retina's semi-axes [mm]: along x, y or z."""

    def read(scene: Scene) -> float:
        return scene.eye.radius * scene.surface.semi_axes[along]

    def write(scene: Scene, new: float) -> Scene:
        ratios = list(scene.surface.semi_axes)
        ratios[along] = new / scene.eye.radius
        surface = scene.surface.model_copy(update={"semi_axes": tuple(ratios)})
        return scene.model_copy(update={"surface": surface})

    return Quantity(name, read, write, changes="sight", step=1e-3, known="semi_axes_sigma_mm", unit="mm")


def _tilt(name: str, along: int) -> Quantity:
    """How far the camera's axis leans towards +x or +y [rad]; no azimuth, which an upright camera does not have."""

    def leaning(scene: Scene) -> list[float]:
        camera = scene.camera
        return [camera.tilt * math.cos(camera.azimuth), camera.tilt * math.sin(camera.azimuth)]

    def write(scene: Scene, new: float) -> Scene:
        lean = leaning(scene)
        lean[along] = new
        update = {"tilt": math.hypot(*lean), "azimuth": math.atan2(lean[1], lean[0])}
        return scene.model_copy(update={"camera": scene.camera.model_copy(update=update)})

    return Quantity(
        name,
        read=lambda scene: leaning(scene)[along],
        write=write,
        changes="sight",
        step=1e-4,
        known="camera_tilt_sigma_deg",
        per_unit=math.radians(1.0),
        unit="deg",
    )


def _with_spread(scene: Scene, **values: float) -> Scene:
    spread = scene.spread
    assert spread is not None
    new = scene.retina.model_copy(update={"spread": spread.model_copy(update=values)})
    return scene.model_copy(update={"retina": new})


def _log(value: float | None) -> float | None:
    return None if value is None else math.log(value)


def _with_blur(scene: Scene, new: float) -> Scene:
    # a variance that noise makes negative is none
    blur = GaussianSpread(sigma=min(math.sqrt(new), WIDEST / 5.0)) if new > 0.0 else None
    if blur is None and scene.camera.lens is None:
        return scene
    lens = (scene.camera.lens or Lens()).model_copy(update={"blur": blur})
    return scene.model_copy(update={"camera": scene.camera.model_copy(update={"lens": lens})})


def _with_core(scene: Scene, new: float) -> Scene:
    beam = scene.beam.model_copy(update={"source_diameter": math.sqrt(max(new, 0.0))})
    return scene.model_copy(update={"beam": beam})


def _way(entry: tuple[int, int]) -> Quantity:
    """An entry of the covariance of the tip's places during the exposure [mm^2].

    Of Gaussian velocities of deviation s along each axis, the entries of v v^T have the mean s^2 on the diagonal and
    variances of 2 s^4 there and s^4 beside it, and are not correlated (L. Isserlis, Biometrika 12, 1918).
    """
    name = "smear_" + "".join("xyz"[axis] for axis in entry)

    def read(scene: Scene) -> float | None:
        return float(way_covariance(scene)[entry]) if isinstance(scene.motion, Tremor) else None

    return Quantity(
        name,
        read,
        write=lambda scene, new: with_way(scene, entry, new),
        changes="spread",
        step=1e-6,
        known="smear_sigma_mm",
        per_unit=2.0**0.25 if entry[0] == entry[1] else 1.0,
        unit="mm",
        power=2,
        remedy="give it a motion of kind tremor",
    )


#: in the order in which they join the parameters of a fit
QUANTITIES = (
    Quantity(
        name="half_angle",
        read=lambda scene: scene.beam.half_angle,
        write=lambda scene, new: scene.model_copy(update={"beam": scene.beam.stretched(new)}),
        changes="beam",
        step=1e-6,
        known="half_angle_sigma_deg",
        per_unit=math.radians(1.0),
        unit="deg",
        widens=1.0,
    ),
    Quantity(
        name="softness",
        read=lambda scene: scene.beam.softness,
        write=_with_softness,
        changes="beam",
        step=1e-4,
        known="softness_sigma",
        remedy="describe its beam as a cycles beam",
    ),
    Quantity(
        # the variance: light is linear in it, and at a width of zero it has a slope
        name="blur",
        read=lens_variance,
        write=_with_blur,
        changes="spread",
        step=1e-6,
        known="blur_sigma_mm",
        unit="mm",
        power=2,
    ),
    Quantity(
        # the square of the diameter, for the same reasons
        name="core",
        read=lambda scene: scene.beam.source_diameter**2,
        write=_with_core,
        changes="spread",
        step=1e-6,
        known="core_sigma_mm",
        unit="mm",
        power=2,
    ),
    *map(_way, ENTRIES),
    Quantity(
        name="eye_radius",
        read=lambda scene: scene.eye.radius,
        write=lambda scene, new: scene.model_copy(update={"eye": scene.eye.model_copy(update={"radius": new})}),
        changes="sight",
        step=1e-3,
        known="eye_radius_sigma_mm",
        unit="mm",
    ),
    Quantity(
        name="camera_height",
        read=lambda scene: scene.camera.height,
        write=lambda scene, new: scene.model_copy(update={"camera": scene.camera.model_copy(update={"height": new})}),
        changes="sight",
        step=1e-3,
        known="camera_height_sigma_mm",
        unit="mm",
    ),
    _semi_axis("retina_width", 0),
    _semi_axis("retina_height", 1),
    _semi_axis("retina_length", 2),
    _tilt("camera_tilt_x", 0),
    _tilt("camera_tilt_y", 1),
    # both as logarithms: a factor is as likely as its inverse
    Quantity(
        name="deep_amount",
        read=lambda scene: _log(getattr(scene.spread, "amount", None)),
        write=lambda scene, new: _with_spread(scene, amount=math.exp(new)),
        changes="glow",
        step=1e-3,
        known="deep_amount_sigma",
        remedy="describe its retina as a fundus with a spread",
    ),
    Quantity(
        name="deep_length",
        read=lambda scene: _log(getattr(scene.spread, "length", None)),
        write=lambda scene, new: _with_spread(scene, length=math.exp(new)),
        changes="glow",
        step=1e-3,
        known="deep_length_sigma",
        remedy="describe its retina as a fundus with a spread",
    ),
)


def quantity(name: str) -> Quantity:
    """The quantity of that name. Raises KeyError if there is none."""
    return {each.name: each for each in QUANTITIES}[name]
