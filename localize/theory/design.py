"""Design guidance: what the bound says about half angle, edge softness, and number and spread of spotlights."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.knowns import Knowns
from conespot.localize.theory.bounds import Electrons, cramer_rao
from conespot.scene.beam import Beam, CyclesBeam, HardBeam
from conespot.scene.scene import Scene
from conespot.scene.spotlights import Spotlight

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Design:
    """One design and its bound, the root mean square over the tips it was asked for."""

    half_angle: float  #: [rad]
    softness: float  #: share of the cone the edge takes up: 0 hard, 1 fully soft
    spotlights: int
    spread: float  #: angle between the needle and each spotlight [rad]
    position_mm: float
    axis_rad: float


def ring(count: int, spread: float) -> tuple[Spotlight, ...]:
    """`count` spotlights evenly round the needle, `spread` [rad] off it; one of them alone points along it.

    Spotlights are turned by Rx then Ry, so that the offsets (x, y) are small-angle coordinates on a circle.
    """
    if count == 1:
        return (Spotlight(),)
    turns = 2.0 * math.pi * np.arange(count) / count + math.pi / 2.0
    axes = [(math.sin(spread) * math.cos(t), math.sin(spread) * math.sin(t), -math.cos(spread)) for t in turns]
    # Ry(y) Rx(x) (0, 0, -1) = (-sin y cos x, sin x, -cos y cos x)
    return tuple(Spotlight(x=math.asin(ay), y=math.atan2(-ax, -az)) for ax, ay, az in axes)


def beam_of(half_angle: float, softness: float) -> Beam:
    """A hard beam for softness 0, else Cycles' profile with that blend."""
    return HardBeam(half_angle=half_angle) if softness == 0.0 else CyclesBeam(half_angle=half_angle, blend=softness)


def compare_designs(
    scene: Scene,
    tips: Iterable[tuple[float, float, float]],
    *,
    half_angles: Iterable[float] = (),
    softness: Iterable[float] = (),
    rigs: Iterable[tuple[int, float]] = (),
    sensor: Electrons = Electrons(),  # noqa: B008  frozen
    knowns: Knowns | None = None,
) -> list[Design]:
    """Bounds of the scene's own design with one quantity changed at a time, over `tips` [mm].

    `half_angles` [rad], `softness` (0..1) and `rigs` (number of spotlights, spread [rad]). The fluence is not held:
    every design gets the same electrons at its brightest pixel, as an exposure to just below saturation would.
    """
    places = [np.array(tip, float) for tip in tips]
    known = knowns or Knowns(rcm_sigma_mm=None)
    own = scene.beam.softness or 0.0
    plans: list[tuple[float, float, tuple[Spotlight, ...], float]] = []
    plans += [(angle, own, scene.spotlights, 0.0) for angle in half_angles]
    plans += [(scene.beam.half_angle, soft, scene.spotlights, 0.0) for soft in softness]
    plans += [(scene.beam.half_angle, own, ring(n, spread), spread if n > 1 else 0.0) for n, spread in rigs]
    found = []
    for angle, soft, spotlights, spread in plans:
        changed = scene.model_copy(update={"beam": beam_of(angle, soft), "spotlights": spotlights})
        bounds = [cramer_rao(changed, changed.pose(tip), sensor, known) for tip in places]
        found.append(
            Design(
                angle,
                soft,
                len(spotlights),
                spread,
                math.sqrt(float(np.mean([b.position_mm**2 for b in bounds]))),
                math.sqrt(float(np.mean([b.axis_rad**2 for b in bounds]))),
            )
        )
    return found
