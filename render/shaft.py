"""The needle's shaft: it hides retina from the camera and casts its shadow in the ambient light."""

from __future__ import annotations

import math
from types import ModuleType

import numpy as np

from conespot.render.tile import Crop
from conespot.scene import Pose, Scene
from conespot.scene.pose import Array
from conespot.scene.spotlights import Shaft


def shaft_shapes(mi: ModuleType, shaft: Shaft) -> dict[str, object]:
    """An open cylinder and the cap that faces the retina, to be placed by `placed`."""
    bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "uniform", "value": shaft.albedo}}}
    return {
        "shaft": {"type": "cylinder", "bsdf": bsdf},
        "shaft_end": {"type": "disk", "bsdf": bsdf},
    }


def placed(mi: ModuleType, shaft: Shaft, pose: Pose) -> dict[str, object]:
    """Parameters that move the shapes of `shaft_shapes` to a pose."""
    end, far = _ends(shaft, pose)
    radius = shaft.diameter / 2.0
    up = np.eye(3)[np.argmin(np.abs(pose.axis))]
    frame = mi.ScalarTransform4f().look_at(origin=end.tolist(), target=far.tolist(), up=up.tolist())
    return {
        "shaft.to_world": frame @ mi.ScalarTransform4f().scale([radius, radius, shaft.length]),
        "shaft_end.to_world": frame @ mi.ScalarTransform4f().scale([radius, radius, 1.0]),
    }


def shaft_crop(scene: Scene, shaft: Shaft, pose: Pose) -> Crop:
    """The part of the frame where the shaft or its shadow can be seen."""
    end, far = _ends(shaft, pose)
    rim = shaft.diameter / 2.0 * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    # where it leaves the camera's sight is found to a third of a millimetre
    body = np.concatenate([p + rim for p in np.linspace(end, far, max(64, math.ceil(3.0 * shaft.length)))])
    shadow = scene.surface.intersect(scene.eye, body, -scene.ambient.towards)
    shadow = shadow[np.all(np.isfinite(shadow), axis=1)]
    seen, camera = np.concatenate([body, shadow]), scene.camera
    return Crop.around(camera.project(seen), camera.shape, 2.0 + np.nanmax(camera.confusion(seen), initial=0.0))


def _ends(shaft: Shaft, pose: Pose) -> tuple[Array, Array]:
    end = pose.apex - shaft.setback * pose.axis
    return end, end - shaft.length * pose.axis
