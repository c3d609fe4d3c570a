"""The outlines of sharp patches that are clipped throughout: all an image shows of them is which pixels are clipped.

A pixel is clipped as soon as the beam covers so much of it as brings it to white, which is little of a pixel: clipped
pixels reach almost half a pixel beyond the outline. In strips across the edge their number says where it runs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.ribbon import Ribbon
from conespot.localize.edge.sandwich import EdgeFit
from conespot.localize.edge.settings import EDGE
from conespot.localize.edge.strips import WIDTH, Strips, score_covariance
from conespot.localize.image import Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.outline import distances, outline_problem
from conespot.localize.model.residual import follows, spread, student_weights
from conespot.localize.model.solve import limited, reduction, solved
from conespot.localize.model.view import Shown
from conespot.localize.outcome import COVERED, UNCERTAIN, LocalizationFailure
from conespot.scene.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SaturatedFit(EdgeFit):
    """Fitted outlines."""

    strips: Strips
    rows: Array  #: displacement of each strip by the parameters and the log contrast, whitened `[S, P + 1]`
    residual: Array  #: displacements, whitened `[S]`
    contrast_spread: float  #: prior sigma of the log contrast
    wide: float  #: by how much the seam between dark and white is wider than any sharp edge's [sigmas]

    @property
    def misfit(self) -> float:
        """The scatter of the strips is their own measure."""
        return 1.0

    def suspicions(self, nominal: Scene) -> dict[str, float]:
        """A blur's alone: which pixels are clipped does not tell of beam and wall.

        Light that a lens spreads brings pixels to white that the beam does not reach, by more than their size.
        """
        return {"edge": max(self.wide, 0.0)}

    def scatter(self) -> Array:
        """Covariance of the gradient `[P, P]` as the strips' residuals show it."""
        size = len(self.information)
        weights = student_weights(self.residual)
        parts = np.einsum("s,sp,sq->spq", weights, self.rows, self.rows)
        reduced = reduction(parts.sum(axis=0) + _contrast_prior(size, self.contrast_spread), size)
        scores = (weights * self.residual)[:, None] * self.rows @ reduced.T / follows(weights, self.residual)
        parts = reduced @ parts @ reduced.T
        seen = score_covariance(self.strips, scores, parts)
        count = self.strips.count
        if count < EDGE.fewest_strips:
            # a fit follows a few strips by as many as it takes to hold it, and leaves them closer than they are
            followed = float(np.trace(np.linalg.solve(self.information, parts.sum(axis=0))))
            seen = seen * count / max(count - followed, 1.0)
        known = self.prior.T @ self.prior + reduced @ _contrast_prior(size, self.contrast_spread) @ reduced.T
        return np.asarray(seen + known)


