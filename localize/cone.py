"""`cone`: the exact outline of the cone on the eye's wall, found below the pixel on the beam's own profile.

A robust start, then bands of bins along the predicted outline, coarse to fine, in strips across the edge whose albedo
is their own. Not an ellipse, and no threshold after the start.
"""

from __future__ import annotations

from dataclasses import replace

from conespot.localize.disc.fit import unless_disc
from conespot.localize.doubt import answered, noise_of
from conespot.localize.edge.fit import fit_edge, is_clipped, is_sharp
from conespot.localize.edge.sandwich import EdgeFit
from conespot.localize.image import AnyImage, Frame, Reference
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.outcome import Localization, LocalizationFailure, Outcome
from conespot.localize.spot.fit import fit_spot
from conespot.localize.spot.settings import SPOT
from conespot.localize.spot.window import is_spot
from conespot.localize.start.search import Start
from conespot.localize.verdict import MISFIT, judged
from conespot.scene.scene import Scene


def cone(
    image: AnyImage,
    scene: Scene,
    *,
    knowns: Knowns | None = None,
    reference: Reference | None = None,
    noise: NoiseModel | None = None,
) -> Outcome:
    """The tip from a checked image `[H, W]` or `[H, W, 3]`; `reference` (no spotlight) helps the search only."""
    known, frame = knowns or Knowns(), Frame(image, scene.sensor)
    sensor = noise_of(frame, noise)

    def localized(start: Start, there: Scene) -> Outcome:
        return edge_outcome(frame, Estimate(start.pose, there), known.within(there), sensor)

    return answered(frame, scene, reference, known, sensor, localized)


def edge_outcome(
    frame: Frame, start: Estimate, knowns: Knowns, noise: NoiseModel, reference: Reference | None = None
) -> Outcome:
    """The localization from the edge fit near a start, or why it may not be believed."""
    if is_spot(start):
        return spot_outcome(frame, start, knowns, noise)
    fit = fit_edge(frame, start, knowns, noise, reference)
    if isinstance(fit, LocalizationFailure):
        return fit
    found = judged_edge(fit, start.scene)
    if is_sharp(start.scene) or is_clipped(frame, start):
        return found
    return unless_disc(found, frame, replace(start, scene=fit.estimate.scene), knowns, noise)


def judged_edge(fit: EdgeFit, scene: Scene) -> Outcome:
    """The localization from an edge fit in a scene, or why it may not be believed."""
    outcome = judged(
        fit.estimate, fit.covariance, scene, fit.knowns,
        misfit=fit.misfit, covered=fit.covered, settled=fit.settled,
        suspicions=lambda: fit.suspicions(scene),
    )  # fmt: skip
    return replace(outcome, likelihood=fit.likelihood) if isinstance(outcome, Localization) else outcome


def spot_outcome(frame: Frame, start: Estimate, knowns: Knowns, noise: NoiseModel) -> Outcome:
    """The localization from all of a patch that is hardly larger than what spreads it, or why not to believe it."""
    fit = fit_spot(frame, start, knowns, noise)
    if isinstance(fit, LocalizationFailure):
        return fit
    if fit.explained < SPOT.explained:
        return LocalizationFailure(MISFIT)
    return judged(
        fit.here.estimate, fit.covariance, start.scene, fit.knowns,
        misfit=fit.piece.misfit, covered=fit.covered, settled=fit.settled,
    )  # fmt: skip
