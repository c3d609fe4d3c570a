"""Where a disc may be: gradients of an apparent albedo vote for the middles of bright rounds of its size."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.localize.disc.settings import DISC

Array = NDArray[np.float64]


def find_round(albedo: Array, variance: Array, use: NDArray[np.bool_], side: float) -> tuple[Array, float, float]:
    """Middle `[2]` (column, row) and radius [mm] of the roundest bright region of a log albedo `[h, w]`, and its votes.

    In bins of `side` [mm] whose noise has a `variance` `[h, w]`; votes are a share of those that a whole rim has. Each
    gradient has one vote at most, cast one radius along it (D. H. Ballard, Pattern Recognition 13, 1981).
    """
    blur = max(1.0, DISC.vote_blur / side)
    plane = cv2.GaussianBlur(np.where(use, albedo, np.median(albedo[use])), (0, 0), blur)
    gx, gy = (cv2.Scharr(plane, cv2.CV_64F, dx, 1 - dx, scale=1.0 / 32.0) for dx in (1, 0))
    slope = np.hypot(gx, gy)
    # a gradient of white noise that was blurred
    noise = np.sqrt(variance / (8.0 * math.pi)) / blur**2
    vote = slope / (slope + DISC.vote_sigmas * noise + DISC.half_vote * side)
    vote[cv2.erode(use.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1) == 0] = 0.0
    row, column = np.nonzero(vote > 0.0)
    worth, length = vote[row, column], np.maximum(slope[row, column], 1e-12)
    along_x, along_y = gx[row, column] / length, gy[row, column] / length
    best = (np.zeros(2), DISC.radii[0], -1.0)
    for radius in np.geomspace(*DISC.radii, DISC.sizes):
        beyond = math.ceil(radius / side)  # a middle may be outside of the window
        height, width = (n + 2 * beyond for n in albedo.shape)
        i, j = (np.round(at + g * radius / side).astype(int) + beyond for at, g in ((row, along_y), (column, along_x)))
        cast = np.bincount(i * width + j, worth, minlength=height * width)
        cast = cast.reshape(height, width).astype(np.float32)
        votes = cv2.GaussianBlur(cast, (0, 0), DISC.vote_off / side, borderType=cv2.BORDER_CONSTANT)
        # the top of a round Gaussian, over the bins of a rim
        votes *= DISC.vote_off**2 / (radius * side)
        top = divmod(int(np.argmax(votes)), width)
        if votes[top] > best[2]:
            best = (side * (np.array(top[::-1]) - beyond), float(radius), float(votes[top]))
    return best
