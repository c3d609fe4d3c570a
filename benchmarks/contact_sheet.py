"""Frames of one pose side by side, as docs show them: a column for each light, a row for each world, with their names.

Run with `python benchmarks/contact_sheet.py NAME [OUT.png]`, NAME one of `SHEETS`; without OUT.png it writes
docs/NAME.png. A sheet is a shipped campaign with some of its keys set anew. Linear values are shown through sRGB's
curve, each frame from its darkest to its brightest.
"""

from __future__ import annotations

import argparse
import io
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from conespot.campaigns.bench import Bench
from conespot.campaigns.plan import Unit, make_plan
from conespot.campaigns.schema import override, read_campaign
from conespot.results.style import style
from conespot.scene.atomic import write_atomically
from conespot.scene.srgb import encoded

Image = NDArray[np.float64]


@dataclass(frozen=True)
class Sheet:
    """A picture of docs."""

    settings: dict[str, str]  #: of campaigns/reality.yaml, as --set takes them
    whole: bool  #: show the whole frame beside the patch
    around: float  #: of a patch that is shown, in widths of it


#: of the helix
POSE = 3
TREMOR = "{kind: tremor, rms: 0.182 mm, frequency: 9 Hz, bandwidth: 2 Hz, frame_rate: 60 Hz}"
SHEETS = {
    "theatre": Sheet(
        {
            "sweep.effect": "{ideal: {}, theatre: {scene: theatre}}",
            "scene.camera.resolution": "[960, 540]",
        },
        whole=True, around=1.6,
    ),
    "tissue": Sheet(
        {
            "sweep.light": "{532 nm: {scene.illumination: {kind: line, wavelength: 532 nm, width: 2 nm}}, "
            "850 nm: {scene.illumination: {kind: line, wavelength: 850 nm, width: 2 nm}, scene.power.value: 0.08 mW}}",
            "sweep.effect": "{without spread: {}, with spread: {scene.retina.spread: {scattering: 1}}}",
            "scene.camera.resolution": "[960, 540]",
        },
        whole=False, around=2.4,
    ),
    "source_motion": Sheet(
        {
            "sweep.light": "{white: {scene.illumination: led-b3, scene.power.value: 0.05 mW}}",
            "sweep.effect": "{a point at rest: {}, a core of 100 um: {scene.beam.source_diameter: 0.1 mm}, "
            "'10 mm/s over 16 ms': {scene.motion: {kind: velocity, velocity: [10 mm/s, 0 mm/s, 0 mm/s]}, "
            "scene.sensor.exposure_time: 16 ms}, "
            f"core and tremor over 50 ms: {{scene.beam.source_diameter: 0.1 mm, scene.motion: {TREMOR}, "
            "scene.sensor.exposure_time: 50 ms}}",
        },
        whole=False, around=1.6,
    ),
}  # fmt: skip


def frames(sheet: Sheet) -> dict[tuple[str, str], Image]:
    """The frames of a sheet by light and effect, linear, of full scale."""
    document = read_campaign("reality")
    for key, value in sheet.settings.items():
        document = override(document, key, value, "contact sheet")
    plan = make_plan(document)
    bench, found = Bench(plan, None), {}
    for number, group in enumerate(plan.groups):
        for case in group.cases:
            image = bench.frame(Unit(number, POSE, group.unit(POSE)), case)
            found[str(case.swept["light"]), str(case.swept["effect"])] = image / case.scene.sensor.full_scale
    return found


def patch(image: Image, around: float) -> Image:
    """The square about a frame's brightest blob, in widths of it."""
    smooth = cv2.GaussianBlur(image, (0, 0), image.shape[1] / 80.0)
    top = np.unravel_index(np.argmax(smooth), smooth.shape)
    _, marks, boxes, middles = cv2.connectedComponentsWithStats(
        (smooth > 0.5 * (smooth.max() + np.median(smooth))).astype(np.uint8)
    )
    mark = int(marks[top])
    half = int(0.5 * around * max(boxes[mark, cv2.CC_STAT_WIDTH], boxes[mark, cv2.CC_STAT_HEIGHT]))
    column, row = (int(np.clip(m, half, n - half)) for m, n in zip(middles[mark], image.shape[::-1], strict=True))
    return image[row - half : row + half, column - half : column + half]


def draw(sheet: Sheet, found: dict[tuple[str, str], Image], out: Path) -> None:
    """Write the sheet."""
    lights, effects = (list(dict.fromkeys(key[i] for key in found)) for i in (0, 1))
    across, down = (lights, effects) if len(lights) > 1 else (effects, lights)
    parts = 2 if sheet.whole else 1
    with style():
        width = 4.4 * len(across) if sheet.whole else 2.6 * len(across)
        figure = Figure(figsize=(width, (1.9 if sheet.whole else 2.8) * len(down)), layout="constrained", dpi=110)
        ratios = [16.0 / 9.0, 1.0] * len(across) if sheet.whole else [1.0] * len(across)
        axes = figure.subplots(len(down), parts * len(across), squeeze=False, width_ratios=ratios)
        for (light, effect), image in found.items():
            i, j = (
                (down.index(effect), across.index(light))
                if len(lights) > 1
                else (down.index(light), across.index(effect))
            )
            least, most = np.quantile(image, [0.001, 0.9995])
            shown = encoded(np.clip((image - least) / (most - least), 0.0, 1.0))
            views = [shown, patch(shown, sheet.around)] if sheet.whole else [patch(shown, sheet.around)]
            for k, view in enumerate(views):
                axes[i, parts * j + k].imshow(view, cmap="gray", vmin=0.0, vmax=1.0)
            axes[i, parts * j].set_title(f"{effect}, {light}", loc="left")
        for axis in axes.flat:
            axis.set_axis_off()
        drawn = io.BytesIO()
        FigureCanvasAgg(figure).print_png(drawn, metadata={"Software": None})  # type: ignore[no-untyped-call]
    write_atomically(out, drawn.getvalue())


def main() -> None:
    """Render and draw the sheet that the command names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", choices=SHEETS)
    parser.add_argument("out", type=Path, nargs="?")
    asked = parser.parse_args()
    sheet = SHEETS[asked.name]
    draw(sheet, frames(sheet), asked.out or Path(__file__).parents[1] / "docs" / f"{asked.name}.png")


if __name__ == "__main__":
    main()
