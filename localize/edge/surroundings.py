"""What a frame shows far around the patches: the retina in ambient light, where light from under it has faded."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.settings import EDGE
from conespot.localize.image import Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.view import outline

Array = NDArray[np.float64]


def surroundings(frame: Frame, estimate: Estimate) -> Array:
    """Median signal `[C]` [white] on rings around the patches, or of the frame where they are not in it."""
    scene = estimate.scene
    rings = []
    for k in range(len(scene.spotlights)):
        curve = outline(estimate, k, EDGE.around_points)
        middle = curve.mean(axis=0)
        rings += [middle + factor * (curve - middle) for factor in EDGE.around]
    pixels = np.concatenate(rings)
    side = np.array(scene.camera.shape[::-1])
    pixels = pixels[np.all((pixels > 0.0) & (pixels < side), axis=1) & scene.camera.shows(pixels)]
    if len(pixels) < EDGE.fewest_points:
        every = slice(None, None, max(1, frame.side // 64))
        return np.asarray(np.median(frame.light(every, every)[0], axis=(0, 1)), float)
    column, row = pixels.astype(int).T
    shown = [frame.light(slice(r, r + 1), slice(c, c + 1))[0][0, 0] for r, c in zip(row, column, strict=True)]
    return np.asarray(np.median(shown, axis=0), float)
