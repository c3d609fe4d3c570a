"""Rays across the outline of a patch: where the log light's gradients are those of the beam's own edge."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import i0e

from conespot.localize.image import Signal
from conespot.localize.model.deep import Deep
from conespot.localize.model.occlusion import covered
from conespot.localize.model.profile import Profile
from conespot.localize.model.residual import median
from conespot.localize.start.rings import Overview
from conespot.localize.start.settings import START
from conespot.scene.beam import Beam
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.spread import WIDTHS

Array = NDArray[np.float64]
#: where a beam's profile is tabulated, over its half angle: finer than any ray is sampled
_FRACTIONS = np.linspace(0.0, 2.5, 501)


@dataclass(frozen=True)
class Rays:
    """What rays across one spotlight's outline see."""

    spotlight: int
    middle: Array  #: `[2]` [px]
    ends: Array  #: where the rays meet the outline `[N, 2]` [px]
    left: Array  #: sums of absolute gradients without the light of the outline moved by `START.shifts` `[N, S]`
    total: Array  #: sums of absolute gradients `[N]`

    def found(self) -> tuple[Array, Array]:
        """Where each ray sees the outline `[N, 2]` [px], and the share of its gradients that says so `[N]`."""
        shifts = START.shifts
        row, k = np.arange(len(self.left)), np.argmin(self.left, axis=1)
        inner = np.clip(k, 1, len(shifts) - 2)
        below, here, above = (self.left[row, inner + j] for j in (-1, 0, 1))
        # sums of absolute values have a pointed minimum
        tip = 0.5 * (below - above) / np.maximum(np.maximum(below, above) - here, 1e-9)
        shift = shifts[inner] + np.clip(tip, -0.5, 0.5) * (shifts[1] - shifts[0])
        worth = np.where(k == inner, 1.0 - here / np.maximum(self.total, 1e-6), 0.0)
        return self.middle + (1.0 + shift)[:, None] * (self.ends - self.middle), worth


def support(seen: Sequence[Rays]) -> tuple[float, float, float]:
    """What the outlines as they are explain of the gradients along the rays; a ray that sees another counts 0.

    The mean share, the share that a quarter of the rays exceed, and the mean sum, which is what a ray adds to the
    log-likelihood.
    """
    middle = START.most_shift
    total = np.concatenate([rays.total for rays in seen])
    left = np.concatenate([rays.left for rays in seen])
    here = np.abs(np.argmin(left, axis=1) - middle) <= 1
    explained = here * np.maximum(total - left[:, middle], 0.0)
    share = explained / np.maximum(total, 1e-6)
    return float(np.mean(share)), float(np.quantile(share, 0.75)), float(np.mean(explained))


def rays_across(overview: Overview, scene: Scene, pose: Pose, *, thorough: bool = False) -> list[Rays]:
    """The rays across the outlines of the spotlights of which enough is in the frame.

    `thorough` doubts the contrast between what lies inside and outside the outline.
    """
    curves = [scene.camera.project(scene.outline(pose, k, START.rays)) for k in range(len(scene.spotlights))]
    found = [
        _across(overview, scene, pose, curves, k, thorough)
        for k, curve in enumerate(curves)
        if np.all(np.isfinite(curve))
    ]
    return [rays for rays in found if rays is not None]


