"""The paper's own camera, which sees what another camera saw."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from conespot.localize.published.detection import Contour
from conespot.scene import Camera, Scene

Array = NDArray[np.float64]


def as_the_paper_sees(outlines: Sequence[Contour], scene: Scene) -> tuple[list[Array], Scene]:
    """Outlines `[N, 2]` of pixel indices as the paper's pinhole sees them, and the scene with that pinhole.

    Eqs. 1-7 are written for a square camera straight above the pole. Where the scene's is another, each point goes
    along its ray to the eye's sphere and from there into a pinhole of the same pixels at the pole: a place on the
    retina is the same whoever sees it. Points whose ray misses the eye are NaN.
    """
    camera, eye = scene.camera, scene.eye
    columns = camera.shape[1]
    if camera.is_plain and camera.shape == (columns, columns):
        return [outline.astype(float) for outline in outlines], scene
    kept = {"sensor_width": camera.sensor_width, "focal_length": camera.focal_length, "height": camera.height}
    ideal = Camera(resolution=columns, **kept)
    seen = []
    for outline in outlines:
        rays = camera.rays(outline + 0.5)
        distance = eye.intersect(rays.origins, rays.directions)
        seen.append(ideal.project(rays.origins + distance[..., None] * rays.directions) - 0.5)
    return seen, scene.model_copy(update={"camera": ideal})
