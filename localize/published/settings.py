"""The numbers of the published methods, in one place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PublishedSettings:
    """What the paper and its authors' code fix, and what they leave open."""

    #: sides of the Gaussian and the median before Otsu [px]. The paper (3.1) names the filters but not their sizes:
    #: a choice of ours
    gaussian: int = 9
    median: int = 5
    #: the authors' code: side of its median [px], and the grey value of 255 that a patch exceeds
    coded_median: int = 9
    coded_threshold: int = 50
    #: an outline of fewer points carries no ellipse: a conic has five coefficients (the authors' rule)
    fewest_points: int = 6
    #: a blob of less area than this share of the largest is texture, not a spotlight: all cones are equal and share
    #: one apex
    smallest_share: float = 0.1
    #: light of what is cut out over that of the rest below which it is the ground's own and no spotlight's: a choice of
    #: ours, like the refusal itself. No answer of `campaign run reproduce_ci` changes
    least_contrast: float = 2.0
    #: pixels a side, about, from which the ground is judged
    contrast_px: int = 250
    #: a - b of the ellipse [px] below which one spotlight does not tell where its cone leans; an outline of whole
    #: pixels places a - b to about that, and at 9 deg it is worth 0.15 mm sideways
    round_px: float = 0.1


PUBLISHED = PublishedSettings()
