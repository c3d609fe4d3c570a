"""The numbers of the theory that are choices: none of them is fitted to anything."""

from __future__ import annotations

import math
from dataclasses import dataclass, field


def _degrees(*angles: float) -> tuple[float, ...]:
    return tuple(math.radians(angle) for angle in angles)


def _tolerances() -> dict[str, float]:
    return {
        "half_angle": math.radians(0.01),
        "eye_radius": 0.1,
        "camera_height": 0.1,
        "focal_length": 0.3,
        "rcm_sideways": 0.05,
        "rcm_along": 0.05,
    }


@dataclass(frozen=True)
class TheorySettings:
    """How finely closed forms and bounds are evaluated, and for which tips, tolerances and designs.

    Half and twice the fineness were tried on Table I, and on bounds and budget of both tips, hard and soft at 1000 px.
    """

    #: points at which curve and ellipse are compared: in the plane, in space, and in space for every tip of the volume.
    #: Half or twice as many change Table I by 5e-5 um, and the volume's by 5e-4 um
    in_plane_points: int = 4001
    space_points: int = 1001
    volume_points: int = 201
    #: cells a side of the volume of interest: half as many miss 1.5 % of the largest distance, twice as many find no
    #: larger one
    volume_cells: int = 10

    #: points on an outline, and the step of central differences [mm, rad]: half and twice leave bounds and budget as
    #: they are in all five digits looked at
    outline_points: int = 256
    difference: float = 1e-4
    #: pixels beyond the outlines that count [px], to tell offset from gain: half raises bounds by 3e-4, twice lowers
    #: them by 3e-4
    margin_px: float = 3.0
    #: medians of the deep light's kernel beyond the outlines that count, where light comes back from under the retina:
    #: half raises bounds by up to 1 %, three times as many lower them by up to 1 %
    glow_reach: float = 1.0
    #: and standard deviations of what spreads the image
    widths: float = 4.0
    #: quantile of a patch's light that the sensor's peak stands for; the brightest pixel alone may be any. 0.998 or
    #: 0.9995 change bounds by 7e-4
    peak_quantile: float = 0.999

    #: electrons where the patch is brightest, and background noise in every pixel [e-], as in docs/localizers.md
    peak: float = 9000.0
    background: float = 15.0
    #: share of saturation that is brightest where a camera does not meter itself: the default of those that do
    metered_level: float = 0.8

    #: tips everything is asked for [mm]: on the optical axis near the retina, and aside and farther from it
    low: tuple[float, float, float] = (0.0, 0.0, 3.0)
    high: tuple[float, float, float] = (2.0, 0.0, 6.0)
    resolutions: tuple[int, ...] = (5000, 1000)  #: the paper's frames (Table II), and those of most campaigns [px]
    #: the ring of tips over which bumps are averaged: its radius, that of the paper's helix [mm], and how many: half as
    #: many are up to 24 % off, twice as many 1 %
    bump_ring: float = 2.0
    bump_tips: int = 90
    #: what the error budget takes a quantity to be off by [mm, rad]; it states the error per unit beside it
    tolerances: dict[str, float] = field(default_factory=_tolerances)

    #: designs are compared at no more than this [px]: their ratios hardly depend on it, and the time does
    design_resolution: int = 1000
    half_angles: tuple[float, ...] = _degrees(5.0, 7.0, 9.0, 11.0, 13.0, 15.0)  #: those of Table I [rad]
    softness: tuple[float, ...] = (0.0, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0)
    spotlights: tuple[int, ...] = (1, 2, 3, 4, 6)
    spreads: tuple[float, ...] = _degrees(5.0, 8.0, 11.0, 14.0)  #: between needle and spotlights [rad]


THEORY = TheorySettings()
