"""What tells one fundus from another, and the grids that its maps lie on."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Map = NDArray[np.float32]

#: half the side of every map [mm]; beyond it the outermost texels continue
EXTENT = 8.0
#: texels of the pigment maps and of the vessel maps [mm]
COARSE = 0.02
FINE = 0.005


@dataclass(frozen=True)
class Anatomy:
    """What tells one eye from another: relative changes of the layers, vessels and disc."""

    disc_centre: tuple[float, float]  #: arc coordinates [mm]
    melanin: Map  #: relative, coarse
    blood: Map  #: relative, coarse
    epithelium: Map  #: relative, coarse
    disc: Map  #: coarse
    artery: Map  #: [um], fine
    vein: Map  #: [um], fine


def texel_centres(texel: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Arc coordinates x and y [mm] of the texel centres of a map."""
    n = round(2.0 * EXTENT / texel)
    ticks = (np.arange(n) + 0.5) * texel - EXTENT
    x, y = np.meshgrid(ticks, -ticks)
    return x, y


def smooth_noise(rng: np.random.Generator, n: int, scale: float) -> NDArray[np.float64]:
    """Gaussian noise `[n, n]` with features of about `scale` texels, mean 0 and deviation 1."""
    small = max(4, int(np.ceil(n / max(scale / 2.0, 1.0))) + 4)
    field = cv2.GaussianBlur(rng.standard_normal((small, small)), (0, 0), 1.0)
    field = cv2.resize(field, (n, n), interpolation=cv2.INTER_CUBIC)
    return np.asarray((field - field.mean()) / field.std())