def _across(
    overview: Overview, scene: Scene, pose: Pose, curves: Sequence[Array], spotlight: int, thorough: bool
) -> Rays | None:
    curve = curves[spotlight]
    along = START.along
    needed = len(along) - START.samples_missed
    last = np.array(overview.light.shape[::-1]) - 1.0
    bins = curve / overview.step - 0.5
    middle = bins.mean(axis=0)
    at = middle + along[None, :, None] * (bins - middle)[:, None, :]
    valid = np.all((at >= 0.0) & (at <= last), axis=2)
    if scene.instrument.shaft is not None:
        pixels = ((at + 0.5) * overview.step).reshape(-1, 2)
        clear = valid & ~covered(pixels, pose, scene, side=overview.step).reshape(valid.shape)
        # a pose far off does not tell where the shaft is
        valid = clear if np.count_nonzero(clear[:, :needed].all(axis=1)) >= START.fewest_rays else valid
    use = valid[:, :needed].all(axis=1)
    if np.count_nonzero(use) < START.fewest_rays:
        return None
    at, valid = at[use], valid[use]
    size = float(np.mean(np.linalg.norm(bins - middle, axis=1)))
    blur = max(START.least_blur, START.ray_blur * size)
    light = _sampled(overview.light, at, blur)
    ground = None if overview.reference is None else _sampled(overview.reference, at, blur)
    log = overview.logarithm(light, ground).astype(float)
    core = along < START.inside
    inside, outside = (median(log[:, part]) for part in (core, along > START.outside))
    radius = size * overview.step * scene.camera.pixel_pitch
    profile = glowing(scene.beam, Deep.of(scene), radius)
    there, beyond = (
        float(np.interp(0.5 * (a + b), _FRACTIONS, profile))
        for a, b in ((along[0], START.inside), (START.outside, along[-1]))
    )
    contrast = _contrast(max(START.least_contrast, inside - outside), there, beyond)
    clipped = float(np.mean(light[:, core] > START.white)) > START.clipped_share
    doubts = START.clipped_contrasts if clipped else START.doubted_contrasts if thorough else (1.0,)
    # white over the surroundings; where a reference divides the light, it divides white too
    unlit = 1.0 if ground is None else float(np.median(ground[:, core])) + overview.floor
    dark = math.exp(outside) / (1.0 + contrast * beyond)
    ceiling = (1.0 + overview.floor) / (unlit * dark) if clipped else math.inf
    kept = valid[:, 1:].astype(float)
    steps = np.diff(log, axis=1) * kept
    elsewhere = [other / overview.step - 0.5 for k, other in enumerate(curves) if k != spotlight]

    def unexplained(width: float) -> Array:
        """What the gradients are without the light of an image blurred so far, over the outline's size `[N, S]`."""
        kernel = _kernel(round(min(START.widest_blur, width), 2))
        blurred = np.convolve(profile, kernel, "same")
        others = [_within(at, other, blurred) for other in elsewhere]
        tried = []
        for factor in doubts:
            bright = np.convolve(np.minimum(1.0 + factor * contrast * profile, ceiling), kernel, "same")
            model = np.interp(along / (1.0 + START.shifts[:, None]), _FRACTIONS, bright)[None]
            if others:
                model = np.minimum(model + factor * contrast * np.sum(others, axis=0)[:, None], ceiling)
            tried.append(np.abs(steps[:, None] - np.diff(np.log(model), axis=2) * kept[:, None]).sum(axis=2))
        return min(tried, key=_least)

    total = np.abs(steps).sum(axis=1)
    sampling = math.hypot(blur, START.sampling_blur) / size
    left = unexplained(sampling)
    if _least(left) > START.doubted * float(total.sum()):
        # nobody knows how sharp the image is: a wider blur must say so clearly
        wider = min((unexplained(math.hypot(sampling, width)) for width in START.image_blurs), key=_least)
        left = wider if _least(wider) < START.clearly * _least(left) else left
    return Rays(spotlight, (middle + 0.5) * overview.step, curve[use], left, total)


def _least(left: Array) -> float:
    """What every ray leaves where it leaves least, all rays together."""
    return float(left.min(axis=1).sum())


def _contrast(step: float, there: float, beyond: float) -> float:
    """The spotlight over the ambient light, from the step of the log light between two values of the profile."""
    # (1 + k there) / (1 + k beyond) = e^step; a step that no contrast makes is as one without any ambient light
    ratio = math.exp(step)
    return (ratio - 1.0) / max(START.darkest_profile, there - ratio * beyond)


