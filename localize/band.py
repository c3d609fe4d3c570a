"""Maximum likelihood on a band of bins along the outlines, cut into strips across the edge with an albedo of their own.

In each strip the log albedo is a level and a slope, both eliminated: a vessel or a shade that crosses the edge changes
both sides alike and leaves the edge where it is. What remains is the position of the beam's own profile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from localize.forward import ambient_irradiance, look
from localize.noise import NoiseModel, SensorNoise, linear_light
from localize.outline import distances
from localize.prior import Estimate, Knowns, prior_rows
from localize.solve import rest, student_weights
from localize.start import nearest_outline
from localize.view import spotlight_irradiance

Array = NDArray[np.float64]
_STRIP_BINS = 2.0  # width of a strip along the outline
_SLOPE_PER_MM = 3.0  # rms gradient of a fundus' log albedo in green light
_LEVEL = 1.0  # spread of the strips' log albedo
_LONGEST_STEP_BINS = 3.0
_FEWEST = 40  # bins
#: rounded values share their error along the whole rim: measured on clipped 8-bit frames, not derived
_ROUNDED_INFLATION = 9.0
_DONE_SIGMAS = 0.05  # a step this short ends the iterations
#: a last step longer than this, in sigmas of uncorrelated residuals, means that the fit does not settle
SETTLED_SIGMAS = 1.0


@dataclass(frozen=True)
class BandFit:
    """A fitted band."""

    estimate: Estimate
    information: Array  #: of the pose and the free quantities `[P, P]`, priors included
    gains: tuple[float, ...]  #: log of the spotlights' intensity over the ambient irradiance, a channel each
    misfit: float  #: rms of the residuals, outliers cut, over what the model expects
    settled: bool
    covered: float  #: share of the outlines that the band shows
    correlation: float  #: how much larger slow residuals along the outline are than independent strips would give


@dataclass(frozen=True)
class _Bins:
    pixels: Array  #: centres `[N, 2]` [px]
    signal: Array  #: `[C, N]` [white]
    usable: NDArray[np.bool_]  #: `[C, N]`
    clipped: NDArray[np.bool_]  #: `[C, N]`


def fit_band(
    image: NDArray[np.generic],
    start: Estimate,
    gains: tuple[float, ...],
    knowns: Knowns,
    noise: NoiseModel,
    *,
    side: int,
    inner: float,
    outer: float,
    iterations: int,
    tied: bool = False,
) -> BandFit | None:
    """Fit the pose to bins of `side` x `side` px from `inner` bins inside the outlines to `outer` bins outside.

    `gains` may be empty: then they are measured. With `tied` the axis stays on the RCM. None if too little of the
    outlines is in the frame or the equations are singular.
    """
    nominal, estimate = start.scene, start
    roll = len(nominal.spotlights) > 1
    pose_size = 6 if roll else 5
    size = pose_size + len(knowns.free)
    used = Knowns(0.0, *list(vars(knowns).values())[1:]) if tied else knowns
    found = _band(image, estimate, side, inner, outer)
    if found is None:
        return None
    bins, strips, count, offset, covered = found
    sight = look(nominal, bins.pixels, side)
    irradiance = ambient_irradiance(sight, nominal)
    whites = [0.05] * len(bins.signal)
    pitch = nominal.camera.pixel_pitch * side
    precision = np.array([1.0 / _LEVEL**2, 1.0 / (_SLOPE_PER_MM * pitch) ** 2])
    levels = [np.zeros((count, 2)) for _ in bins.signal]
    gain = list(gains)
    rounded = isinstance(noise, SensorNoise) and noise.electrons is None
    dark_bins = max(1.0, outer * _STRIP_BINS)
    settled, misfits, information, correlation = False, [math.inf], np.eye(size), 1.0
    for turn in range(iterations):
        value_, rows = spotlight_irradiance(sight, estimate, knowns, bins.pixels, side, roll=roll)
        if not gain:
            gain = [
                _first_gain(s, u, irradiance, value_, offset) for s, u in zip(bins.signal, bins.usable, strict=True)
            ]
        pr, pj = prior_rows(estimate, nominal, used, pose_size)
        information, gradient = pj.T @ pj, -pj.T @ pr
        solved, misfits, slow = [], [], []
        for c, signal in enumerate(bins.signal):
            usable, clipped = bins.usable[c], bins.clipped[c]
            g = math.exp(gain[c])
            brightness = irradiance + g * value_
            if turn == 0:
                levels[c][:, 0] = _levels(signal / brightness, usable, strips, count)
            known = levels[c][strips, 0] + levels[c][strips, 1] * offset
            model = np.exp(known) * brightness
            relative = signal / model - 1.0
            residual = np.where(np.abs(relative) < 0.5, relative, np.log(np.maximum(signal, 0.02 * model) / model))
            bound = clipped & (model < 1.0)
            residual[bound] = -np.log(np.maximum(model[bound], 1e-6))
            use = usable | bound
            variance = noise.variance(model) / side**2 / np.square(np.maximum(model, 1e-9))
            if rounded:
                # nearly equal values are rounded alike: a strip's dark side counts once, not once a bin
                variance = np.where(value_ > 0.0, variance, variance * dark_bins)
            steady = use & (value_ > 0.0)
            if turn > 0 and np.count_nonzero(steady) > 30:
                whites[c] = rest(residual[steady], variance[steady], whites[c])
            variance = variance + whites[c] ** 2
            whitened = residual / np.sqrt(variance)
            weights = use / variance * student_weights(whitened)
            misfits.append(
                float(np.sqrt(np.mean(np.minimum(np.square(whitened[use]), 25.0)))) if use.any() else math.inf
            )
            jacobian = np.concatenate([g / brightness * rows, (g / brightness * value_)[None]])
            part = _eliminate(jacobian, residual + known, weights, strips, count, offset, precision)
            solved.append(part)
            full, grad = part.information, part.gradient
            pivot = max(float(full[-1, -1]), 1e-12)
            information = information + full[:-1, :-1] - np.outer(full[:-1, -1], full[-1, :-1]) / pivot
            gradient = gradient + grad[:-1] - full[:-1, -1] * grad[-1] / pivot
            slow.append(_slow_share(residual * weights, brightness, strips, count))
        correlation = float(np.mean(slow)) * (_ROUNDED_INFLATION if rounded else 1.0)
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        try:
            step = np.linalg.solve(information / np.outer(scale, scale), gradient / scale) / scale
        except np.linalg.LinAlgError:
            return None
        if not np.all(np.isfinite(step)):
            return None
        reach = float(np.max(np.abs(step[:3])))
        step = step / max(1.0, reach / max(0.1, _LONGEST_STEP_BINS * pitch), float(np.max(np.abs(step[3:5]))) / 0.05)
        estimate = estimate.moved(step, pose_size, knowns.free)
        for c, part in enumerate(solved):
            own = float((part.gradient[-1] - part.information[-1, :-1] @ step) / max(part.information[-1, -1], 1e-12))
            own = float(np.clip(own, -1.0, 1.0))
            gain[c] += own
            levels[c] = part.levels(np.append(step, own))
        length = math.sqrt(max(0.0, float(step @ information @ step)))
        settled = length < SETTLED_SIGMAS * math.sqrt(correlation)
        if length < _DONE_SIGMAS and turn >= 2:
            break
    return BandFit(
        estimate, information, tuple(gain), float(np.sqrt(np.mean(np.square(misfits)))), settled, covered, correlation
    )


def _band(
    image: NDArray[np.generic], estimate: Estimate, side: int, inner: float, outer: float
) -> tuple[_Bins, NDArray[np.intp], int, Array, float] | None:
    """The bins along the outlines, their strips and how many, distances from the outline in bins, coverage."""
    scene = estimate.scene
    edge = scene.camera.resolution // side
    curves, seen = [], []
    for k in range(len(scene.spotlights)):
        points = scene.camera.project(scene.outline(estimate.pose, k, 180)) / side - 0.5
        finite = np.all(np.isfinite(points), axis=1)
        inside = finite & np.all((points > 1.0) & (points < edge - 2.0), axis=1)
        seen.append(float(np.mean(inside)))
        if inside.sum() >= 10:
            curves.append(points[finite])
    if not curves:
        return None
    reach = math.ceil(max(inner, outer)) + 1
    every = np.concatenate(curves)
    low = np.clip(np.floor(every.min(axis=0)).astype(int) - reach, 0, edge - 1)
    high = np.clip(np.ceil(every.max(axis=0)).astype(int) + reach + 1, 1, edge)
    if np.any(high - low < 4):
        return None
    mask = np.zeros((high[1] - low[1], high[0] - low[0]), np.uint8)
    for points in curves:
        cv2.polylines(mask, [np.round(points - low).astype(np.int32)], True, 1, 2 * reach + 1)
    row, column = np.nonzero(mask)
    pixels = (np.stack([column + low[0], row + low[1]], axis=1) + 0.5) * side
    spots, alone = nearest_outline(pixels, estimate)
    distance = distances(pixels, spots, estimate, roll=len(scene.spotlights) > 1)[0] / side
    keep = np.isfinite(distance) & alone & (distance > -inner) & (distance < outer)
    if np.count_nonzero(keep) < _FEWEST:
        return None
    row, column, pixels, spots, distance = row[keep], column[keep], pixels[keep], spots[keep], distance[keep]
    cut = image[low[1] * side : high[1] * side, low[0] * side : high[0] * side]
    signal, clip = linear_light(np.ascontiguousarray(cut), scene)
    if signal.ndim == 2:
        signal, clip = signal[..., None], clip[..., None]
    found: list[list[Array]] = [[], [], []]
    for c in range(signal.shape[2]):
        plane, share = np.ascontiguousarray(signal[..., c]), clip[..., c].astype(np.float32)
        if side > 1:
            shape = (mask.shape[1], mask.shape[0])
            plane = np.asarray(cv2.resize(plane, shape, interpolation=cv2.INTER_AREA), np.float32)
            share = np.asarray(cv2.resize(share, shape, interpolation=cv2.INTER_AREA), np.float32)
        found[0].append(plane[row, column].astype(float))
        found[1].append(share[row, column] == 0.0)
        found[2].append(share[row, column] == 1.0)
    strips, count = _strips(pixels, spots, curves, side, len(scene.spotlights))
    bins = _Bins(pixels, np.stack(found[0]), np.stack(found[1]).astype(bool), np.stack(found[2]).astype(bool))
    return bins, strips, count, distance, float(np.mean(seen))


def _strips(
    pixels: Array, spots: NDArray[np.intp], curves: list[Array], side: int, spotlights: int
) -> tuple[NDArray[np.intp], int]:
    """Strips of equal angle about each patch's middle, about `_STRIP_BINS` wide on the outline."""
    perimeter = max(float(np.sum(np.linalg.norm(np.diff(c, axis=0, append=c[:1]), axis=1))) for c in curves)
    per_spot = max(8, int(perimeter / _STRIP_BINS))
    result = np.zeros(len(pixels), np.intp)
    for k in range(spotlights):
        mine = spots == k
        if not mine.any():
            continue
        middle = 0.5 * (pixels[mine].min(axis=0) + pixels[mine].max(axis=0))
        angle = np.arctan2(pixels[mine, 1] - middle[1], pixels[mine, 0] - middle[0]) + math.pi
        result[mine] = k * per_spot + np.minimum((angle * per_spot / (2.0 * math.pi)).astype(np.intp), per_spot - 1)
    return result, per_spot * spotlights


