"""Which pixels get the light of the whole lens: the iris cuts into that of others, out of focus no disc any more."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.scene.camera import Camera
from conespot.scene.defocus import rim

Array = NDArray[np.float64]
#: directions in which the field's rim is found, and halvings of the way there: a frame of 4,000 px to a quarter of one
_AROUND, _HALVINGS = 72, 14


def seen_whole(camera: Camera, pixels: ArrayLike) -> NDArray[np.bool_]:
    """Which pixel coordinates `[..., 2]` [px] get the light of all the lens' entrance pupil: `[...]`.

    Of the others the iris stops a part, so that what is out of focus there is no disc. All do where no place in the
    frame does, and where there is no iris or the lens is a pinhole.
    """
    q = np.asarray(pixels, float)
    if camera.optics is None or camera.pupil == 0.0:
        return np.ones(q.shape[:-1], bool)
    middle, radii = _field(camera)
    if not radii.any():
        return np.ones(q.shape[:-1], bool)
    off = q - middle
    turn = np.arctan2(off[..., 1], off[..., 0])
    rims = np.interp(turn, _turns(), radii, period=2.0 * math.pi)
    return np.asarray(np.hypot(off[..., 0], off[..., 1]) < rims)


def _turns() -> Array:
    return np.arange(_AROUND, dtype=np.float64) * (2.0 * math.pi / _AROUND)


@lru_cache(maxsize=16)
def _field(camera: Camera) -> tuple[Array, Array]:
    """A pixel `[2]` [px], that which sees the pole, and how far around it pixels are seen whole `[_AROUND]` [px]."""
    middle = camera.project(np.zeros(3))
    along = np.stack([np.cos(_turns()), np.sin(_turns())], axis=1)
    places = rim(camera.pupil / 2.0)[:, None]
    near, far = np.zeros(_AROUND), np.full(_AROUND, math.hypot(*camera.shape))
    for _ in range(_HALVINGS):
        half = 0.5 * (near + far)
        at = np.broadcast_to(middle + half[:, None] * along, (len(places), _AROUND, 2))
        whole = np.isfinite(camera.rays(at, pupil=places).directions[..., 0]).all(axis=0)
        near, far = np.where(whole, half, near), np.where(whole, far, half)
    return middle, near
