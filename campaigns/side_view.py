"""The set-up from the side and from the front, to scale: eye, optics, needle, cones, RCM, camera, retina."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from conespot.results.style import COLOURS
from conespot.scene import Pose, Scene
from conespot.scene.refraction import Interface

Array = NDArray[np.float64]
#: half the widths of cornea and lens, which bound what is drawn and nothing that is traced [mm]
_CORNEA, _LENS, _IRIS = 5.5, 4.6, 6.5
_NEEDLE = 0.51  #: diameter of a needle that has no shaft [mm]: 25 gauge
_LIGHT = "#F5C542"
_STEEL, _GLASS, _WALL, _SEEN = "#4B5563", "#56B4E9", "#B45309", "#9AA1AC"


def draw_set_up(axes: Axes, scene: Scene, pose: Pose, tips: Array, across: int, *, whole: bool) -> None:
    """Draw the scene at a pose over the plane of z and x (`across` 0) or y (1) [mm]; `tips` `[N, 3]` are all poses'.

    With the `whole` way up to the camera, or the eye alone.
    """
    _retina(axes, scene, across)
    _camera(axes, scene, across)
    if scene.camera.optics is not None:
        for face in (*scene.camera.optics.in_front, *scene.camera.optics.behind):
            _face(axes, face)
        for side in (-1.0, 1.0):
            half, z = scene.camera.optics.pupil / 2.0, scene.camera.optics.iris
            axes.plot([side * half, side * max(_IRIS, half + 0.5)], [z, z], color=_STEEL, lw=2.0)
    _light(axes, scene, pose, across)
    _needle(axes, scene, pose, across)
    if not whole:
        axes.plot(tips[:, across], tips[:, 2], ".", ms=2.0, color=COLOURS["z"], label="tips of all poses")
    axes.plot([pose.apex[across]], [pose.apex[2]], "o", ms=3.5, color=COLOURS["x"], label="tip")
    rcm = np.asarray(scene.instrument.rcm)
    axes.plot([rcm[across]], [rcm[2]], "+", ms=9.0, mew=1.6, color=COLOURS["failed"], label="RCM (trocar)")
    axes.set_aspect("equal")
    axes.set_xlabel(f"{'xy'[across]} [mm]")
    axes.set_ylabel("z [mm]")
    reach = 1.25 * scene.eye.radius * max(scene.surface.semi_axes)
    top = 2.0 * scene.eye.radius * scene.surface.semi_axes[2]
    if whole:
        axes.set_xlim(
            -max(reach, abs(scene.camera.centre[across]) + 6.0), max(reach, scene.camera.centre[across] + 6.0)
        )
        axes.set_ylim(-4.0, scene.camera.centre[2] + 8.0)
    else:
        axes.set_xlim(-reach, reach)
        axes.set_ylim(-2.0, max(top, float(rcm[2])) + 4.0)


def _plane(points: Array, across: int) -> Array:
    """Points `[N, 3]` as they lie in the drawing `[N, 2]`."""
    return points[:, [across, 2]]


def _retina(axes: Axes, scene: Scene, across: int) -> None:
    """The cut through the wall, with all that rises above it, and open where an eye with optics has its cornea."""
    optics = scene.camera.optics
    highest = math.pi if optics is None else math.acos(max(-1.0, min(1.0, 1.0 - optics.iris / scene.eye.radius)))
    angle = np.linspace(-highest, highest, 2001)
    directions = np.zeros((len(angle), 3))
    directions[:, across], directions[:, 2] = np.sin(angle), -np.cos(angle)
    wall = _plane(scene.surface.points(scene.eye, directions), across)
    axes.plot(wall[:, 0], wall[:, 1], color=_WALL, lw=1.6, label="retina, inside of the eye")


def _face(axes: Axes, face: Interface) -> None:
    """A refracting surface: z0 - c r^2 / (1 + sqrt(1 - (1 + Q) c^2 r^2))."""
    half = _LENS if face.below in ("lens", "implant", "vitreous") else _CORNEA
    r = np.linspace(-half, half, 201)
    squared = 1.0 - (1.0 + face.asphericity) * (face.curvature * r) ** 2
    sag = face.curvature * r * r / (1.0 + np.sqrt(np.where(squared > 0.0, squared, np.nan)))
    axes.plot(r, face.z - sag, color=_GLASS, lw=1.0)


def _camera(axes: Axes, scene: Scene, across: int) -> None:
    """The pinhole, its axis, and the rays of the frame's borders down to the retina."""
    camera = scene.camera
    rows, columns = camera.shape
    ends = [[0.0, rows / 2.0], [columns, rows / 2.0]] if across == 0 else [[columns / 2.0, 0.0], [columns / 2.0, rows]]
    pixels = np.linspace(ends[0], ends[1], 201)
    seen = camera.rays(pixels)
    starts = np.broadcast_to(seen.origins, seen.directions.shape)
    met = scene.surface.intersect(scene.eye, starts, seen.directions)
    shown = np.flatnonzero(np.isfinite(met[:, 0]))
    for k in {int(shown[0]), int(shown[-1])} if len(shown) else set():
        way = _plane(np.stack([camera.centre, starts[k], met[k]]), across)
        axes.plot(way[:, 0], way[:, 1], color=_SEEN, lw=0.8, ls=(0, (4, 3)), label="what the frame shows")
    centre, back = camera.centre, camera.axes[2]
    width = 2.5
    body = np.array([centre, centre + 7.0 * back])
    side = np.array([back[2], -back[across]]) * width
    flat = _plane(body, across)
    corners = [flat[0], flat[1] + side, flat[1] - side]
    axes.add_patch(Polygon(corners, closed=True, facecolor=_STEEL, edgecolor="none", label="camera"))


def _light(axes: Axes, scene: Scene, pose: Pose, across: int) -> None:
    """Each cone from the tip to its patch, as it is seen from the side, and the patch."""
    for k in range(len(scene.spotlights)):
        edge = scene.outline(pose, k, points=256)
        edge = edge[np.all(np.isfinite(edge), axis=-1)]
        if not len(edge):
            continue
        flat, tip = _plane(edge, across), _plane(pose.apex[None], across)[0]
        bearing = np.arctan2(flat[:, 0] - tip[0], tip[1] - flat[:, 1])
        ends = flat[[int(np.argmin(bearing)), int(np.argmax(bearing))]]
        cone = np.concatenate([tip[None], ends])
        axes.add_patch(
            Polygon(cone, closed=True, facecolor=_LIGHT, alpha=0.45, edgecolor="none", label="cone of light")
        )
        axes.plot(flat[:, 0], flat[:, 1], color=COLOURS["about Y"], lw=1.6, label="edge of the patch")


def _needle(axes: Axes, scene: Scene, pose: Pose, across: int) -> None:
    """From the tip through the RCM and on, as thick as it is."""
    shaft = scene.instrument.shaft
    thickness = _NEEDLE if shaft is None else shaft.diameter
    to_rcm = float(np.linalg.norm(np.asarray(scene.instrument.rcm) - pose.apex))
    ends = _plane(np.stack([pose.apex, pose.apex - (to_rcm + 8.0) * pose.axis]), across)
    along = ends[1] - ends[0]
    side = 0.5 * thickness * np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
    corners = [ends[0] + side, ends[1] + side, ends[1] - side, ends[0] - side]
    axes.add_patch(Polygon(corners, closed=True, facecolor=_STEEL, edgecolor="none", label="needle"))
