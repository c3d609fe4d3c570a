"""The tuned numbers of the edge fit; `benchmarks/tuned_numbers.py edge` halves and doubles each.

What is said of that was seen on one eye's frames at 1000 px, four of a kind: rms errors are 1.7 um with a hard edge and
the RCM to 0.05 mm, 1.2 um in colour, 0.07 um with three spotlights, 4.5 um clipped throughout, 1.5 um on a clipped soft
rim and 20 um with `cone` on a soft edge. "Not critical" is a change of each by less than a tenth; where nothing is
said, it was not measured.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Level:
    """One level of the coarse-to-fine fit."""

    bins: int | None  #: across a patch; None: every pixel is a bin
    inner: float  #: bins inside the outline
    outer: float  #: bins outside
    iterations: int  #: at most


@dataclass(frozen=True)
class EdgeSettings:
    """Tuned numbers of the edge fit."""

    #: share of the half angle beyond which half the profile's height makes its edge a step: a Cycles blend below 0.12
    sharp: float = 0.97
    #: shares of its middle from which on a patch counts as clipped, and as clipped throughout: patches here are so all
    #: over or not at all, and no answer changes unless none can count as clipped throughout
    clipped: float = 0.3
    throughout: float = 0.9
    #: half the side of that middle, over the patch's width: no answer changes
    middle: float = 0.2
    #: points of an outline in the frame without which there is nothing to fit: twice the pose's parameters. No
    #: answer changes
    fewest_points: int = 10
    #: a step in the light is seen one or two bins off only, so starts good to a third of a tenth of a radius need bins
    #: of a thirtieth of a patch, then finer ones. Narrow, since further in a clipped rim's slope hides the albedo's: at
    #: full resolution 10 bins inside cost 17 % (three spotlights threefold), 6 outside 34 %, 1.5 outside 12 %. Coarser
    #: levels are not critical, but for 15 bins in the first, which triple the error of clipped soft rims, and for 60,
    #: which leave small patches without coarse levels: the last one is then the first, and tied to the exact RCM
    rim: tuple[Level, ...] = (Level(30, 5.0, 3.0, 6), Level(70, 5.0, 3.0, 5), Level(None, 5.0, 3.0, 16))
    #: bins of a fortieth of a soft patch: finer ones saw nothing but more of the albedo, in three times the time, and
    #: change no answer here. Bins of a twentieth gain 41 %, 7 bins inside instead of 14 gain 31 % on these few frames;
    #: the first level is not critical
    soft: tuple[Level, ...] = (Level(30, 6.0, 2.0, 6), Level(40, 14.0, 3.0, 16))
    #: standard deviations of what spreads the image by which a band is wider on either side, and bins of the last level
    #: for each of them
    widths: float = 3.0
    bins_a_width: float = 0.5
    #: a step this short [sigmas of uncorrelated residuals] ends a level that others follow, and the last one: what is
    #: left is below the noise. Not critical
    enough: tuple[float, float] = (1.0, 0.3)
    #: width of a patch that is clipped throughout, below which its outline is a matter of whole pixels [px]: of
    #: near_retina's ideal frames those 4 to 9 px wide were 0 to 6 sigmas off, wider ones 2 at most
    narrowest: float = 10.0
    #: strips of pixels around a patch that is clipped throughout, without which its few pixels that are neither dark
    #: nor clipped do not say how well they hold the tip: of near_retina's ideal frames with 25 to 34 strips bands held
    #: less than half of their 95 % intervals, and were up to 10 sigmas off
    fewest_strips: int = 64
    #: bins without which a band is too short: eight for each parameter. No answer changes
    fewest_bins: int = 40
    #: share of the light in a band below which a bin counts as unlit, where a blur has no end
    dark: float = 1e-3
    #: where the strips' spreads of log albedo start, of levels and of slopes [1/mm]; then they are learnt. Those of a
    #: fundus in green. Not critical
    level: float = 0.3
    slope_per_mm: float = 3.0
    #: least spread of levels, and of slopes over the band's width: an albedo even to a thousandth. Not critical
    smallest: float = 1e-3
    #: factor by which a spread may grow in one iteration. No answer changes
    widest: float = 5.0
    #: relative scatter of bins beyond the sensor's noise where it starts; then it is measured. No answer changes
    white: float = 0.05
    #: the scatter is measured on bins whose light changes with the tip's height by this share of what the steepest do.
    #: Not critical
    steady: float = 0.3
    #: where light comes back from under the retina: rings around an outline, over its size, and points on each, which
    #: show the retina without it, and how well they tell the gain (sigma of its logarithm): it is another place
    around: tuple[float, ...] = (2.5, 3.0, 3.5)
    around_points: int = 24
    gain: float = 0.3
    #: blend of a Cycles beam that a hard edge is compared with where it is doubted: half a pixel wide on small frames
    softer: float = 0.02
    #: longest step of the tip, in bins, and however small they are [mm]: within it an outline is nearly linear. No
    #: answer changes
    longest_step_bins: float = 3.0
    longest_step_mm: float = 0.1
    #: bins across a patch that is clipped throughout, before every pixel is one. Halves cost 11 %, doubles
    #: gain 48 % on these four frames
    saturated_bins: tuple[int, ...] = (30, 90)
    #: bins on either side of the outline that are counted, iteration by iteration: many to find it, few to measure it.
    #: Halves cost 13 %, doubles gain 7 %
    reach: tuple[float, ...] = (2.0, 2.0, 1.0, 0.5, 0.4, 0.3, 0.3)
    #: standard deviations of a compression's rounding by which it may darken white beside an edge: with two levels in
    #: their place a fourth of a rim passed for seen at quality 90, and tips were up to 80 um off
    #: (`tests/unit/localize/test_doubt.py`); two of them leave 20 um, three 11
    ringing: float = 3.0
    #: noise of a block's frequencies before they are rounded [codes], by which the rounding is expected. At 2 codes
    #: errors are the same
    code_noise: float = 1.0
    #: share of a compression's rounding that stays noise where it is predicted: with 0.5 and 0.15 of
    #: `test_ellipsoids_of_hard_edges_that_were_recorded_hold`'s 100 tips 85 and 83 are inside, with this 89
    unpredicted: float = 0.3
    #: least share of a displacement that rounding is taken to let through; seen are 0.6 (quality 75) to 0.9
    least_through: float = 0.2
    #: bins on either side that are looked at. Not critical
    saturated_band: float = 5.0
    #: bins on either side within which lie those between dark and white. Half of it costs 17 %
    seam: float = 2.0
    #: least scatter of a strip [bins]: what counting whole pixels leaves
    smallest_scatter: float = 0.02
    #: longest step of the tip where only clipping is seen [mm]
    saturated_step_mm: float = 0.5


EDGE = EdgeSettings()