@dataclass(frozen=True)
class _Strips:
    information: Array  #: `[P, P]`
    gradient: Array  #: `[P]`
    gain: Array  #: `[count, 2, P]`
    start: Array  #: `[count, 2]`

    def levels(self, step: Array) -> Array:
        """Level and slope of every strip `[count, 2]` after `step`."""
        return np.asarray(self.start - self.gain @ step)


def _eliminate(
    jacobian: Array, data: Array, weights: Array, strips: NDArray[np.intp], count: int, offset: Array, precision: Array
) -> _Strips:
    """Normal equations with every strip's level and slope eliminated."""

    def sums(x: Array) -> Array:
        return np.asarray(np.bincount(strips, weights=x, minlength=count), float)

    wo = weights * offset
    a, b, d = sums(weights) + precision[0], sums(wo), sums(wo * offset) + precision[1]
    det = a * d - b * b
    columns = [*jacobian, data]
    right = np.stack([np.stack([sums(weights * x), sums(wo * x)]) for x in columns], axis=-1)  # [2, count, P + 1]
    solved = np.stack(
        [(d[:, None] * right[0] - b[:, None] * right[1]), (a[:, None] * right[1] - b[:, None] * right[0])]
    )
    solved /= det[:, None]
    weighted = jacobian * weights
    size = len(jacobian)
    cross = np.einsum("kcp,kcq->pq", right, solved)
    return _Strips(
        weighted @ jacobian.T - cross[:size, :size],
        weighted @ data - cross[:size, size],
        np.moveaxis(solved[:, :, :size], 0, 1),
        solved[:, :, size].T,
    )


