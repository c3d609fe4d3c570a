"""A scene in the words that stand beside every number: what somebody who reads a table must know it assumes."""

from __future__ import annotations

from conespot.scene.motion import exposure_of
from conespot.scene.quantity import format_quantity
from conespot.scene.scene import Scene


def assumed(scene: Scene) -> dict[str, str]:
    """Radius of the eye, edge of the beam, power convention, transfer of the sensor, and surface, in words by name.

    The radius comes with the optics that the eye is seen through, the transfer with the lens and with what moves, if
    there are any.
    """
    transfer = scene.sensor.words
    if scene.camera.lens is not None:
        transfer += f", behind a lens: {scene.camera.lens.words(scene.camera.height)}"
    if scene.motion is not None:
        transfer += f", {scene.motion.words} during {1e3 * exposure_of(scene.motion, scene.sensor):g} ms"
    radius = format_quantity(scene.eye.radius, "length")
    if scene.camera.optics is not None:
        radius += f" seen through {scene.camera.optics.words}, localized at {scene.effective_wavelength:.0f} nm"
    return {
        "radius": radius,
        "edge": scene.beam.words,
        "power_convention": scene.power.words,
        "transfer": transfer,
        "surface": scene.surface.words,
    }
