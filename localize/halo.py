"""Light around a patch that falls off slowly, as light from under the retina does: of which a scene may say nothing.

A beam's light ends at its rim, and glare and interreflection are even around it. What the retina reflects varies from
place to place, but not brighter on all sides next to the patch than farther out, by a part of the patch's own light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.image import Frame, Reference
from conespot.localize.model.deep import Deep
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.residual import median, quantile
from conespot.localize.model.view import edge_width, outline
from conespot.scene.retina import Fundus, Spread
from conespot.scene.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class HaloSettings:
    """What of a frame is looked at, and what counts."""

    #: rings around an outline, over its radius: next to it, and beyond most of what glows
    near: tuple[float, float] = (1.15, 1.5)
    far: tuple[float, float] = (2.2, 3.2)
    #: standard deviations of what spreads the image by which the nearer one is farther out
    widths: float = 4.0
    sectors: int = 8
    #: of them, without which there is nothing to tell
    fewest: int = 5
    #: pixels that a sector of a ring must show
    pixels: int = 12
    #: points of an outline, and places looked at across the rings
    points: int = 32
    across: int = 64
    #: least excess of the near ring over the far one in the darkest sector but one, over the patch's own light, and
    #: over the far ring. Of 1,080 frames without deep light none has more than 0.0012 and 1.06, and of 110 with it none
    #: less than 0.008 and 1.20 (frames of the image model, hard and soft, even and of living eyes, 2 % ambient light);
    #: one on a retina mottled by 20 % has 0.0027 and 1.09 and does not glow, a rendered patch on an optic disc 0.0036
    #: and 1.55, a start too large by what glows less than 1.12
    excess: float = 0.004
    brighter: float = 1.08


HALO = HaloSettings()


def glowing(scene: Scene) -> Scene | None:
    """The same with the usual light from under the retina, where it says nothing of that and there would be some."""
    if Deep.of(scene) is not None:
        return None
    retina = scene.retina if isinstance(scene.retina, Fundus) else Fundus()
    if retina.spread is not None:
        return None
    there = scene.model_copy(update={"retina": retina.model_copy(update={"spread": Spread(), "glint": None})})
    return None if Deep.of(there) is None else there


def glows(frame: Frame, estimate: Estimate, reference: Reference | None) -> bool:
    """Whether a patch goes on beyond its rim on all sides, and fades."""

    def beyond(width: float) -> bool:
        found = halo(frame, estimate, reference, width)
        return found is not None and found[0] > HALO.excess and found[1] > HALO.brighter

    return beyond(0.0) and ((width := edge_width(estimate)) == 0.0 or beyond(width))


def halo(frame: Frame, estimate: Estimate, reference: Reference | None, width: float) -> tuple[float, float] | None:
    """Excess of the ring near the outlines over a farther one in the darkest sector but one, None if not to be told.

    Over the patch's own light, and over the far ring. Edges are `width` [px] wide.
    """
    scene = estimate.scene
    curves = [outline(estimate, k, HALO.points) for k in range(len(scene.spotlights))]
    curves = [curve for curve in curves if len(curve) > 2]
    if not curves:
        return None
    every = np.concatenate(curves)
    middles = [0.5 * (curve.min(axis=0) + curve.max(axis=0)) for curve in curves]
    size = max(float(np.max(np.ptp(curve, axis=0))) for curve in curves) / 2.0
    low = np.clip(every.min(axis=0) - HALO.far[1] * size, 0, scene.camera.shape[::-1]).astype(int)
    high = np.clip(every.max(axis=0) + HALO.far[1] * size, 0, scene.camera.shape[::-1]).astype(int)
    step = max(1, int(np.max(high - low)) // HALO.across)
    rows, columns = slice(int(low[1]), int(high[1]), step), slice(int(low[0]), int(high[0]), step)
    light = frame.signal(rows, columns).astype(float).mean(axis=2)
    if reference is not None:
        ground = Frame(reference.pixels, scene.sensor).signal(rows, columns).astype(float).mean(axis=2)
        level = float(np.median(ground))
        if level > 0.0:  # a black one says nothing
            light = light / np.maximum(ground, 1e-3 * level)
    y, x = np.mgrid[rows, columns] + 0.5
    shows = scene.camera.shows(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(x.shape)
    factor, sector = np.full(x.shape, np.inf), np.zeros(x.shape, int)
    wide = HALO.near[0] + HALO.widths * width / size
    for curve, middle in zip(curves, middles, strict=True):
        away = curve - middle
        turn = np.arctan2(away[:, 1], away[:, 0])
        order = np.argsort(turn)
        there = np.arctan2(y - middle[1], x - middle[0])
        radius = np.interp(there, turn[order], np.linalg.norm(away, axis=1)[order], period=2.0 * math.pi)
        own = np.hypot(x - middle[0], y - middle[1]) / radius
        closer = own < factor
        factor[closer] = own[closer]
        sector[closer] = ((there[closer] / (2.0 * math.pi) + 0.5) * HALO.sectors).astype(int) % HALO.sectors
    patch = light[factor < 0.6]
    near = (factor > wide) & (factor < wide + HALO.near[1] - HALO.near[0])
    far = (factor > HALO.far[0]) & (factor < HALO.far[1])
    pairs = []
    for k in range(HALO.sectors):
        rings = [light[shows & ring & (sector == k)] for ring in (near, far)]
        if min(map(len, rings)) >= HALO.pixels:
            pairs.append([median(ring) for ring in rings])
    if len(pairs) < HALO.fewest or not len(patch):
        return None
    close, beyond = np.array(pairs).T
    own = quantile(patch, 0.9) - median(beyond)
    return float(np.sort(close - beyond)[1]) / max(own, 1e-12), float(np.sort(close / np.maximum(beyond, 1e-12))[1])