def _levels(ratio: Array, usable: NDArray[np.bool_], strips: NDArray[np.intp], count: int) -> Array:
    """A first log albedo for every strip: the logarithm of its mean ratio of signal to predicted brightness."""
    total = np.bincount(strips, weights=np.where(usable, np.clip(ratio, 0.0, None), 0.0), minlength=count)
    number = np.bincount(strips, weights=usable, minlength=count)
    overall = max(float(total.sum() / max(number.sum(), 1.0)), 1e-9)
    mean = np.where(number > 0, total / np.maximum(number, 1.0), overall)
    return np.asarray(np.log(np.clip(mean, 0.05 * overall, 20.0 * overall)), float)


def _first_gain(signal: Array, usable: NDArray[np.bool_], irradiance: Array, light_: Array, offset: Array) -> float:
    """Log of the spotlights' intensity over the ambient irradiance from the band's two sides."""
    inside, outside = usable & (light_ > 0.0) & (offset < -1.0), usable & (light_ <= 0.0) & (offset > 1.0)
    if np.count_nonzero(inside) < 5 or np.count_nonzero(outside) < 5:
        return math.log(1e3 / max(float(light_.max(initial=0.0)), 1e-9))
    albedo = max(float(np.median(signal[outside] / irradiance[outside])), 1e-6)
    excess = float(np.median((signal[inside] / albedo - irradiance[inside]) / light_[inside]))
    return math.log(max(excess, 1e-3 / float(light_.max())))


def _slow_share(score: Array, brightness: Array, strips: NDArray[np.intp], count: int) -> float:
    """Power of the residuals' slow harmonics along the outline over that of independent strips, at least 1."""
    series = np.bincount(strips, weights=score * (brightness > 1.5), minlength=count)
    power = np.square(np.abs(np.fft.rfft(series)))
    if len(power) < 16 or not np.any(power > 0.0):
        return 1.0
    return float(np.clip(np.mean(power[3:12]) / max(float(np.mean(power[3:])), 1e-300), 1.0, 30.0))
