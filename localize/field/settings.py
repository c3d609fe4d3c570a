"""The tuned numbers of the soft fit.

What halving and doubling does is said of the frames of `benchmarks/tuned_numbers.py field` at 1000 px: on two eyes, rms
errors are 4.9 um with the RCM to 0.05 mm, 16 um free, 7.4 um with a reference, 5.9 um in colour and 5.2 um with three
spotlights. "Not critical" is a change of each by less than a tenth.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Level:
    """One level of the coarse-to-fine fit."""

    bins: int  #: across a patch, at most
    iterations: int  #: at most
    tied: int  #: iterations of them that keep the axis on the RCM


@dataclass(frozen=True)
class FieldSettings:
    """Tuned numbers of the soft fit."""

    #: a soft edge loses nothing where 5000 px frames are binned 5 x 5 (1.03 of the bound); 240 bins are about that, and
    #: at 1000 px every pixel is one of them. The coarse level brings a start there: 24 bins instead of 48 leave errors
    #: of 12.6 um (29 um free), 96 are not critical. Nor are iterations and those that are tied
    levels: tuple[Level, ...] = (Level(48, 5, 2), Level(240, 16, 0))
    #: of a patch's size, seen around it: where the light ends, and the albedo there. A half costs up to 16 % (three
    #: spotlights), the double gains up to 19 % (one) and costs 15 % (three) and the time of larger windows
    margin: float = 0.15
    #: longest step of the tip along a coordinate [mm]: no step from these starts was longer than half of it
    longest_step_mm: float = 0.15
    #: a step this short [sigmas] ends the iterations: what is left is below the noise. Not critical
    done_sigmas: float = 0.2
    #: how well the RCM counts as known while the axis is kept on it [mm]. Not critical
    tied_mm: float = 2e-3

    #: exponent and knee [cycles/mm] of the power spectrum of a fundus photograph's log albedo
    #: (doi 10.15347/wjm/2014.008): measured, see `field.albedo`. Not critical
    exponent: float = 2.6
    knee: float = 8.0
    #: the spectrum's amplitude to start from, of a fundus in green and of what a reference leaves of it; then it is
    #: learnt octave by octave. Not critical
    fundus: float = 0.0025
    known: float = 1e-5
    #: amplitudes between a uniform fundus and an optic disc. Not critical
    amplitudes: tuple[float, float] = (1e-10, 1.0)
    #: what the next finer octave says of an octave's amplitude, in modes. Not critical
    shared: float = 4.0
    #: modes a side, at most, and bins for each: a finer wave costs more than it tells. At 5000 px detail of the retina,
    #: not the sensor, limits a soft patch, and 24 modes take it up. 12 modes cost 12 % (three spotlights 57 %), 16 bins
    #: a mode 44 % (free 58 %); 4 bins are not critical
    most_modes: int = 24
    bins_a_mode: int = 8
    #: prior variance of the mean log albedo, which nothing restricts. Not critical
    mean_variance: float = 100.0

    #: quantiles of the predicted light up to which, and from which on, bins tell the gain where all of them are lit
    glow: tuple[float, float] = (0.2, 0.75)
    #: how much of a log ratio of channels the leading one's log albedo may hold (prior sigma). Not critical
    chroma: float = 0.5
    #: blur of the channels before their ratio [bins], or their noise would hide what they have in common: a half costs
    #: 42 % in colour, the double gains 15 % on two frames
    chroma_blur: float = 1.0
    #: share of the median below which a bin counts as that dark, so that its logarithm is finite: no answer changes
    chroma_darkest: float = 0.05

    #: rms of the albedo beyond the modes where it starts; then it is measured. Not critical
    scatter: float = 0.1
    #: share of the brightest light from which on a bin counts as lit where the rest is measured. Not critical
    lit: float = 0.1
    #: bins a side over which the rest is measured: about a wave of the finest modes. 7 gain up to 20 %, 26 cost up to
    #: 56 %, but with a reference they gain 23 %
    near: int = 13
    #: bins' worth of the whole patch's rest in what is measured around one. Not critical
    elsewhere: float = 20.0
    #: least local variance of the rest, over the patch's. A half costs 10 % with a reference, whose ellipsoids then
    #: hold 75 % instead of 88 %; the double gains 12 % there and costs 10 % with three spotlights
    least_local: float = 0.5
    #: largest square of a bin's rest that counts: a vessel's. Not critical
    largest_excess: float = 1.0
    #: draws of white noise that tell what a fit leaves of it: far better known than by the frame's one
    whites: int = 8
    #: whitened rests count up to here where neighbours are compared. Not critical
    largest_shared: float = 4.0


FIELD = FieldSettings()
