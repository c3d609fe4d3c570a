"""The tuned numbers of the soft fit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Level:
    """One level of the coarse-to-fine fit."""

    bins: int  #: across a patch, at most
    iterations: int
    tied: int  #: iterations of them that keep the axis on the RCM


@dataclass(frozen=True)
class FieldSettings:
    """Tuned numbers of the soft fit."""

    levels: tuple[Level, ...] = (Level(48, 5, 2), Level(240, 16, 0))
    margin: float = 0.15
    longest_step_mm: float = 0.15
    done_sigmas: float = 0.2
    tied_mm: float = 2e-3
    not_gaussian: float = 1.7
    # the albedo's modes
    exponent: float = 2.6
    knee: float = 8.0
    fundus: float = 0.0025
    known: float = 1e-5
    amplitudes: tuple[float, float] = (1e-10, 1.0)
    shared: float = 4.0
    most_modes: int = 24
    bins_a_mode: int = 8
    mean_variance: float = 100.0
    # colours
    chroma: float = 0.5
    chroma_blur: float = 1.0
    chroma_darkest: float = 0.05
    # what the modes leave
    scatter: float = 0.1
    linear: float = 0.3
    lit: float = 0.1
    near: int = 13
    block: int = 5
    elsewhere: float = 20.0
    least_local: float = 0.5
    largest_excess: float = 1.0
    largest_shared: float = 4.0
    largest_area: float = 30.0
    farther: float = 4.0


FIELD = FieldSettings()
