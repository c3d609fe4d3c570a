"""The lights as Mitsuba emitters."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from scene import Scene
from scene.beam import Beam, HardBeam, LinearBeam
from scene.illumination import Light
from scene.pose import Array
from scene.power import Power

#: lengths are mm: an intensity [W/sr] over a distance squared [mm2] is an irradiance a million times too small
_PER_M2 = 1e6
#: side of the beam profile's texture: bilinear lookup then follows a smoothstep to 1.5e-6 of the axial intensity
_PROFILE = 2048


def _spectrally_flat(total: float) -> dict[str, Any]:
    """What every emitter radiates: the film weighs each wavelength with the light's spectrum (see `response`)."""
    return {"type": "uniform", "value": total}


def response(light: Light) -> dict[str, Any]:
    """The film's response under a light [1/nm]: the light's own spectrum, whose integral is 1.

    Light and sensor enter an image only as their product. With the product in the film, whose response decides which
    wavelengths are sampled, a grey retina renders without any spectral noise.
    """
    curve = light.spectrum
    wavelengths, values = (", ".join(repr(float(x)) for x in column) for column in (curve.wavelengths, curve.values))
    return {"type": "irregular", "wavelengths": wavelengths, "values": values}


def spotlight(mi: Any, scene: Scene) -> dict[str, Any]:
    """The `spot` emitter with the scene's beam profile and the axial intensity of 1 W, for radiances in W m-2 sr-1.

    Mitsuba's own falloff is linear in the angle. Any other profile is the emitter's texture, cut off at the half
    angle by the emitter itself, so a hard edge stays exact.
    """
    beam = scene.beam
    intensity = Power(value=1.0, convention=scene.power.convention).axial_intensity(beam)
    emitter = {
        "type": "spot",
        "intensity": _spectrally_flat(intensity * _PER_M2),
        "cutoff_angle": math.degrees(beam.half_angle),
        "beam_width": math.degrees(beam.beam_width if isinstance(beam, LinearBeam) else beam.half_angle),
        "to_world": mi.ScalarTransform4f(),
    }
    if not isinstance(beam, (HardBeam, LinearBeam)):
        emitter["texture"] = _profile_texture(mi, beam)
    return emitter


def _profile_texture(mi: Any, beam: Beam) -> dict[str, Any]:
    """The profile over the square of tangents +-tan(half angle) that `spot` projects its texture onto."""
    t = ((np.arange(_PROFILE) + 0.5) / _PROFILE * 2.0 - 1.0) * math.tan(beam.half_angle)
    cos_angle = 1.0 / np.sqrt(1.0 + t[:, None] ** 2 + t[None, :] ** 2)
    bitmap = mi.Bitmap(beam.intensity(cos_angle).astype(np.float32)[..., None])
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear", "wrap_mode": "clamp"}


def aim(mi: Any, apex: Array, axis: Array) -> Any:
    """The emitter-to-world transform of a spotlight at `apex` `[3]` [mm] along the unit `axis` `[3]`."""
    up = np.eye(3)[np.argmin(np.abs(axis))]
    return mi.ScalarTransform4f().look_at(origin=apex.tolist(), target=(apex + axis).tolist(), up=up.tolist())


def ambient(scene: Scene) -> dict[str, Any]:
    """The microscope's light: a collimated emitter with the stated irradiance [W/m2] across its beam."""
    light = scene.ambient
    sideways = math.sin(light.tilt)
    direction = [
        -sideways * math.cos(light.azimuth),
        -sideways * math.sin(light.azimuth),
        -math.cos(light.tilt),
    ]
    return {"type": "directional", "direction": direction, "irradiance": _spectrally_flat(light.irradiance)}
