"""Maximum likelihood on windows' bins, with the albedo as a Gaussian field eliminated from the normal equations.

Every spotlight has a window of its own, with an albedo of its own; pose and gain are one.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from conespot.localize.field.albedo import Modes
from conespot.localize.field.piece import Piece
from conespot.localize.field.settings import FIELD, Level
from conespot.localize.image import Frame, Reference
from conespot.localize.model.doubt import contradicted
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.prior import prior_rows
from conespot.localize.model.solve import STEP, inverse, limited, reduction
from conespot.localize.model.suspicion import TRANSFER, matter, scores
from conespot.localize.model.transfer import mistake
from conespot.localize.model.view import Bins, Shown, Window, log_albedo, visible
from conespot.localize.outcome import COVERED, UNCERTAIN, LocalizationFailure
from conespot.scene.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FieldFit:
    """A fitted patch, or several."""

    estimate: Estimate
    pieces: tuple[Piece, ...]
    lead: int  #: which channel's light is measured
    gain: float  #: log of the spotlights' intensity over the ambient irradiance
    normal: Array  #: information of the pose, the free quantities and the gain `[P + 1, P + 1]`, priors included
    prior: Array  #: what is known of the pose and the free quantities `[P, P]`
    step: Array  #: the last `[P + 1]`
    misfit: float  #: rms of the lit bins' residuals, outliers cut, over what the model expects
    settled: bool  #: whether the last step was small
    lit_share: float  #: share of the predicted patches that the frame shows and that is not clipped
    knowns: Knowns  #: by which it was fitted

    @cached_property
    def covariance(self) -> Array:
        """Covariance of the pose and the free quantities `[P, P]`: a sandwich (`field.sandwich`)."""
        bread, size = inverse(self.normal), len(self.prior)
        meat = sum((piece.scatter(self.step, bread) for piece in self.pieces), np.zeros_like(bread))
        meat[:size, :size] += self.prior
        return np.asarray((bread @ meat @ bread)[:size, :size])

    @cached_property
    def _seen(self) -> tuple[Array, Array]:
        """Information and gradient where the fit stands, after its last step, as the windows see them, without priors.

        Of the pose, what is free or doubted, the gain, and how values were decoded, if that may have been amiss.
        """
        transfer = mistake(self.estimate.scene.sensor)
        lights = [piece.bins.spotlight(self.estimate, self.knowns.doubting)[self.lead] for piece in self.pieces]
        size = len(lights[0][1]) + (1 if transfer is None else 2)
        information, gradient = np.zeros((size, size)), np.zeros(size)
        if not _finite(lights):
            return information * np.nan, gradient * np.nan
        for piece, light in zip(self.pieces, lights, strict=True):
            # the pieces stay as they are
            part, slope = copy(piece).linearize(*light, self.gain, transfer)
            information, gradient = information + part, gradient + slope
        return information, gradient

    def contradicts(self, nominal: Scene) -> bool:
        """Whether the windows show that to be otherwise than `nominal` which the knowns doubt."""
        doubted = self.knowns.doubting
        told, rows = prior_rows(self.estimate, nominal, doubted)
        size = rows.shape[1]
        information, gradient = self._seen[0][: size + 1, : size + 1].copy(), self._seen[1][: size + 1].copy()
        if not np.isfinite(information).all():
            return False
        information[:size, :size] += rows.T @ rows
        gradient[:size] -= rows.T @ told
        reduced = reduction(information, size)  # without the gain
        return contradicted(reduced @ information @ reduced.T, reduced @ gradient, self.estimate, doubted, self.knowns)

    def suspicions(self, nominal: Scene) -> dict[str, float]:
        """The score of how values were decoded, where the fit stands, over its sigma: see `model.suspicion`."""
        size, transfer = len(self.normal), mistake(nominal.sensor)
        if transfer is None:
            return {}
        told, rows = prior_rows(self.estimate, nominal, self.knowns)
        prior, pull = np.zeros((size + 1, size + 1)), np.zeros(size + 1)
        prior[: size - 1, : size - 1], pull[: size - 1] = rows.T @ rows, -rows.T @ told
        both = (
            *self.estimate.pose_size * [True],
            *(each in self.knowns.free for each in self.knowns.doubting.free),
            True,
            True,
        )
        kept = np.flatnonzero(both)
        gradient, information = self._seen[1][kept] + pull, self._seen[0][np.ix_(kept, kept)] + prior
        if not np.isfinite(information).all() or not matter([TRANSFER], gradient, information, size):
            return {}
        pieces = [copy(piece) for piece in self.pieces]
        for piece in pieces:
            piece.linearize(*piece.bins.spotlight(self.estimate)[self.lead], self.gain, transfer)
        bread, still = inverse(information), np.zeros(size + 1)
        meat = sum((piece.scatter(still, bread) for piece in pieces), prior)
        return scores([TRANSFER], gradient, information, meat, size)


def fit_patch(
    frame: Frame, start: Estimate, knowns: Knowns, noise: NoiseModel, reference: Reference | None
) -> FieldFit | LocalizationFailure:
    """The fit, coarse to fine, or why there is none."""
    fit: FieldFit | None = None
    used = knowns
    for level in FIELD.levels:
        while True:
            found = fit_field(frame, start, fit, used, noise, reference, level)
            if isinstance(found, LocalizationFailure):
                # what starts inside the frame and leaves it has run off
                return found if fit is None else LocalizationFailure(UNCERTAIN)
            nominal, fit, start = start.scene, found, found.estimate
            if used == knowns.doubting or not found.contradicts(nominal):
                break
            used = knowns.doubting
    assert fit is not None
    return fit


def fit_field(
    frame: Frame,
    start: Estimate,
    before: FieldFit | None,
    knowns: Knowns,
    noise: NoiseModel,
    reference: Reference | None,
    level: Level,
) -> FieldFit | LocalizationFailure:
    """Fit pose, gain and albedo to windows as fine as the `level` says, from `start`.

    The first iterations may keep the axis on the RCM, so that a poor start cannot run off along the soft directions of
    a free fit. `before` is a coarser fit, to start its albedo and gain from.
    """
    nominal, estimate = start.scene, start
    size = start.pose_size + len(knowns.free)
    lead, pieces = _pieces(frame, start, knowns, noise, reference, level.bins)
    if not pieces:
        return LocalizationFailure(COVERED)
    lights = [piece.bins.spotlight(estimate)[lead] for piece in pieces]
    gain = float(np.median([piece.begin(light) for piece, (light, _) in zip(pieces, lights, strict=True)]))
    if before is not None and before.lead == lead and len(before.pieces) == len(pieces):
        gain = before.gain
        for piece, coarse in zip(pieces, before.pieces, strict=True):
            piece.resume(coarse)
    settled, prior, information, step = False, np.zeros((size, size)), np.eye(size + 1), np.zeros(size + 1)
    for count in range(level.iterations):
        if count:
            lights = [piece.bins.spotlight(estimate)[lead] for piece in pieces]
        tie = replace(knowns, rcm_sigma_mm=FIELD.tied_mm) if count < level.tied else knowns
        residuals, rows = prior_rows(estimate, nominal, tie)
        prior = rows.T @ rows
        equations = _equations(pieces, lights, gain, prior, -rows.T @ residuals)
        if equations is None:
            return LocalizationFailure(UNCERTAIN)
        information, covariance, found = equations
        step = limited(found, FIELD.longest_step_mm)
        step[size] = np.clip(step[size], -1.0, 1.0)
        estimate = estimate.moved(step[:size], knowns.free)
        gain += float(step[size])
        for piece in pieces:
            piece.move(step, covariance)
        length = float(np.sqrt(max(0.0, float(step @ information @ step))))
        settled = length < STEP.settled_sigmas
        if length < FIELD.done_sigmas and count >= max(level.tied, 1):
            break
    return FieldFit(
        estimate,
        tuple(pieces),
        lead,
        gain,
        information,
        prior,
        step,
        float(np.sqrt(np.mean([piece.misfit**2 for piece in pieces]))),
        settled,
        visible(estimate) * float(np.mean([piece.unclipped() for piece in pieces])),
        knowns,
    )


def _pieces(
    frame: Frame, start: Estimate, knowns: Knowns, noise: NoiseModel, reference: Reference | None, bins: int
) -> tuple[int, list[Piece]]:
    """The channel whose light is measured, and a piece for every patch in the frame."""
    scene = start.scene
    found: list[tuple[Window, Bins, list[Shown]]] = []
    for spotlight in range(len(scene.spotlights)):
        at = Window.around(start, spotlight, bins, FIELD.margin)
        if at is None:
            continue
        shown = Shown.each(frame, at)
        if reference is not None:
            told = zip(shown, *log_albedo(reference, scene, at, noise), strict=True)
            shown = [plane.told(albedo, variance) for plane, albedo, variance in told]
        found.append((at, Bins(at, start, knowns, spotlight), shown))
    if not found:
        return 0, []
    # the channel least clipped leads: its light is measured, the others tell its albedo
    usable = np.sum([[np.count_nonzero(plane.usable) for plane in shown] for _, _, shown in found], axis=0)
    lead = int(np.argmax(usable))
    amplitude = FIELD.fundus if reference is None else FIELD.known
    pitch = scene.camera.pixel_pitch
    return lead, [
        Piece(shown, lead, seen, Modes.over(at.height, at.width, pitch * at.side), noise, amplitude)
        for at, seen, shown in found
    ]


def _finite(lights: Sequence[tuple[Array, Array]]) -> bool:
    return all(np.isfinite(light).all() and np.isfinite(rows).all() for light, rows in lights)


def _equations(
    pieces: Sequence[Piece], lights: Sequence[tuple[Array, Array]], gain: float, prior: Array, pull: Array
) -> tuple[Array, Array, Array] | None:
    """Information and covariance `[P + 1, P + 1]` of pose, free quantities and gain, and the step `[P + 1]`.

    `prior` `[P, P]` and its `pull` `[P]` are added to what the pieces say. None if it is singular, or a
    piece's model has no light or no end of it, as it may where a frame is black without noise.
    """
    if not _finite(lights):
        return None
    size = len(pull)
    information, gradient = np.zeros((size + 1, size + 1)), np.zeros(size + 1)
    information[:size, :size], gradient[:size] = prior, pull
    for piece, light in zip(pieces, lights, strict=True):
        part, slope = piece.linearize(*light, gain)
        information += part
        gradient += slope
    if not np.isfinite(information).all():
        return None
    covariance = inverse(information)
    step = covariance @ gradient
    return (information, covariance, step) if np.all(np.isfinite(step)) else None
