"""Round bright regions: rings of inward gradients of the logarithm of the light, of every size a cone can have.

No threshold: what the retina reflects multiplies ambient light and spotlights alike, so the rim of a patch is the same
step of the logarithm on a dark and on a bright ground. Every gradient has about the same vote, whatever its height, as
in Hough's transform (D. H. Ballard, Generalizing the Hough transform, Pattern Recognition 13 (1981)).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from conespot.localize.image import Frame, Reference, Signal
from conespot.localize.model.residual import spread
from conespot.localize.start.settings import START
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
#: keeps the logarithm of a frame that is black all over finite [white]
_DARKEST = 1e-5


@dataclass(frozen=True)
class Overview:
    """Every `step`-th pixel of a frame, in one channel, as light; and the same of a reference frame."""

    light: Signal  #: `[h, w]` [white]
    reference: Signal | None  #: `[h, w]` [white]
    step: int
    floor: float  #: added before the logarithm, so that noise in the dark and dark vessels count little [white]

    @classmethod
    def of(cls, frame: Frame, reference: Reference | None, *, whole: bool = False) -> Overview:
        """The overview of a frame; of the `whole` frame every pixel."""
        step = 1 if whole else max(1, frame.side // START.overview_px)
        light = _one_channel(frame, step)
        noise = spread(np.diff(light[::3, ::2], axis=1)) / math.sqrt(2.0)
        floor = max(START.dark_share * float(np.median(light[::3, ::3])), START.noise_sigmas * noise, _DARKEST)
        dark = None if reference is None else _one_channel(Frame(reference.pixels, frame.sensor), step)
        return cls(light, dark, step, floor)

    def logarithm(self, light: Signal, reference: Signal | None) -> Signal:
        """The logarithm of light, over that of the reference if there is one; any shape."""
        result = np.log(np.maximum(light, 0.0) + np.float32(self.floor))
        if reference is not None:
            result -= np.log(np.maximum(reference, 0.0) + np.float32(self.floor))
        return np.asarray(result, np.float32)


@dataclass(frozen=True)
class Ring:
    """A round region brighter than what surrounds it."""

    centre: Array  #: `[2]` [px]
    radius: float  #: [px]
    votes: float  #: mean vote along the ring, at most 1

    def curve(self, points: int = 36) -> Array:
        """Points `[points, 2]` [px] of the ring."""
        angle = np.arange(points) * (2.0 * math.pi / points)
        return np.asarray(self.centre + self.radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def find_rings(
    overview: Overview, scene: Scene, most: int, hidden: Sequence[Array] = (), *, small: bool = False
) -> list[Ring]:
    """The `most` rings with the most votes, best first; gradients along `hidden` curves `[N, 2]` [px] do not vote.

    `small` rings need finer bins, which take longer.
    """
    side = START.fine_bin_side if small else START.bin_side
    rows, columns = (n // side for n in overview.light.shape)
    planes = [
        None
        if plane is None
        else np.asarray(cv2.resize(plane, (columns, rows), interpolation=cv2.INTER_AREA), np.float32)
        for plane in (overview.light, overview.reference)
    ]
    assert planes[0] is not None
    log = np.asarray(cv2.GaussianBlur(overview.logarithm(planes[0], planes[1]), (0, 0), START.vote_blur), np.float32)
    gx, gy = (cv2.Scharr(log, cv2.CV_32F, dx, 1 - dx, scale=1.0 / 32.0) for dx in (1, 0))
    vote = 1.0 / (np.sqrt(gx * gx + gy * gy) + np.float32(START.half_vote))
    scale = overview.step * side
    for curve in hidden:
        points = np.round(curve / scale - 0.5).astype(np.int32)
        vote = np.asarray(cv2.polylines(vote, [points], True, 0.0, START.hidden_width), np.float32)
    reach = math.tan(scene.beam.half_angle) / (scene.camera.pixel_pitch * scale)  # bins of radius a mm of distance
    low, high = max(START.smallest, START.nearest * reach), max(2.0 * START.smallest, reach * scene.eye.radius)
    high = max(2.0 * low, START.fine_reach) if small else high
    radii = tuple(np.geomspace(low, high, max(3, round(math.log(high / low, START.radius_ratio)) + 1)).tolist())
    size = int(fft.next_fast_len(max(rows, columns) + math.ceil(high) + 2, real=True))
    field = fft.rfft2(np.stack([gx * vote, gy * vote]), s=(size, size))
    kernels = ring_kernels(size, radii)
    votes = fft.irfft2(field[0] * kernels[:, 0] + field[1] * kernels[:, 1], s=(size, size))[:, :rows, :columns]
    y, x = np.ogrid[:rows, :columns]
    found = []
    for _ in range(most):
        k, row, column = np.unravel_index(int(np.argmax(votes)), votes.shape)
        best = float(votes[k, row, column])
        grow, down, right = (_summit(votes, (int(k), int(row), int(column)), axis) for axis in range(3))
        centre = scale * (np.array([column + right, row + down]) + 0.5)
        found.append(Ring(centre, scale * radii[k] * (radii[1] / radii[0]) ** grow, best))
        away = (x - column) ** 2 + (y - row) ** 2
        for j, radius in enumerate(radii):
            if 1.0 / START.one_ring_size < radius / radii[k] < START.one_ring_size:
                np.copyto(votes[j], -1.0, where=away < (START.one_ring_place * max(radius, radii[k])) ** 2)
    return found


def find_spots(overview: Overview, scene: Scene, most: int) -> list[Ring]:
    """The `most` round spots too small for rings to see, those that stand out most first.

    Maxima of the scale-normalised Laplacian of the log light, which a disc of radius r has at a blur of r / sqrt(2)
    (T. Lindeberg, Feature detection with automatic scale selection, Int. J. Computer Vision 30, 1998).
    """
    log = cv2.medianBlur(overview.logarithm(overview.light, overview.reference), 3)  # without hot pixels
    high = START.smallest * START.fine_bin_side * max(1, max(log.shape) // START.overview_px)
    radii = np.geomspace(START.tiniest, high, max(2, round(math.log(high / START.tiniest, START.spot_ratio)) + 1))
    found: list[Ring] = []
    for radius in radii:
        sigma = radius / math.sqrt(2.0)
        spot = -(sigma**2) * cv2.Laplacian(cv2.GaussianBlur(log, (0, 0), sigma), cv2.CV_32F, ksize=1)
        peaks = np.argwhere((spot == cv2.dilate(spot, np.ones((3, 3), np.uint8))) & (spot > START.half_vote))
        values = spot[peaks[:, 0], peaks[:, 1]]
        for at in np.argsort(-values)[:most]:
            row, column = peaks[at]
            found.append(Ring(overview.step * (np.array([column, row]) + 0.5), overview.step * radius, values[at]))
    kept: list[Ring] = []
    for ring in sorted(found, key=lambda each: -each.votes):
        if all(np.linalg.norm(ring.centre - other.centre) > max(ring.radius, other.radius) for other in kept):
            kept.append(ring)
    return kept[:most]


def _summit(votes: NDArray[np.float32], peak: tuple[int, int, int], axis: int) -> float:
    """How far beside its sample the peak of the votes is along an axis: the top of a parabola, at most half a step."""
    at = peak[axis]
    if not 0 < at < votes.shape[axis] - 1:
        return 0.0
    before, here, after = (float(votes[(*peak[:axis], at + j, *peak[axis + 1 :])]) for j in (-1, 0, 1))
    bend = before - 2.0 * here + after
    return 0.5 * (before - after) / bend if bend < 0.0 and min(before, after) >= 0.0 else 0.0


@lru_cache(maxsize=4)
def ring_kernels(size: int, radii: tuple[float, ...]) -> NDArray[np.complex64]:
    """Transforms `[R, 2, size, size / 2 + 1]` of inward unit vectors along rings, conjugate: products correlate."""
    y = np.arange(size)
    y = np.where(y > size // 2, y - size, y).astype(float)
    distance = np.maximum(np.hypot(y[:, None], y), 1e-6)
    result = []
    for radius in radii:
        weight = np.exp(-0.5 * ((distance - radius) / max(START.ring_width, START.ring_width_share * radius)) ** 2)
        weight[0, 0] = 0.0
        weight /= weight.sum() * distance
        result.append([np.conj(fft.rfft2(-y[None, :] * weight)), np.conj(fft.rfft2(-y[:, None] * weight))])
    return np.array(result, np.complex64)


def _one_channel(frame: Frame, step: int) -> Signal:
    """Light in a frame's brightest channel, every `step`-th pixel."""
    every = slice(step // 2, None, step)
    signal = frame.signal(every, every)
    return signal[..., 0] if signal.shape[2] == 1 else signal.max(axis=2)
