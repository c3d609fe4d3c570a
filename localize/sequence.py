"""A sequence over one retina: the patch moves, the retina stays, so every frame shows what another one hides.

`AmbientMap` gathers, pixel by pixel, what the frames show outside their own patches; that is the ambient view of the
retina, and serves as the reference frame of `photometric`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from localize.image import Reference, white_level
from localize.noise import NoiseModel, noise_of
from localize.outcome import Outcome
from localize.photometric import photometric
from localize.prior import Estimate, Knowns
from localize.start import find_start
from localize.view import outlines
from scene.document import InputError
from scene.scene import Scene

Array = NDArray[np.float64]
_MARGIN = 0.25  # of a patch's size, kept out around it: a start is good to a twentieth


class AmbientMap:
    """The mean of what frames show outside their patches; memory is two frames, however many are added."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._sum: NDArray[np.float32] | None = None
        self._white = np.float32(1.0)
        side = scene.camera.resolution
        self._count = np.zeros((side, side), np.uint16)

    def add(self, image: NDArray[np.generic]) -> bool:
        """Add a checked frame; False, and nothing added, if no patch can be found in it to leave out."""
        start = find_start(image, self._scene)
        if isinstance(start, str):
            return False
        points = outlines(Estimate(start.pose, self._scene))
        if not len(points):
            return False
        if self._sum is None:
            self._sum = np.zeros(image.shape, np.float32)
            self._white = np.float32(1.0 if image.dtype.kind == "f" else white_level(image, self._scene))
        elif self._sum.shape != image.shape:
            raise InputError(f"sequence: a frame of shape {image.shape} after frames of {self._sum.shape}")
        margin = _MARGIN * float(np.max(np.ptp(points, axis=0))) + 3.0
        low = np.floor(points.min(axis=0) - margin).astype(int).clip(0)
        high = np.ceil(points.max(axis=0) + margin).astype(int)
        hidden = (slice(low[1], high[1]), slice(low[0], high[0]))
        kept = self._sum[hidden].copy()
        self._sum += image.astype(np.float32)
        self._sum[hidden] = kept
        self._count += 1
        self._count[hidden] -= 1
        return True

    def reference(self) -> Reference | None:
        """The ambient view, a mean over as many frames as show the pixels in the median.

        Pixels that no frame shows unlit get the median of the others. None if fewer than two frames were added.
        """
        if self._sum is None or int(self._count.max()) < 2:
            return None
        count = self._count if self._sum.ndim == 2 else self._count[..., None]
        view = self._sum / np.maximum(count, 1)
        seen = self._count > 0
        if not seen.all():
            view[~seen] = np.median(view[seen][:: max(1, int(seen.sum()) // 100_000)], axis=0)
        return Reference((view / self._white).astype(np.float32), float(np.median(self._count[seen])))


@dataclass(frozen=True)
class SequenceResult:
    """One outcome a frame, in the order of the frames, and how many frames the ambient view was learnt from."""

    outcomes: tuple[Outcome, ...]
    learnt_from: int


def locate_sequence(
    frames: Callable[[], Iterable[NDArray[np.generic]]],
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
    sensor = noise or noise_of(scene)
    outcomes: list[Outcome] = []
    for image in frames():
        if view is None:
            outcomes.append(photometric(image, scene, knowns=knowns, noise=sensor))
            continue
        outcomes.append(
            photometric(image, scene, knowns=knowns, reference=view.pixels, frames=view.frames, noise=sensor)
        )
    return SequenceResult(tuple(outcomes), learnt)
