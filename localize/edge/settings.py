"""The tuned numbers of the edge fit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Level:
    """One level of the coarse-to-fine fit."""

    bins: int | None  #: across a patch; None: every pixel is a bin
    inner: float  #: bins inside the outline
    outer: float  #: bins outside
    iterations: int


@dataclass(frozen=True)
class EdgeSettings:
    """Tuned numbers of the edge fit."""

    sharp: float = 0.97
    clipped: float = 0.3
    throughout: float = 0.9
    middle: float = 0.2
    fewest_points: int = 10
    rim: tuple[Level, ...] = (Level(30, 5.0, 3.0, 6), Level(70, 5.0, 3.0, 5), Level(None, 5.0, 3.0, 16))
    soft: tuple[Level, ...] = (Level(30, 6.0, 2.0, 6), Level(40, 14.0, 3.0, 16))
    enough: tuple[float, float] = (1.0, 0.3)
    fewest_bins: int = 40
    # the band's nuisances
    level: float = 0.3
    slope_per_mm: float = 3.0
    smallest: float = 1e-3
    widest: float = 5.0
    white: float = 0.05
    linear: float = 0.5
    steady: float = 0.3
    longest_step_bins: float = 3.0
    longest_step_mm: float = 0.1
    # patches clipped throughout
    saturated_bins: tuple[int, ...] = (30, 90)
    reach: tuple[float, ...] = (2.0, 2.0, 1.0, 0.5, 0.4, 0.3, 0.3)
    saturated_band: float = 5.0
    seam: float = 2.0
    smallest_scatter: float = 0.02
    saturated_step_mm: float = 0.5


EDGE = EdgeSettings()
