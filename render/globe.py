"""The rest of the eyeball, for light that the retina reflects more than once."""

from __future__ import annotations

import math
from types import ModuleType
from typing import TYPE_CHECKING, assert_never

import numpy as np

from conespot.render import spectral
from conespot.scene import Eye, Scene
from conespot.scene.eye import Globe
from conespot.scene.retina import Fundus, FundusSite, PhotoRetina, UniformRetina

if TYPE_CHECKING:
    from mitsuba import ScalarTransform4f

#: the wall lies this far outside the retina's mesh, relative to the radius, so that the mesh is what light meets
_BEHIND = 2e-4


def globe_shapes(mi: ModuleType, scene: Scene, globe: Globe) -> dict[str, object]:
    """The wall as a sphere seen from inside, and the pupil as a black disc in front of it."""
    eye = scene.eye
    wall = {
        "type": "sphere",
        "center": eye.centre.tolist(),
        "radius": eye.radius * (1.0 + _BEHIND),
        "flip_normals": True,
        "bsdf": {"type": "diffuse", "reflectance": _wall(scene)},
    }
    if globe.pupil == 0.0:
        return {"wall": wall}
    black = {"type": "diffuse", "reflectance": {"type": "uniform", "value": 0.0}}
    return {"wall": wall, "pupil": {"type": "disk", "to_world": _pupil_to_world(mi, eye, globe), "bsdf": black}}


def _pupil_to_world(mi: ModuleType, eye: Eye, globe: Globe) -> ScalarTransform4f:
    """Where the pupil's disc stands: as high as a sphere's cap of its width, facing the retina."""
    half = min(globe.pupil / 2.0, 0.95 * eye.radius)
    height = eye.radius + math.sqrt(eye.radius**2 - half**2)
    transform = mi.ScalarTransform4f().translate([0.0, 0.0, height])
    return (
        transform
        @ mi.ScalarTransform4f().rotate([1.0, 0.0, 0.0], 180.0)
        @ mi.ScalarTransform4f().scale([half, half, 1.0])
    )


def near_plane(scene: Scene) -> float:
    """Depth along the camera's axis [mm] behind which it sees: inside the eye, so that the wall does not hide it."""
    eye, camera = scene.eye, scene.camera
    height, width = camera.shape
    corners = camera.rays([(x, y) for x in (0, width) for y in (0, height)])
    ahead = -camera.axes[2]
    middle = float((eye.centre - camera.centre) @ ahead)
    along = middle / (corners.directions @ ahead)
    off = corners.origins + along[:, None] * corners.directions - eye.centre
    reach = float(np.max(np.linalg.norm(off, axis=-1)))  # of what it sees as deep as the eye's centre is
    # and how far beside that go those through its pupil's rim, from the top of the eye on
    beside = (abs(1.0 - camera.vergence * depth) for depth in (middle - eye.radius, middle))
    reach += camera.pupil / 2.0 * max(beside)
    top = eye.radius + math.sqrt(max(eye.radius**2 - reach**2, 0.0))
    return middle + eye.radius - 0.95 * top


def _wall(scene: Scene) -> dict[str, object]:
    match scene.retina:
        case UniformRetina(albedo=albedo) | PhotoRetina(mean=albedo):
            return {"type": "uniform", "value": albedo}
        case FundusSite(site=site):
            return spectral.reflectance_spectrum(site)
        case Fundus():
            return spectral.reflectance_spectrum("perifovea")
        case unknown:
            assert_never(unknown)
