"""A robust start: the patch's outline at a low threshold above its surroundings, and the cone through the RCM for it.

Not Otsu: between a textured retina and a patch it may find the optic disc. A few per cent of the patch's own signal
above the surroundings lie above everything the ambient light shows.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from localize.forward import look
from localize.noise import linear_light
from localize.outline import outline_problem, start_pose
from localize.prior import Estimate, Knowns
from localize.profile import Profile
from localize.solve import minimize
from scene.pose import Pose
from scene.scene import Scene
from scene.spotlights import spotlight_axes

Array = NDArray[np.float64]
_FRACTION = 0.07  # of the signal above the surroundings
_FRACTIONS = (_FRACTION, 0.2, 0.35, 0.55)
_SEARCH_PX = 512  # side of the frame in which patches are searched
_USUAL_ALBEDO = 0.08
_CROP_PX = 140  # side of the crop in which outlines are drawn


@dataclass(frozen=True)
class Patch:
    """Where the light is, and what level its surroundings have."""

    low: tuple[int, int]  #: first row and column of the lit region [px]
    high: tuple[int, int]  #: one beyond the last
    surroundings: float  #: [white]
    peak: float  #: [white]


@dataclass(frozen=True)
class Start:
    """A first pose and the patch it explains."""

    pose: Pose
    patch: Patch
    misfit: float  #: root mean square distance of the outline from the cone, over the patch's width


def grey(image: NDArray[np.generic]) -> NDArray[np.generic]:
    """The image itself `[H, W]`, or the green channel of `[H, W, 3]`: patches are searched in one channel."""
    return image if image.ndim == 2 else image[..., 1]


def find_patch(image: NDArray[np.generic], scene: Scene, reference: NDArray[np.generic] | None = None) -> Patch | str:
    """The region lit by the spotlights in an image `[H, W]` or `[H, W, 3]`, or the reason why there is none."""
    side = image.shape[0]
    stride = -(-side // _SEARCH_PX)
    coarse = (slice(stride // 2, None, stride),) * 2
    small = _signal(image[coarse], scene)
    if reference is not None:
        small = small - _signal(reference[coarse], scene)
    smooth = cv2.blur(small, (3, 3))
    surroundings = float(np.median(small))
    noise = 1.4826 * float(np.median(np.abs(smooth - surroundings)))
    peak = float(smooth.max())
    rise = peak - surroundings
    if rise <= max(8.0 * noise, 1e-6):
        return "no spotlight stands out from its surroundings"
    level = surroundings + max(_FRACTION * rise, min(4.0 * noise, 0.3 * rise))
    count, labels, stats, _ = cv2.connectedComponentsWithStats((smooth > level).astype(np.uint8))
    if count < 2:
        return "no spotlight stands out from its surroundings"
    lit = np.flatnonzero(labels)
    label = labels.ravel()[lit].astype(np.intp)
    above = smooth.ravel()[lit] - surroundings
    light, brightest = np.bincount(label, weights=above, minlength=count), np.zeros(count)
    np.maximum.at(brightest, label, above)
    # the optic disc may be large but is dim, specks of glint are bright but small;
    # parts of a patch that vessels or the shaft cut apart are neither
    bright = brightest > 0.3 * rise
    box = stats[np.flatnonzero(bright & (light >= 0.03 * light[bright].max(initial=0.0)))]
    low = box[:, :2].min(axis=0)
    high = (box[:, :2] + box[:, 2:4]).max(axis=0)
    return Patch(
        (int(low[1]) * stride, int(low[0]) * stride),
        (min(side, int(high[1]) * stride), min(side, int(high[0]) * stride)),
        surroundings,
        peak,
    )


def find_start(image: NDArray[np.generic], scene: Scene, reference: NDArray[np.generic] | None = None) -> Start | str:
    """A first pose from an image `[H, W]` or `[H, W, 3]`, or the reason why there is none."""
    patch = find_patch(image, scene, reference)
    if isinstance(patch, str):
        return patch
    profile = Profile.of(scene.beam)
    # a hard edge that blur has spread crosses a low threshold outside the cone
    hard = profile.angle_at(0.5) > 0.97 * scene.beam.half_angle
    best: Start | str = "the patch is too small to measure"
    for fraction in _FRACTIONS[1:] if hard else _FRACTIONS:
        found = _at_level(image, scene, patch, reference, fraction)
        if isinstance(found, str):
            best = found if isinstance(best, str) else best
            continue
        if isinstance(best, str) or found.misfit < 0.7 * best.misfit:
            best = found
        # the disc beside a patch joins its outline at the lowest level only, and no cone explains the two
        if best.misfit < 0.02:
            break
    return best


def _at_level(
    image: NDArray[np.generic],
    scene: Scene,
    patch: Patch,
    reference: NDArray[np.generic] | None,
    fraction: float,
) -> Start | str:
    """The start from the outline at one level, a fraction of the signal above the surroundings."""
    pixels = _outline(image, scene, patch, reference, fraction)
    if isinstance(pixels, str):
        return pixels
    profile = Profile.of(scene.beam)
    half_angle = profile.angle_at(min(0.9, fraction))
    width = float(np.sqrt(np.mean(np.var(pixels, axis=0))))
    for _ in range(2):
        fitted = _fit(pixels, scene, half_angle)
        if isinstance(fitted, str):
            return fitted
        pose, misfit = fitted
        if patch.peak < 0.98:
            break
        half_angle = profile.angle_at(_clipped_level(fraction, scene, pose))
    return Start(pose, patch, misfit / width)


def _signal(pixels: NDArray[np.generic], scene: Scene) -> NDArray[np.float32]:
    """Light in one channel; where that is dark in a colour image, what the brightest channel shows."""
    light = linear_light(pixels, scene)[0]
    return light if light.ndim == 2 else light.max(axis=2)


def _outline(
    image: NDArray[np.generic],
    scene: Scene,
    patch: Patch,
    reference: NDArray[np.generic] | None,
    fraction: float,
) -> Array | str:
    """Points on the patch's hull or hulls `[N, 2]` [px] at `fraction` of the signal above the surroundings."""
    side = image.shape[0]
    margin = max(12, int(0.15 * max(patch.high[0] - patch.low[0], patch.high[1] - patch.low[1])))
    r0, c0 = max(0, patch.low[0] - margin), max(0, patch.low[1] - margin)
    r1, c1 = min(side, patch.high[0] + margin), min(side, patch.high[1] + margin)
    b = max(1, max(r1 - r0, c1 - c0) // _CROP_PX)
    h, w = (r1 - r0) // b, (c1 - c0) // b
    crop = (slice(r0, r0 + h * b), slice(c0, c0 + w * b))
    light = _signal(image[crop], scene)
    if reference is not None:
        light = light - _signal(reference[crop], scene)
    light = np.asarray(
        cv2.GaussianBlur(cv2.resize(light, (w, h), interpolation=cv2.INTER_AREA), (0, 0), 0.8), np.float32
    )
    peak = float(np.quantile(light, 0.99))
    rise = max(peak - patch.surroundings, 1e-6)
    mask = (light > patch.surroundings + fraction * rise).astype(np.uint8)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    areas = np.array([cv2.contourArea(c) for c in contours])
    if not len(areas) or areas.max() < 12.0:
        return "the patch is too small to measure"
    single = len(scene.spotlights) == 1
    kept = [c for c, a in zip(contours, areas, strict=True) if a >= (0.1 if single else 0.05) * areas.max()]
    outlines = [np.concatenate(kept)] if single else kept
    points = [_dense_hull(o.reshape(-1, 2).astype(float)) for o in outlines]
    edge = np.concatenate(points)
    # bins that touch the frame's border cut the patch: there the hull is no outline
    full = np.array([c0, r0]) + (edge + 0.5) * b
    inside = np.all((full > 1.5 * b + 1.0) & (full < side - 1.5 * b - 1.0), axis=1)
    if np.count_nonzero(inside) < 12:
        return "the patch leaves the frame"
    return full[inside]


def _dense_hull(points: Array) -> Array:
    """The convex hull of contour points, grown by the half pixel a contour runs inside, as points about 1 px apart."""
    hull = cv2.convexHull(points.astype(np.float32)).reshape(-1, 2).astype(float)
    centre = points.mean(axis=0)
    nxt = np.roll(hull, -1, axis=0)
    length = np.linalg.norm(nxt - hull, axis=1)
    parts = [a + np.linspace(0.0, 1.0, max(1, int(n)), endpoint=False)[:, None] * (e - a)
             for a, e, n in zip(hull, nxt, length, strict=True)]  # fmt: skip
    dense = np.concatenate(parts)
    out = dense - centre
    return dense + 0.5 * out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)


