"""`photometric`: maximum likelihood on pixels, with the beam's profile, inverse square, cosine and the sensor's noise.

The albedo is a nuisance: a Gaussian field where the whole patch can be measured, a level and a slope across each strip
of its rim where only that says where the cone is (a hard edge, or a clipped patch). A reference frame without
spotlights, or a sequence over the same retina, takes its place as far as it is known.
"""

from __future__ import annotations

from dataclasses import replace

from conespot.localize.cone import edge_outcome
from conespot.localize.disc.fit import unless_disc
from conespot.localize.doubt import answered, noise_of
from conespot.localize.edge.fit import is_clipped, is_sharp
from conespot.localize.field.fit import fit_patch
from conespot.localize.image import AnyImage, Frame, Reference
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.outcome import LocalizationFailure, Outcome
from conespot.localize.start.search import Start
from conespot.localize.verdict import judged
from conespot.scene.scene import Scene


def photometric(
    image: AnyImage,
    scene: Scene,
    *,
    knowns: Knowns | None = None,
    reference: Reference | None = None,
    noise: NoiseModel | None = None,
) -> Outcome:
    """The tip from a checked image `[H, W]` or `[H, W, 3]`; `reference` is the same view in ambient light alone."""
    known, frame = knowns or Knowns(), Frame(image, scene.sensor)
    sensor = noise_of(frame, noise)

    def localized(start: Start, there: Scene) -> Outcome:
        return patch_outcome(frame, Estimate(start.pose, there), known.within(there), sensor, reference)

    return answered(frame, scene, reference, known, sensor, localized)


def patch_outcome(
    frame: Frame, start: Estimate, knowns: Knowns, noise: NoiseModel, reference: Reference | None = None
) -> Outcome:
    """The localization from every pixel of the patch near a start, or why it may not be believed."""
    if is_sharp(start.scene) or is_clipped(frame, start):
        return edge_outcome(frame, start, knowns, noise, reference)
    fit = fit_patch(frame, start, knowns, noise, reference)
    if isinstance(fit, LocalizationFailure):
        return fit
    found = judged(
        fit.estimate, fit.covariance, start.scene, fit.knowns,
        misfit=fit.misfit, covered=fit.lit_share, settled=fit.settled,
        suspicions=lambda: fit.suspicions(start.scene),
    )  # fmt: skip
    if reference is not None:
        return found
    return unless_disc(found, frame, replace(start, scene=fit.estimate.scene), knowns, noise)
