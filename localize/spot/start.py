"""The start on a spot: the roundest light of a frame, where a tip would be near the wall."""

from __future__ import annotations

from conespot.localize.image import Frame, Reference
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.view import edge_width
from conespot.localize.spot.first import first_fit
from conespot.localize.spot.settings import SPOT
from conespot.localize.spot.window import is_spot, may_be_spots
from conespot.localize.start.rig import poses_on
from conespot.localize.start.rings import Overview, find_rings
from conespot.localize.start.search import Start
from conespot.scene.scene import Scene


def spot_start(frame: Frame, scene: Scene, reference: Reference | None = None) -> Start | None:
    """A first pose, where what stands out most is a spot, and a spot's light explains what is there; else None."""
    if not may_be_spots(scene):
        return None
    for pose in poses_on(find_rings(Overview.of(frame, reference), scene, 1), scene):
        near = Estimate(pose, scene)
        first = first_fit(frame, near) if is_spot(near, SPOT.larger) else None
        if first is None or first.explained < SPOT.explained:
            return None
        here = first.here.estimate
        if scene.depth(here.pose.apex) <= 0.0 or not is_spot(here):
            return None
        return Start(here.pose, first.explained, first.explained, first.explained, grain=max(1.0, edge_width(here)))
    return None