def _within(at: Array, curve: Array, profile: Array) -> Array:
    """The light `[...]` of another spotlight at points `[..., 2]`, from where they lie within its outline."""
    middle = curve.mean(axis=0)
    if not np.all(np.isfinite(middle)):
        return np.zeros(at.shape[:-1])
    edge, off = curve - middle, at - middle
    angle = np.arctan2(edge[:, 1], edge[:, 0])
    radius = np.interp(
        np.arctan2(off[..., 1], off[..., 0]), np.sort(angle), np.hypot(*edge.T)[np.argsort(angle)], period=2.0 * math.pi
    )
    return np.interp(np.hypot(off[..., 0], off[..., 1]) / radius, _FRACTIONS, profile)


def _sampled(plane: Signal, at: Array, blur: float) -> Signal:
    """The blurred plane at points `[..., 2]` in its pixels' indices."""
    sides = np.array(plane.shape[::-1])
    low = np.clip(np.floor(at.min(axis=(0, 1))).astype(int) - 3, 0, sides - 2)
    high = np.clip(np.ceil(at.max(axis=(0, 1))).astype(int) + 4, 2, sides)
    crop = cv2.GaussianBlur(plane[low[1] : high[1], low[0] : high[0]], (0, 0), blur)
    x, y = (np.ascontiguousarray(at[..., k] - low[k], np.float32) for k in (0, 1))
    return np.asarray(cv2.remap(crop, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)


@lru_cache(maxsize=8)
def _profile(beam: Beam) -> Array:
    """The beam's profile at `_FRACTIONS` of its half angle."""
    profile = Profile.of(beam)
    angle = _FRACTIONS * profile.half_angle
    return profile.value(np.cos(angle) if profile.cosine else -angle)


def glowing(beam: Beam, deep: Deep | None, radius: float) -> Array:
    """The profile of a patch of `radius` [mm] on the retina at `_FRACTIONS` of it, with light from under the retina."""
    if deep is None:
        return _profile(beam)
    share = float(deep.shares.max())
    kernel = deep.kernels[int(np.argmax(deep.shares))]
    # patches are alike in steps of 5 %
    steps = round(math.log(max(radius, 1e-3)) / 0.05)
    return _glowing(beam, round(share, 3), tuple(kernel.parts.tolist()), round(kernel.length, 3), steps)


@lru_cache(maxsize=256)
def _glowing(beam: Beam, share: float, parts: tuple[float, ...], length: float, steps: int) -> Array:
    local = _profile(beam)
    coarse = np.linspace(0.0, _FRACTIONS[-1], 76)
    middle = 0.5 * (coarse[1:] + coarse[:-1])
    ring = coarse[1] - coarse[0]
    light = np.interp(middle, _FRACTIONS, local)
    deep = np.zeros(len(middle))
    for part, width in zip(parts, length * WIDTHS / math.exp(0.05 * steps), strict=True):
        # what a Gaussian makes of a ring of light, seen at another radius (Rice's distribution)
        width = max(width, 0.5 * ring)
        near = np.exp(-0.5 * np.square((middle[:, None] - middle) / width)) * i0e(middle[:, None] * middle / width**2)
        deep += part * (near * middle * ring / width**2) @ light
    return np.asarray((1.0 - share) * local + share * np.interp(_FRACTIONS, middle, deep))


@lru_cache(maxsize=8)
def rim(beam: Beam) -> float:
    """Where a patch's rim seems to be, over the half angle: the mean place of the log light's gradients."""
    drop = -np.diff(np.log1p(START.rim_contrast * _profile(beam)))
    return float(np.sum(drop * 0.5 * (_FRACTIONS[1:] + _FRACTIONS[:-1])) / np.sum(drop))


@lru_cache(maxsize=64)
def _kernel(blur: float) -> Array:
    """A Gaussian of `blur` over `_FRACTIONS`, of sum 1."""
    width = max(0.1, blur / (_FRACTIONS[1] - _FRACTIONS[0]))
    reach = int(3.0 * width) + 1
    kernel = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) / width))
    return np.asarray(kernel / kernel.sum())
