"""`photometric`: maximum likelihood on pixels, with the beam's profile, inverse square, cosine and the sensor's noise.

The albedo is a nuisance: a Gaussian field where the whole patch can be measured, a level and a slope across each strip
of its rim where only that says where the cone is (a hard edge, or a clipped patch). A reference frame without
spotlights, or a sequence over the same retina, takes its place as far as it is known.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from conespot.localize.cone import edge_outcome
from conespot.localize.edge.fit import is_clipped, is_sharp
from conespot.localize.field.fit import FieldFit, fit_field
from conespot.localize.image import Reference
from conespot.localize.model.noise import NoiseModel, noise_of
from conespot.localize.model.prior import Estimate, Knowns
from conespot.localize.model.solve import inverse
from conespot.localize.model.view import Unlit
from conespot.localize.outcome import LocalizationFailure, Outcome
from conespot.localize.start.search import Start, believed, find_starts
from conespot.localize.verdict import COVERED, UNCERTAIN, judged
from conespot.scene.scene import Scene

#: bins across a patch, at most; iterations, of which tied to the RCM
_LEVELS = ((48, 5, 2), (240, 16, 0))


def photometric(
    image: NDArray[np.generic],
    scene: Scene,
    *,
    knowns: Knowns | None = None,
    reference: Reference | None = None,
    noise: NoiseModel | None = None,
) -> Outcome:
    """The tip from a checked image `[H, W]` or `[H, W, 3]`; `reference` is the same view in ambient light alone."""
    known, sensor = knowns or Knowns(), noise or noise_of(scene)
    unlit = None if reference is None else Unlit(reference.pixels, reference.frames, sensor)

    def localized(start: Start) -> Outcome:
        if is_sharp(scene) or is_clipped(image, scene, start):
            return edge_outcome(image, scene, start, known, sensor, unlit)
        fit = fit_patch(image, scene, start, known, sensor, unlit)
        if isinstance(fit, str):
            return LocalizationFailure(fit)
        return judged(
            fit.estimate, inverse(fit.information), scene, known,
            misfit=fit.misfit, covered=fit.lit_share, settled=fit.settled,
        )  # fmt: skip

    starts = find_starts(image, scene, reference.pixels if reference else None)
    return believed(starts, scene, localized)


def fit_patch(
    image: NDArray[np.generic],
    scene: Scene,
    start: Start,
    knowns: Knowns,
    noise: NoiseModel,
    unlit: Unlit | None,
) -> FieldFit | str:
    """The field fit, coarse to fine, or why there is none."""
    estimate = Estimate(start.pose, scene)
    fit: FieldFit | None = None
    for number, (bins, iterations, tied) in enumerate(_LEVELS):
        fit = fit_field(image, estimate, fit, knowns, noise, bins=bins, iterations=iterations, tied=tied, unlit=unlit)
        if fit is None:
            return UNCERTAIN if number else COVERED
        estimate = fit.estimate
    assert fit is not None
    return fit
