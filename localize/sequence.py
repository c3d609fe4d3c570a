"""A sequence over one retina: the patch moves, the retina stays, so every frame shows what another one hides.

`AmbientMap` gathers, pixel by pixel, what the frames show outside their own patches; that is the ambient view of the
retina, and serves as the reference frame of `photometric`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.image import AnyImage, Frame, Reference, white_level
from conespot.localize.model.deep import Deep
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.view import outlines
from conespot.localize.outcome import LocalizationFailure, Outcome
from conespot.localize.photometric import photometric
from conespot.localize.start.search import find_start
from conespot.scene.document import InputError
from conespot.scene.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SequenceSettings:
    """Tuned numbers of learning the ambient view."""

    #: kept out around a patch, over its size, and beside [px]: a start is good to a twentieth of it, and light of a
    #: patch in the view of the retina would be taken for albedo
    margin: float = 0.25
    margin_px: float = 3.0
    #: share of the light from under the retina that may come back beyond that
    glow: float = 0.05
    #: frames without which there is no view: one hides what its own patch covers
    fewest: int = 2


SEQUENCE = SequenceSettings()


class AmbientMap:
    """The mean of what frames show outside their patches; memory is two frames, however many are added.

    A camera that meters each frame shows the same retina at another level in each. Summed light over summed levels is
    the mean that no seam betrays, and the one of least noise.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._black = scene.sensor.black_level
        self._white = 1.0
        deep = Deep.of(scene)
        reach = 0.0 if deep is None else max(kernel.reach(SEQUENCE.glow) for kernel in deep.kernels)
        self._glow = reach / scene.camera.pixel_pitch  # how far beyond an outline light comes back [px]
        self._sum: NDArray[np.float32] | None = None
        self._levels = np.zeros(scene.camera.shape, np.float32)
        self._added: list[float] = []

    def add(self, image: AnyImage) -> bool:
        """Add a checked frame; False, and nothing added, if no patch can be found in it to leave out."""
        start = find_start(Frame(image, self._scene.sensor), self._scene)
        if isinstance(start, LocalizationFailure):
            return False
        points = outlines(Estimate(start.pose, self._scene))
        if not len(points):
            return False
        if self._sum is None:
            self._sum = np.zeros(image.shape, np.float32)
            if image.dtype.kind == "f":
                self._black /= self._scene.sensor.full_scale
            else:
                self._white = float(white_level(image, self._scene.sensor))
        elif self._sum.shape != image.shape:
            raise InputError(f"sequence: a frame of shape {image.shape} after frames of {self._sum.shape}")
        margin = SEQUENCE.margin * float(np.max(np.ptp(points, axis=0))) + SEQUENCE.margin_px + self._glow
        low = np.floor(points.min(axis=0) - margin).astype(int).clip(0)
        high = np.ceil(points.max(axis=0) + margin).astype(int)
        hidden = (slice(low[1], high[1]), slice(low[0], high[0]))
        light = image.astype(np.float32) - np.float32(self._black)
        stride = max(1, max(image.shape[:2]) // 500)
        coarse = np.ones(image.shape[:2], bool)
        coarse[hidden] = False
        level = float(np.median(light[::stride, ::stride][coarse[::stride, ::stride]]))
        if not level > 0.0:  # no light but the spotlights': nothing to learn
            return False
        light[hidden] = 0.0
        self._sum += light
        self._levels += np.float32(level) * coarse
        self._added.append(level)
        return True

    def reference(self) -> Reference | None:
        """The ambient view at the frames' mean level, and how many frames its pixels are worth in the median.

        Pixels that no frame shows unlit get the median of the others. None if fewer than two frames were added.
        """
        if self._sum is None or len(self._added) < SEQUENCE.fewest:
            return None
        seen = self._levels > 0.0
        mean = float(np.mean(self._added))
        scale = np.float32(mean) / np.where(seen, self._levels, np.float32(1.0))
        view = self._sum * (scale if self._sum.ndim == 2 else scale[..., None])
        if not seen.all():
            view[~seen] = np.median(view[seen][:: max(1, int(seen.sum()) // 100_000)], axis=0)
        pixels = (view + np.float32(self._black)) / np.float32(self._white)
        return Reference(pixels.astype(np.float32), float(np.median(self._levels[seen])) / mean)


@dataclass(frozen=True)
class SequenceResult:
    """One outcome a frame, in the order of the frames, and how many frames the ambient view was learnt from."""

    outcomes: tuple[Outcome, ...]
    learnt_from: int


def locate_sequence(
    frames: Callable[[], Iterable[AnyImage]],
    scene: Scene,
    *,
    knowns: Knowns | None = None,
    noise: NoiseModel | None = None,
) -> SequenceResult:
    """`photometric` on every frame, with the retina's albedo learnt from all of them.

    `frames` is called twice and gives the checked frames `[H, W]` or `[H, W, 3]` each time, so that a sequence need not
    fit into memory. An 8-bit frame's mean is taken before its transfer is undone: the retina's ambient light varies too
    little within a pixel for that to matter. Raises InputError for frames of different shapes.
    """
    ambient = AmbientMap(scene)
    learnt = sum(ambient.add(image) for image in frames())
    view = ambient.reference()
    sensor = noise or scene.sensor.noise
    outcomes = [photometric(image, scene, knowns=knowns, reference=view, noise=sensor) for image in frames()]
    return SequenceResult(tuple(outcomes), learnt)
