"""The exporter: units measured once more as the bench does, with every image kept as the sensor recorded it."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from conespot.campaigns.bench import Bench
from conespot.campaigns.frame_names import FrameNames
from conespot.campaigns.plan import Plan, Unit
from conespot.campaigns.row import Record
from conespot.localize.image import AnyImage
from conespot.render.frame_file import write_frame
from conespot.scene import InputError
from conespot.scene.atomic import write_atomically


def make_exporter(names: FrameNames, plan: Plan, folder: Path | None) -> Exporter:
    """What measures in a worker's process, and writes into `folder`."""
    assert folder is not None
    return Exporter(names, plan, folder)


class Exporter:
    """Measures units of a plan, and keeps what localizers are given: `images/NAME.png`, and `NAME-unlit.exr`."""

    def __init__(self, names: FrameNames, plan: Plan, folder: Path) -> None:
        self._names, self._folder = names, folder
        self._bench = Bench(plan, None)
        self.variant = self._bench.variant

    @property
    def worn(self) -> bool:
        """True when the process should make room for a fresh one."""
        return self._bench.worn

    def measure(self, unit: Unit) -> Record:
        """The unit's record, which says whether the images are those that the run saw."""
        findings = []
        for case, image, unlit in self._bench.given(unit):
            findings += self._bench.findings(unit, case, image, unlit)
            path = self._folder / self._names.image(case, unit.pose)
            if unlit is not None:
                pixels = unlit.pixels if unlit.pixels.ndim == 3 else unlit.pixels[..., None]
                write_frame(self._folder / self._names.unlit(case, unit.pose), pixels, {})
            write_atomically(path, png(image, path), "--frames")
        return Record(unit=unit.key, findings=tuple(findings))


def png(image: AnyImage, path: Path) -> bytes:
    """Pixel values `[H, W]` or `[H, W, 3]` (RGB) of 8 or 16 bits as PNG, none changed. Raises InputError."""
    pixels = np.ascontiguousarray(image[..., ::-1] if image.ndim == 3 else image)
    ready, data = cv2.imencode(".png", pixels)
    if not ready or pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: {image.shape[-1]} channels of {image.dtype} cannot be written as PNG")
    return data.tobytes()
