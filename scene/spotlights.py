"""The rig of spotlights at the tip: one apex, one cone direction a spotlight."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from conespot.scene.model import Model, named
from conespot.scene.pose import Pose, rot_x, rot_y
from conespot.scene.quantity import Angle, Length


class Spotlight(Model):
    """Offset of a cone from the needle axis: Rx(x) then Ry(y) in the needle's frame (paper, Table III)."""

    x: Angle = 0.0
    y: Angle = 0.0


RIGS = {
    "single": (Spotlight(),),
    "triple": tuple(
        Spotlight(x=math.radians(x), y=math.radians(y)) for x, y in ((-10.0, -6.0), (0.0, 11.0), (9.0, -6.0))
    ),
}


Spotlights = Annotated[tuple[Spotlight, ...], named(RIGS, "spotlight rig"), Field(min_length=1, max_length=16)]


def rig_name(spotlights: tuple[Spotlight, ...]) -> str:
    """`single`, `triple`, or the number of spotlights for a rig of one's own."""
    return next((name for name, rig in RIGS.items() if rig == spotlights), f"{len(spotlights)} spotlights")


def spotlight_axes(pose: Pose, spotlights: tuple[Spotlight, ...]) -> NDArray[np.float64]:
    """Unit axes of the cones `[K, 3]`: Rz(azimuth) Ry(tilt) Rz(roll) Ry(y_k) Rx(x_k) (0, 0, -1).

    >>> straight = Pose(np.zeros(3), np.array([0.0, 0.0, -1.0]))
    >>> (spotlight_axes(straight, (Spotlight(), Spotlight(x=math.pi / 2.0))).round(12) + 0.0).tolist()
    [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    """
    down = np.array([0.0, 0.0, -1.0])
    return np.stack([pose.rotation() @ rot_y(s.y) @ rot_x(s.x) @ down for s in spotlights])


class Shaft(Model):
    """The needle's visible shaft: an opaque grey cylinder from the tip back along the axis."""

    diameter: Length = Field(0.51, gt=0.0)  #: 25 gauge: 0.51 mm
    length: Length = Field(20.0, gt=0.0)
    setback: Length = Field(0.05, gt=0.0)  #: the light source stands this far in front of the shaft's end [mm]
    albedo: float = Field(0.3, ge=0.0, le=1.0)


class Instrument(Model):
    """The needle: it always passes through the remote centre of motion (RCM), the trocar in the sclera."""

    rcm: tuple[Length, Length, Length] = (6.0, 0.0, 22.0)
    shaft: Shaft | None = None
