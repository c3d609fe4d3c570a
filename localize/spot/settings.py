"""The tuned numbers of the spot's fit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SpotSettings:
    """Tuned numbers of the spot's fit; `campaign run near_retina` judges them together."""

    #: what spreads the image across a patch's edge (a standard deviation), over the patch's radius, from which on its
    #: edge is no edge of its own any more: in `theatre` that of tips nearer than 1.5 mm
    wide: float = 0.15
    #: by which factor a ring may be larger than the patch it is on: a clipped one glows beyond its rim
    larger: float = 1.6
    #: bins across a patch, at most: half of what spreads it
    bins: int = 24
    #: how far beyond the outline a window goes: standard deviations of what spreads the image, and shares of its size
    around: float = 3.0
    margin: float = 0.2
    #: directions over half a turn in which the way is first looked for, and how long it is there over the standard
    #: deviation of one of its coordinates: the mean length of two
    directions: int = 4
    first_way: float = 1.4
    #: of the brightest light, by how much an even retina is off; and the most evaluations of the light with it
    even: float = 0.02
    first_steps: int = 12
    #: share of the light's variance in the window that a spot explains: of twelve frames of `theatre` 0.998 at least,
    #: of a cone of light 0.982 and of an even disc 0.9
    explained: float = 0.99
    #: by how much the model alone is off: each coordinate of the tip [mm], and along the needle so much [mm] and as the
    #: inverse square of its distance from the wall [mm^3]. Light of ninety places of a core and twelve instants in
    #: `theatre`'s optics puts distances 6 to 7 um off at 0.15 mm, 1 to 2 at 0.3, and a tremor's way, not quite
    #: straight, by 1.1 rms. Without the second and with half of the third 53 frames of near_retina's `theatre` erred by
    #: 1.7 sigmas rms, 6 um along the needle; as it is, by 1.0. What the rest of it is is not known
    model_mm: float = 1.2e-3
    along_mm: float = 3.6e-3
    near_mm3: float = 3.5e-4
    #: of the brightest light, by how much a bin's is off where the model is: a foot that it has not counts for little
    light: float = 0.01
    #: steps of the last fit, at most, and the longest of the tip along a coordinate [mm]
    steps: int = 25
    longest_step_mm: float = 0.1
    #: a step this short [sigmas] ends it: what is left is below the noise
    done_sigmas: float = 0.1


SPOT = SpotSettings()
