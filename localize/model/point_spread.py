"""How wide a lens spreads a point: the one number of it that an edge shows."""

from __future__ import annotations

from typing import assert_never

import numpy as np

from conespot.scene.point_spread import GaussianSpread, PointSpread, TabulatedSpread
from conespot.scene.scene import Scene


def variance_of(spread: PointSpread) -> float:
    """Variance of a point spread along an axis [mm^2]."""
    match spread:
        case None:
            return 0.0
        case GaussianSpread():
            return spread.sigma**2
        case TabulatedSpread():
            r = np.linspace(0.0, spread.radii[-1], 4001)
            v = np.interp(r, spread.radii, spread.values)
            return float(np.sum(v * r**3) / (2.0 * np.sum(v * r)))
        case unknown:
            assert_never(unknown)


def lens_variance(scene: Scene) -> float:
    """Variance of the lens' residual blur along an axis [mm^2], where the eye's pole is seen."""
    return 0.0 if scene.camera.lens is None else variance_of(scene.camera.lens.blur)
