"""The numbers by which a fundus grows out of a seed: vessel trees, disc and pigment.

Place and size of the disc are anatomy's, with their sources. The others were chosen by eye, so that a
grown fundus looks like the photograph at 570 nm (`fundus_maps(Fundus(source="procedural", seed=s))` beside
`fundus_maps(Fundus())`, both `.reflectance(570.0, ...)`); no measurement is behind them, and no result rests on one.
Ranges are those of a uniform distribution.
"""

from __future__ import annotations

from dataclasses import dataclass

Range = tuple[float, float]


@dataclass(frozen=True)
class Branching:
    """Where branches leave a vessel, along it [mm], and how thick they are for it."""

    first: Range
    spacing: Range
    share: Range  #: of the vessel's radius


@dataclass(frozen=True)
class Growth:
    """Lengths in mm."""

    # the disc, as ranges over eyes: its centre lies 15.5 deg (4.5 mm) nasal of the fovea and a little above it
    # (K. Rohrschneider, Invest. Ophthalmol. Vis. Sci. 45:3257, 2004); it is 1.77 wide and 1.88 high
    # (H. A. Quigley et al., Arch. Ophthalmol. 108:51, 1990)
    disc_distance: Range = (4.2, 4.8)
    disc_height: Range = (0.1, 0.8)
    disc_half_width: Range = (0.80, 0.95)
    disc_half_height: Range = (0.9, 1.08)
    disc_rim: float = 0.03  #: width of its edge over its radius

    # calibres at the disc: 110 and 145 um; a vessel of this radius has the closed form's blood path
    artery_trunk: float = 0.055
    vein_trunk: float = 0.072
    thinnest: float = 0.006  #: radius at which a branch ends, about a texel of the maps
    avascular: float = 0.28  #: around the fovea no vessel grows
    margin: float = 0.1  #: nor so near the maps' border
    blur_texels: float = 0.6  #: of the maps of blood paths, standard deviation

    # trunks: points they run through, temporal and up of where they leave the disc
    #: arcades around the macula, by (across, across per vein_shift, up in units of the crest, up)
    arcade: tuple[tuple[float, float, float, float], ...] = (
        (0.05, 0.0, 0.0, 0.45),
        (0.55, 0.2, 0.0, 1.3),
        (1.9, 0.0, 0.80, 0.0),
        (3.9, 0.0, 1.0, 0.0),
        (6.0, 0.0, 1.0, -0.25),
        (8.0, 0.0, 1.0, -0.9),
        (10.5, 0.0, 1.0, -1.4),
        (13.0, 0.0, 1.0, -1.0),
    )
    crest: Range = (2.7, 3.4)  #: highest point of an artery's arcade over the disc
    vein_shift: float = 0.45  #: a vein's arcade is that much higher
    nasal: tuple[Range, ...] = ((-0.3, 0.5), (-1.1, 1.5), (-2.2, 2.6), (-3.5, 4.4))
    macular: tuple[Range, ...] = ((0.9, 0.15), (2.0, 0.35), (3.2, 0.55), (3.9, 0.7))
    macular_slope: Range = (0.5, 1.2)  #: what stretches them upwards
    nasal_share: float = 0.7  #: of the trunk's radius
    macular_share: float = 0.3
    scatter_start: float = 0.06  #: standard deviations of those points
    scatter_arcade: float = 0.16
    scatter_nasal: float = 0.15
    apart: float = 0.10  #: arteries leave the disc to one side, veins to the other

    # vessels
    step: float = 0.05  #: between points
    taper: float = 30.0  #: length over which a trunk's radius falls to 1/e
    wave: float = 0.05  #: tortuosity, standard deviation
    wave_steps: float = 6.0  #: and its smoothing [steps]
    wave_after: float = 1.0  #: it begins at the disc and is whole after this
    shortest: int = 6  #: points of a vessel

    # branches
    trunk: Branching = Branching((0.9, 1.6), (0.7, 1.4), (0.3, 0.6))
    branch: Branching = Branching((0.4, 0.8), (0.45, 1.1), (0.45, 0.75))
    generations: int = 4
    bare_end: float = 0.3  #: no branch so near a vessel's end
    angle_deg: Range = (30.0, 60.0)
    alternates: float = 0.7  #: how often the next branch leaves to the other side
    length_mm: float = 45.0  #: of a branch of radius 1, times radius^exponent
    length_exponent: float = 0.7
    length_spread: Range = (0.7, 1.3)
    thins_to: float = 0.35  #: of its radius, at its end
    fewest_steps: int = 8
    turn_kept: float = 0.75  #: part of a step's turn that the next one keeps
    turn: float = 0.03  #: and what it adds, standard deviation [rad]
    drawn_from: float = 3.0  #: nearer the fovea than this, branches are drawn towards it
    bent_from: float = 0.9  #: and nearer than this bent round it
    drawn: float = 0.02  #: [rad a step]
    bent: float = 0.06  #: [rad a step]
    bent_to: float = 1.4  #: off the direction to the fovea [rad]

    # relative changes of the layers: (amplitude, size of the features)
    melanin: tuple[Range, Range] = ((0.08, 3.0), (0.04, 0.4))
    blood: Range = (0.10, 1.5)
    choroid: float = 0.10  #: amplitude of the choroid's own vessels in the blood
    choroid_size: float = 1.6  #: of the noise at whose zeros they run
    choroid_width: float = 0.22  #: of a vessel, in deviations of that noise
    epithelium: tuple[Range, Range] = ((0.05, 2.0), (0.03, 0.15))
    most_melanin: float = 0.3  #: changes are cut off at these
    most_blood: float = 0.4
    most_epithelium: float = 0.25


GROWTH = Growth()
