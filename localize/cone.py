"""`cone`: the exact outline of the cone on the eye's wall, found below the pixel on the beam's own profile.

A robust start, then bands of bins along the predicted outline, coarse to fine, in strips across the edge whose albedo
is their own. Not an ellipse, and no threshold after the start.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.fit import fit_edge
from conespot.localize.image import Reference
from conespot.localize.model.noise import NoiseModel, noise_of
from conespot.localize.model.prior import Knowns
from conespot.localize.model.view import Unlit
from conespot.localize.outcome import LocalizationFailure, Outcome
from conespot.localize.start.search import Start, believed, find_starts
from conespot.localize.verdict import judged
from conespot.scene.scene import Scene


def cone(
    image: NDArray[np.generic],
    scene: Scene,
    *,
    knowns: Knowns | None = None,
    reference: Reference | None = None,
    noise: NoiseModel | None = None,
) -> Outcome:
    """The tip from a checked image `[H, W]` or `[H, W, 3]`; `reference` (no spotlight) helps the search only."""
    known, sensor = knowns or Knowns(), noise or noise_of(scene)
    starts = find_starts(image, scene, reference.pixels if reference else None)
    return believed(starts, scene, lambda start: edge_outcome(image, scene, start, known, sensor))


def edge_outcome(
    image: NDArray[np.generic],
    scene: Scene,
    start: Start,
    knowns: Knowns,
    noise: NoiseModel,
    unlit: Unlit | None = None,
) -> Outcome:
    """The localization from the edge fit near a start, or why it may not be believed."""
    fit = fit_edge(image, scene, start, knowns, noise, unlit)
    if isinstance(fit, str):
        return LocalizationFailure(fit)
    return judged(
        fit.estimate, fit.covariance, scene, knowns,
        misfit=fit.misfit, covered=fit.covered, settled=fit.settled,
    )  # fmt: skip