def fit_saturated(
    frame: Frame, start: Estimate, knowns: Knowns, *, side: int, tied: bool = False
) -> SaturatedFit | LocalizationFailure:
    """Fit the pose to which bins of `side` x `side` px are clipped.

    With `tied` the axis stays on the RCM.
    """
    nominal, estimate = start.scene, start
    size = start.pose_size + len(knowns.free)
    used = replace(knowns, rcm_sigma_mm=0.0) if tied else knowns
    ribbon = Ribbon.along(frame, estimate, side=side, inner=EDGE.saturated_band, outer=EDGE.saturated_band)
    if ribbon is None:
        return LocalizationFailure(COVERED)
    strips = ribbon.strips
    clipped = np.mean([np.where(c.clipped, 1.0, np.where(c.usable, 0.0, 0.5)) for c in ribbon.shown], axis=0)
    problem = outline_problem(ribbon.pixels, ribbon.spots, float(side), nominal, used)
    normal = _normals(ribbon, estimate)
    told = [_share(c, ribbon, normal) for c in ribbon.shown]
    share, uncertain, wide = (
        np.array([t[0] for t in told]),
        float(np.mean([t[1] for t in told])),
        max(t[2] for t in told),
    )
    beyond = np.mean([_reach_beyond(normal, s) for s in share], axis=0) / side
    rise = np.mean([_reach_beyond(normal, s / 1.5) - _reach_beyond(normal, s * 1.5) for s in share], axis=0)
    rise = rise / (2.0 * math.log(1.5) * side)
    information, pj, step = np.eye(size), np.zeros((0, size)), np.zeros(size)
    rows, residual, contrast = np.zeros((strips.count, size + 1)), np.zeros(strips.count), 0.0
    for reach in EDGE.reach:
        distance, jacobian, pr, pj = problem(estimate)
        away = distance - beyond - contrast * rise
        counted = (np.abs(away) < reach).astype(float)
        displaced = 2.0 * reach * (clipped - np.clip(0.5 - away / (2.0 * reach), 0.0, 1.0))
        columns = np.concatenate([-jacobian.T, rise[None], displaced[None]])
        # a strip weighs as much as it has bins that count
        means = strips.sums(columns * counted) / np.sqrt(np.maximum(strips.sums(counted), 1.0))
        scatter = max(spread(means[-1][means[-1] != 0.0]), EDGE.smallest_scatter)
        rows, residual = means[:-1].T / scatter, means[-1] / scatter
        weights = student_weights(residual)
        whole = (rows * weights[:, None]).T @ rows + _contrast_prior(size, uncertain)
        slope = rows.T @ (weights * residual)
        slope[size] -= contrast / uncertain**2
        reduced = reduction(whole, size)
        information = reduced @ whole @ reduced.T + pj.T @ pj
        found = solved(information, reduced @ slope - pj.T @ pr)
        if found is None:
            return LocalizationFailure(UNCERTAIN)
        step = limited(found, EDGE.saturated_step_mm)
        contrast += float(np.clip((slope[size] - whole[size, :size] @ step) / whole[size, size], -1.0, 1.0))
        estimate = estimate.moved(step, knowns.free)
    return SaturatedFit(
        estimate, information, pj, step, ribbon.covered, knowns, strips, rows, residual, uncertain, wide
    )


def _contrast_prior(size: int, sigma: float) -> Array:
    """Prior information `[size + 1, size + 1]` on the log contrast."""
    prior = np.zeros((size + 1, size + 1))
    prior[size, size] = sigma**-2
    return prior


def _share(shown: Shown, ribbon: Ribbon, normal: Array) -> tuple[float, float, float]:
    """Which share of a pixel the beam covers when the pixel clips, the spread of its logarithm, and what tells of blur.

    The edge leaves pixels between dark and white in a seam as wide as it moves from covering a tenth of that share to
    covering it: their number tells. The last is by how many sigmas they are more than a sharp edge can leave.
    """
    outside = shown.usable & (ribbon.strips.offset > EDGE.seam)
    dark = float(np.median(shown.signal[outside])) if outside.any() else 0.0
    seam = shown.usable & (shown.signal > dark + 0.1 * (1.0 - dark)) & (np.abs(ribbon.strips.offset) < EDGE.seam)
    number = float(np.count_nonzero(seam))
    shares = np.geomspace(0.003, 0.9, 40)
    some = normal[:, :: max(1, normal.shape[1] // 200)]
    widths = np.array([np.mean(_reach_beyond(some, 0.1 * s) - _reach_beyond(some, s)) for s in shares])
    width = (number + 0.5) / (ribbon.strips.count * WIDTH)
    most = float(widths.max()) * ribbon.strips.count * WIDTH
    share, excess = float(np.interp(width, widths, shares)), (number - most) / math.sqrt(most + 1.0)
    return share, 1.0 / math.sqrt(number + 1.0), excess


def _normals(ribbon: Ribbon, estimate: Estimate) -> Array:
    """The edge's normal at each bin, smaller component first, without signs `[2, N]`."""
    sides = [
        distances(ribbon.pixels + shift, ribbon.spots, estimate)[0]
        - distances(ribbon.pixels - shift, ribbon.spots, estimate)[0]
        for shift in np.eye(2)
    ]
    slope = np.abs(np.stack(sides))
    return np.sort(slope / np.maximum(np.hypot(*slope), 1e-12), axis=0)


def _reach_beyond(normal: Array, share: float) -> Array:
    """How far outside the edge [px] the centre of a pixel is of which a half plane covers `share`."""
    small, large = np.maximum(normal[0], 1e-9), normal[1]
    corner = np.sqrt(2.0 * small * large * share)
    into = np.where(corner < small, corner, large * share + small / 2.0)
    return np.asarray((small + large) / 2.0 - into)
