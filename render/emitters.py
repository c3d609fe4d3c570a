"""The lights as Mitsuba emitters."""

from __future__ import annotations

import math
from types import ModuleType
from typing import TYPE_CHECKING, assert_never

import numpy as np

from conespot.render import spectral
from conespot.scene import Pose, Scene, fundus
from conespot.scene.beam import BeamProfile, CyclesBeam, HardBeam, LinearBeam, TabulatedBeam
from conespot.scene.pose import Array
from conespot.scene.power import Power

if TYPE_CHECKING:
    from mitsuba import ScalarTransform4f

#: lengths are mm: an intensity [W/sr] over a distance squared [mm2] is an irradiance a million times too small
_PER_M2 = 1e6
#: side of the beam profile's texture: bilinear lookup then follows a smoothstep to 1.5e-6 of the axial intensity
_PROFILE = 2048


def spotlight(mi: ModuleType, scene: Scene) -> dict[str, object]:
    """The `spot` emitter with the scene's beam profile and the axial intensity of 1 W, for radiances in W m-2 sr-1.

    Mitsuba's own falloff is linear in the angle. Any other profile is the emitter's texture, cut off at the half
    angle by the emitter itself, so a hard edge stays exact.
    """
    beam = scene.beam
    intensity = Power(value=1.0, convention=scene.power.convention).axial_intensity(beam)
    emitter = {
        "type": "spot",
        "intensity": spectral.emission(scene, scene.illumination, intensity * _PER_M2, 0.0),
        "cutoff_angle": math.degrees(beam.half_angle),
        "to_world": mi.ScalarTransform4f(),
    }
    match beam:
        case HardBeam():
            return {**emitter, "beam_width": math.degrees(beam.half_angle)}
        case LinearBeam():
            return {**emitter, "beam_width": math.degrees(beam.beam_width)}
        case CyclesBeam() | TabulatedBeam():
            profile = _profile_texture(mi, beam)
            return {**emitter, "beam_width": math.degrees(beam.half_angle), "texture": profile}
        case unknown:
            assert_never(unknown)


def _profile_texture(mi: ModuleType, beam: BeamProfile) -> dict[str, object]:
    """The profile over the square of tangents +-tan(half angle) that `spot` projects its texture onto."""
    # a quarter of it, which the others mirror
    t = (np.arange(_PROFILE // 2) + 0.5) / _PROFILE * 2.0 * math.tan(beam.half_angle)
    quarter = beam.intensity(1.0 / np.sqrt(1.0 + t[:, None] ** 2 + t[None, :] ** 2)).astype(np.float32)
    bitmap = mi.Bitmap(np.pad(quarter, ((_PROFILE // 2, 0), (_PROFILE // 2, 0)), mode="symmetric")[..., None])
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear", "wrap_mode": "clamp"}


def aim(mi: ModuleType, apex: Array, axis: Array) -> ScalarTransform4f:
    """The emitter-to-world transform of a spotlight at `apex` `[3]` [mm] along the unit `axis` `[3]`."""
    up = np.eye(3)[np.argmin(np.abs(axis))]
    return mi.ScalarTransform4f().look_at(origin=apex.tolist(), target=(apex + axis).tolist(), up=up.tolist())


def ambient(scene: Scene) -> dict[str, object]:
    """The microscope's light: a collimated emitter with the stated irradiance [W/m2] across its beam."""
    light = scene.ambient
    irradiance = spectral.emission(scene, light.illumination, light.irradiance, fundus.VITREOUS_LENGTH)
    return {"type": "directional", "direction": (-light.towards).tolist(), "irradiance": irradiance}


def through_water(scene: Scene, pose: Pose, axis: Array) -> list[float]:
    """Values of a spotlight's spectrum behind the vitreous between tip and retina, taken along the axis.

    Over a patch the way differs by a few tenths of a millimetre, at 940 nm by less than 1 % of the light.
    """
    hit = scene.surface.intersect(scene.eye, pose.apex, axis)
    intensity = Power(value=1.0, convention=scene.power.convention).axial_intensity(scene.beam)
    return spectral.emitted(scene.illumination, intensity * _PER_M2, float(np.linalg.norm(hit - pose.apex)))
