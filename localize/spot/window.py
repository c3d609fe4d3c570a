"""When a patch is a spot, and the window it is looked at in."""

from __future__ import annotations

import numpy as np

from conespot.localize.image import Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.view import Shown, Window, edge_width, outline
from conespot.localize.spot.settings import SPOT
from conespot.scene.beam import HardBeam
from conespot.scene.motion import Tremor
from conespot.scene.scene import Scene


def may_be_spots(scene: Scene) -> bool:
    """Whether a scene has one hard spotlight of a core or in a trembling hand, near which a patch has no narrow edge.

    A hand whose velocity is told is not meant: of it nothing is to be found.
    """
    trembles = isinstance(scene.motion, Tremor)
    hard = isinstance(scene.beam, HardBeam) and len(scene.spotlights) == 1
    return hard and (trembles or (scene.motion is None and scene.beam.source_diameter > 0.0))


def is_spot(start: Estimate, slack: float = 1.0) -> bool:
    """Whether what spreads the image is hardly narrower than the patch of a start, which may be so much too large."""
    if not may_be_spots(start.scene):
        return False
    radius, width = _sizes(start)
    return radius > 0.0 and slack * width > SPOT.wide * radius


def _sizes(start: Estimate) -> tuple[float, float]:
    """Radius of the outline and standard deviation of what spreads it [px]; 0 where the frame does not show it."""
    points = outline(start, 0)
    if not len(points):
        return 0.0, 0.0
    return float(np.mean(np.linalg.norm(points - points.mean(axis=0), axis=1))), edge_width(start)


def window_of(start: Estimate) -> Window | None:
    """The window about a spot; None if too little of it is in the frame."""
    radius, width = _sizes(start)
    if radius == 0.0:
        return None
    return Window.around(start, 0, SPOT.bins, SPOT.margin + SPOT.around * width / (2.0 * radius))


def lead_of(frame: Frame, at: Window) -> tuple[int, list[Shown]]:
    """The channel that is clipped least, and what all of them show in a window."""
    shown = Shown.each(frame, at)
    return int(np.argmax([np.count_nonzero(one.usable) for one in shown])), shown
