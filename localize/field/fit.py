"""Maximum likelihood on windows' bins, with the albedo as a Gaussian field eliminated from the normal equations.

Every spotlight has a window of its own, with an albedo of its own; pose and gain are one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.sandwich import SETTLED_SIGMAS
from conespot.localize.field.albedo import FUNDUS, KNOWN, Modes
from conespot.localize.field.piece import Piece
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.prior import Estimate, Knowns, prior_rows
from conespot.localize.model.solve import inverse
from conespot.localize.model.view import Channel, Grid, Unlit, Window, shown_in, visible

Array = NDArray[np.float64]
_MARGIN = 0.15  # of a patch's size, seen around it: where the light ends, and the albedo there
_LONGEST_STEP_MM = 0.15
_DONE_SIGMAS = 0.2  # a step this short ends the iterations
_TIED_MM = 2e-3
#: an albedo with vessels is no Gaussian field: on fundus images, in green and at 850 nm, the squared errors of the tip
#: were this much larger, with the RCM and without, at 1000 and 5000 px
_NOT_GAUSSIAN = 1.7


@dataclass(frozen=True)
class FieldFit:
    """A fitted patch, or several."""

    estimate: Estimate
    pieces: tuple[Piece, ...]
    lead: int  #: which channel's light is measured
    gain: float  #: log of the spotlights' intensity over the ambient irradiance
    information: Array  #: of the pose and the free quantities `[P, P]`, priors included
    misfit: float  #: rms of the lit bins' residuals, outliers cut, over what the model expects
    settled: bool  #: whether the last step was small
    lit_share: float  #: share of the predicted patches that the frame shows and that is not clipped


def fit_field(
    image: NDArray[np.generic],
    start: Estimate,
    before: FieldFit | None,
    knowns: Knowns,
    noise: NoiseModel,
    *,
    bins: int,
    iterations: int,
    tied: int = 0,
    unlit: Unlit | None = None,
) -> FieldFit | None:
    """Fit pose, gain and albedo to windows at most `bins` bins across each patch, from `start`.

    The first `tied` iterations keep the axis on the RCM, so that a poor start cannot run off along the soft directions
    of a free fit. `before` is a coarser fit, to start its albedo and gain from. None if the patches leave the frame or
    the equations are singular.
    """
    estimate, nominal = start, start.scene
    roll = len(nominal.spotlights) > 1
    pose_size = 6 if roll else 5
    size = pose_size + len(knowns.free)
    windows: list[tuple[list[Channel], Grid, Modes]] = []
    for k in range(len(nominal.spotlights)):
        at = Window.around(estimate, k, bins, _MARGIN)
        if at is None:
            continue
        grid = Grid(at, estimate, knowns, k)
        basis = Modes.over(at.height, at.width, nominal.camera.pixel_pitch * at.side)
        windows.append((shown_in(image, nominal, at, unlit), grid, basis))
    if not windows:
        return None
    # the channel least clipped leads: its light is measured, the others tell its albedo
    usable = np.sum([[np.count_nonzero(plane.usable) for plane in shown] for shown, _, _ in windows], axis=0)
    lead = int(np.argmax(usable))
    pieces = [Piece(shown, lead, grid, basis, noise) for shown, grid, basis in windows]
    lights = [piece.grid.spotlight(estimate, roll=roll) for piece in pieces]
    gain = float(np.median([piece.begin(light) for piece, (light, _) in zip(pieces, lights, strict=True)]))
    if before is not None and before.lead == lead and len(before.pieces) == len(pieces):
        gain = before.gain
        for piece, coarse in zip(pieces, before.pieces, strict=True):
            piece.resume(coarse)
    else:
        for piece in pieces:
            piece.amplitudes = FUNDUS if unlit is None else KNOWN
    settled, prior, information = False, np.zeros((size, size)), np.eye(size + 1)
    for count in range(iterations):
        tie = replace(knowns, rcm_sigma_mm=_TIED_MM) if count < tied else knowns
        residuals, rows = prior_rows(estimate, nominal, tie, pose_size)
        prior = rows.T @ rows
        information, gradient = np.zeros((size + 1, size + 1)), np.zeros(size + 1)
        information[:size, :size], gradient[:size] = prior, -rows.T @ residuals
        if count:
            lights = [piece.grid.spotlight(estimate, roll=roll) for piece in pieces]
        if not all(np.isfinite(light).all() and np.isfinite(rows).all() for light, rows in lights):
            return None
        for piece, light in zip(pieces, lights, strict=True):
            part, slope = piece.linearize(*light, gain)
            information += part
            gradient += slope
        covariance = inverse(information)
        step = covariance @ gradient
        if not np.all(np.isfinite(step)):
            return None
        step /= max(1.0, float(np.max(np.abs(step[:3]))) / _LONGEST_STEP_MM, float(np.max(np.abs(step[3:5]))) / 0.05)
        step[size] = np.clip(step[size], -1.0, 1.0)
        estimate = estimate.moved(step[:size], pose_size, knowns.free)
        gain += float(step[size])
        for piece in pieces:
            piece.move(step, covariance)
        length = float(np.sqrt(max(0.0, float(step @ information @ step))))
        settled = length < SETTLED_SIGMAS
        if length < _DONE_SIGMAS and count >= max(tied, 1):
            break
    own = information[size, :size]
    data = information[:size, :size] - np.outer(own, own) / max(information[size, size], 1e-12) - prior
    return FieldFit(
        estimate,
        tuple(pieces),
        lead,
        gain,
        prior + data / _NOT_GAUSSIAN,
        float(np.sqrt(np.mean([piece.misfit**2 for piece in pieces]))),
        settled,
        visible(estimate) * float(np.mean([piece.unclipped() for piece in pieces])),
    )
