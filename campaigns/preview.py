"""`campaign preview`: one frame of a campaign in seconds, beside the set-up from the side, to scale."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from conespot.campaigns.bench import Bench
from conespot.campaigns.ending import RunError
from conespot.campaigns.plan import Unit, make_plan
from conespot.campaigns.schema import override
from conespot.campaigns.side_view import draw_set_up
from conespot.render.kernel import KernelError
from conespot.results.style import COLOURS, frame, style
from conespot.results.variants import named
from conespot.scene import InputError
from conespot.scene.atomic import write_atomically
from conespot.scene.document import Document

#: pixels along a row of a previewed frame at most
_COLUMNS = 1000
_DPI = 130


def preview(document: Document, out: Path | None) -> str:
    """Render the middle pose of a campaign's first case, and draw it with its set-up; what to say of the picture.

    Large frames are rendered with fewer pixels. Raises InputError for a campaign that cannot be planned or renders no
    frames, RunError if this machine renders nothing.
    """
    if out is not None and out.suffix.lower() != ".png":
        raise InputError(f"--out {out}: the picture is a PNG; name a file that ends with .png")
    plan = make_plan(document)
    if not plan.cases:
        raise InputError(f"{document.source}: renders no frames, so there is nothing to preview")
    rows, columns = plan.cases[0].scene.camera.shape
    camera = plan.cases[0].scene.camera
    if columns > _COLUMNS and camera.principal_point is None:
        smaller = camera.with_columns(_COLUMNS).resolution
        plan = make_plan(override(document, "scene.camera.resolution", _written(smaller), "preview"))
    group, case = plan.groups[0], plan.cases[0]
    number = len(group.positions) // 2
    pose, scene = group.pose(number), case.scene
    try:
        image = Bench(plan, None).frame(Unit(0, number, group.unit(number)), case)
    except KernelError as error:
        raise RunError(str(error)) from None
    labels = ", ".join(named(name, value) for name, value in {**case.labels, **case.swept}.items())
    both = scene.power.both(scene.beam)
    with style():
        figure = Figure(figsize=(15.0, 7.6), layout="constrained")
        places = figure.subplot_mosaic([["way", "x", "frame"], ["way", "y", "frame"]], width_ratios=[0.9, 1.1, 2.2])
        draw_set_up(places["way"], scene, pose, group.positions, 0, whole=True)
        draw_set_up(places["x"], scene, pose, group.positions, 0, whole=False)
        draw_set_up(places["y"], scene, pose, group.positions, 1, whole=False)
        places["way"].set_title("the way to the camera", loc="left")
        places["x"].set_title("the eye from the side", loc="left")
        places["y"].set_title("and from the front", loc="left")
        shown = places["frame"]
        shown.imshow(image / scene.sensor.full_scale, cmap="gray", vmin=0.0, vmax=1.0, extent=(0, *_size(image), 0))
        for k in range(len(scene.spotlights)):
            edge = scene.camera.project(scene.outline(pose, k))
            shown.plot(edge[:, 0], edge[:, 1], color=COLOURS["about Y"], lw=0.9, ls=(0, (4, 3)))
        shown.set(xlim=(0, _size(image)[0]), ylim=(_size(image)[1], 0), xlabel="x [px]", ylabel="y [px]")
        shown.grid(False)
        shown.set_title(f"pose {number}, patch outlined", loc="left")
        entries = dict(zip(*reversed(places["x"].get_legend_handles_labels()), strict=True))
        entries |= dict(zip(*reversed(places["way"].get_legend_handles_labels()), strict=True))
        figure.legend(entries.values(), entries.keys(), loc="outside right upper", frameon=False)
        text = (
            f"First of {len(plan.cases)} cases: {labels}. Each spotlight: {both.words}. Sensor: {scene.sensor.words}."
        )
        fewer = f" The campaign's own frames have {columns} x {rows} px." if camera.shape != scene.camera.shape else ""
        frame(figure, f"{plan.campaign.name}: the set-up, to scale, and a frame of it", text + fewer)
        drawn = io.BytesIO()
        figure.set_dpi(_DPI)
        FigureCanvasAgg(figure).print_png(drawn, metadata={"Software": None})  # type: ignore[no-untyped-call]
    target = out or Path(f"{plan.campaign.name}_preview.png")
    write_atomically(target, drawn.getvalue())
    return f"{target}: pose {number} of the first case ({labels}), and the set-up from the side"


def _size(image: np.ndarray[tuple[int, ...], np.dtype[np.generic]]) -> tuple[int, int]:
    """Width and height [px]."""
    return image.shape[1], image.shape[0]


def _written(resolution: int | tuple[int, int]) -> str:
    return str(resolution) if isinstance(resolution, int) else f"[{resolution[0]}, {resolution[1]}]"