def _fit(pixels: Array, scene: Scene, half_angle: float) -> tuple[Pose, float] | str:
    """The cone through the RCM that fits outline points, and its misfit [px]."""
    spots = np.zeros(len(pixels), np.intp)
    pose = start_pose(pixels, spots, scene, half_angle)
    if pose is None:
        return "the patch is not on the retina"
    roll = len(scene.spotlights) > 1
    size, estimate = 6 if roll else 5, Estimate(pose, scene, half_angle)
    sigma = scene.camera.resolution / 1000.0
    solution = None
    for _ in range(6 if roll else 1):
        keep = np.ones(len(pixels), bool)
        if roll:
            spots, keep = nearest_outline(pixels, estimate)
        solution = minimize(
            outline_problem(pixels[keep], spots[keep], sigma, scene, Knowns(rcm_sigma_mm=1e-3), roll=roll),
            estimate, size, (), tolerance=1e-5, iterations=12 if not roll else 6,
        )  # fmt: skip
        if solution is None or scene.depth(solution.estimate.pose.apex) <= 0.0:
            return "no cone through the remote centre of motion explains the patch"
        estimate = solution.estimate
    assert solution is not None
    return estimate.pose, float(np.sqrt(np.mean(np.square(solution.residuals)))) * sigma


def nearest_outline(pixels: Array, estimate: Estimate) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Which cone's outline each pixel `[N, 2]` [px] lies nearest to, and whether no other cone covers it."""
    to = look(estimate.scene, pixels).points - estimate.pose.apex
    to /= np.linalg.norm(to, axis=1, keepdims=True)
    axes = spotlight_axes(estimate.pose, estimate.scene.spotlights)
    off = np.arccos(np.clip(to @ axes.T, -1.0, 1.0)) - estimate.half_angle
    nearest = np.argmin(np.abs(off), axis=1)
    others = off.copy()
    others[np.arange(len(off)), nearest] = math.inf
    return nearest, others.min(axis=1) > 0.0


def _clipped_level(fraction: float, scene: Scene, pose: Pose) -> float:
    """The threshold as a fraction of a clipped patch's true peak, from the power and a usual albedo of the fundus."""
    white = getattr(scene.sensor, "white", None)
    if white is None:
        return fraction
    toward = scene.eye.intersect(pose.apex, pose.axis)
    peak = _USUAL_ALBEDO / math.pi * scene.power.axial_intensity(scene.beam) / (float(toward) * 1e-3) ** 2
    return min(fraction, fraction * white / max(peak, 1e-9))
