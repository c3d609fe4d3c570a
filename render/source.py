"""The spotlight that is no still point: a core of some width, and an instrument that moves during the exposure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from conespot.render import kernel
from conespot.scene import Pose, Scene
from conespot.scene.motion import extremes
from conespot.scene.pose import tangents
from conespot.scene.spotlights import spotlight_axes

if TYPE_CHECKING:
    from drjit.auto.ad import Float
    from mitsuba import Point2f, Point3f, SurfaceInteraction3f, Vector3f

#: of the polygon around the core
_CORNERS = 8
#: points of light that stand for the source where its light is spread over tenths of a millimetre anyway
_STANDS = 32
_GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0


class Source:
    """Gives each ray a point of the core and an instant of the exposure.

    Mitsuba's emitter has one transform for all rays. Core and motion are rigid, so light from a moved emitter at a
    place is what the emitter where it stands sends to the place that is moved back.
    """

    def __init__(self, scene: Scene) -> None:
        self._rcm = scene.instrument.rcm
        self._radius = scene.beam.source_diameter / 2.0
        self.moves = scene.motion is not None
        self._stand: tuple[Any, ...] = ()

    @classmethod
    def of(cls, scene: Scene) -> Source | None:
        """The scene's, or None where the spotlight is a point and stands still."""
        source = cls(scene)
        return source if source.moves or source.has_core else None

    @property
    def has_core(self) -> bool:
        """Whether it is wider than a point."""
        return self._radius > 0.0

    def aim(self, pose: Pose, axis: NDArray[np.float64]) -> None:
        """Place the spotlight of a unit `axis` `[3]` at a pose, to move as that does."""
        mi, dr, _ = kernel.load()
        # data of the kernel: literals would be its constants, and every pose had a kernel of its own
        across = [mi.Vector3f(*_held(self._radius * part)) for part in tangents(axis)]
        placed = [mi.Vector3f(*_held(part)) for part in (pose.apex, pose.axis, np.asarray(self._rcm, float))]
        sway = np.zeros((2, 3)) if pose.sway is None else pose.sway
        way = [mi.Float(np.ascontiguousarray(part, np.float32)) for part in sway.T]
        self._stand = across, placed, way, dr.opaque(mi.UInt32, len(sway) - 2), dr.opaque(mi.Float, len(sway) - 1.0)

    def at(self, core: Point2f, instant: Float) -> Standing:
        """Where it stands for samples `core` of the unit square and `instant` of the unit interval."""
        mi, dr, _ = kernel.load()
        across, (apex, axis, rcm), way, last, pieces = self._stand
        disc = mi.warp.square_to_uniform_disk_concentric(core)
        offset = across[0] * disc.x + across[1] * disc.y
        if not self.moves:
            return Standing(apex, apex, offset, None, None)
        piece = dr.minimum(mi.UInt32(instant * pieces), last)
        share = instant * pieces - mi.Float(piece)
        ends = [[dr.gather(mi.Float, part, piece + k) for part in way] for k in (0, 1)]
        tip = apex + mi.Vector3f(*(dr.lerp(first, second, share) for first, second in zip(*ends, strict=True)))
        now = dr.normalize(tip - rcm)
        return Standing(apex, tip, offset, dr.cross(axis, now), 1.0 / (1.0 + dr.dot(axis, now)))


@dataclass(frozen=True)
class Standing:
    """A spotlight of each ray: its tip at mid-exposure and now [mm], and its core's point off the tip at mid-exposure.

    `turn` is the cross product of its axis then and now, `per` one over 1 + their scalar product: the shortest rotation
    from one to the other. None where nothing moves.
    """

    apex: Vector3f
    tip: Vector3f
    offset: Vector3f
    turn: Vector3f | None
    per: Float | None

    @property
    def position(self) -> Point3f:
        """Where the light comes from [mm]."""
        mi, _, _ = kernel.load()
        return mi.Point3f(self.tip + self._turned(self.offset, 1.0))

    def seen_from(self, at: SurfaceInteraction3f) -> SurfaceInteraction3f:
        """The place of a surface as it lies to a point of light that has not moved."""
        mi, _, _ = kernel.load()
        there = mi.SurfaceInteraction3f(at)
        there.p = mi.Point3f(self._turned(mi.Vector3f(at.p) - self.tip, -1.0) + self.apex - self.offset)
        return there

    def _turned(self, vector: Vector3f, way: float) -> Vector3f:
        """A vector turned as the axis has, or back (Rodrigues)."""
        if self.turn is None or self.per is None:
            return vector
        _, dr, _ = kernel.load()
        across = dr.cross(self.turn, vector) * way
        return vector + across + dr.cross(self.turn, across) * (self.per * way)


def outermost(scene: Scene, pose: Pose, spotlight: int) -> list[Pose]:
    """Poses of a still point of light: what the source lights at all, and what it lights fully, their cones bound.

    They stand around the core, and where the instrument is furthest in any direction.
    """
    poses = extremes(pose, scene.instrument.rcm)
    if scene.beam.source_diameter == 0.0:
        return poses
    angles = np.arange(_CORNERS) * 2.0 * np.pi / _CORNERS
    radius = scene.beam.source_diameter / 2.0 / np.cos(np.pi / _CORNERS)  # of a polygon that holds the core
    corners = radius * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    found = []
    for one in poses:
        offsets = corners @ np.stack(tangents(spotlight_axes(one, scene.spotlights)[spotlight]))
        found += [replace(one, apex=one.apex + offset) for offset in offsets]
    return found


def stands(scene: Scene, pose: Pose, spotlight: int) -> list[Pose]:
    """Poses of a still point of light that together light as the source does: points of its core at instants."""
    still = pose.sway is None
    if still and scene.beam.source_diameter == 0.0:
        return [pose]
    k = np.arange(_STANDS) + 0.5
    # Fibonacci's lattice over the core; instants by another irrational, or each direction had an instant of its own
    radius, angle = np.sqrt(k / _STANDS) * scene.beam.source_diameter / 2.0, 2.0 * np.pi * _GOLDEN * k
    places = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    instants = (k * np.sqrt(2.0)) % 1.0
    found = []
    for place, instant in zip(places, instants, strict=True):
        one = pose
        if pose.sway is not None:
            at = np.linspace(0.0, 1.0, len(pose.sway))
            off = np.array([np.interp(instant, at, part) for part in pose.sway.T])
            one = Pose.through(pose.apex + off, scene.instrument.rcm)
        axis = spotlight_axes(one, scene.spotlights)[spotlight]
        found.append(replace(one, apex=one.apex + place @ np.stack(tangents(axis)), sway=None))
    return found


def _held(values: NDArray[np.float64]) -> list[Float]:
    mi, dr, _ = kernel.load()
    return [dr.opaque(mi.Float, float(value)) for value in values]
