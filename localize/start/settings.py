"""The tuned numbers of the start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StartSettings:
    """Tuned numbers of the start: rings, rays, rigs, and the search over them.

    Lengths are pixels of the overview or of the vote, shares of a patch's radius, or mm where the name says so.
    `campaign run gross_errors` judges them together, on eyes on which none was set: one gross error in 7,314 answers.
    `python benchmarks/tuned_start.py` halves and doubles each. Where that was done, what it did among 48 lit frames, 18
    of them faint, stands behind the number: right starts won or lost, and wrong ones put to the fit. As they are, 43
    have the right start and 2 wrong ones are put to it. The others have been tried by no more than the campaign.
    """

    # Rings: the frame at a glance, and the vote of its gradients.

    #: sides of the overview, about [px], and pixels of it a side of a bin of the vote; small rings need finer bins,
    #: up to a radius of `fine_reach` bins, from where the coarse ones see them
    overview_px: int = 500  # half -8 and 1 wrong one more, twice +3 and 1 wrong one fewer
    bin_side: int = 4  # half -2, twice -5 and 1 wrong one more
    fine_bin_side: int = 2  # half and twice 0
    fine_reach: float = 8.0  # half and twice 0
    #: what is added before the logarithm, so that noise in the dark and dark vessels count little: this share of the
    #: frame's median, and this many sigmas of its noise
    dark_share: float = 0.5  # half 0, twice -3 and 2 wrong ones fewer
    noise_sigmas: float = 4.0  # half 0, twice -3 and 1 wrong one fewer
    #: blur before gradients are taken [bins]: with Scharr's own, gradients of the scale of a bin
    vote_blur: float = 0.7  # half -1, twice -1
    #: gradient of the log light of a bin that has half a vote: a step of 12 % from one bin to the next
    half_vote: float = 0.12  # half 0, twice 0 and 1 wrong one more
    #: ratio of neighbouring radii: a ring between two of them is 9 % off one, about its own width
    radius_ratio: float = 1.2  # half, no ratio at all, -11, twice -5
    #: sigma of a ring's width [bins], and as a share of its radius: patches are no circles
    ring_width: float = 0.6  # half 0, twice -3
    ring_width_share: float = 0.08  # half 0, twice -1
    #: the smallest ring, by the tip's distance from the wall [mm], and in bins; the largest is that of a tip a radius
    #: of the eye away
    nearest: float = 0.7  # half and twice 0
    smallest: float = 1.2  # half and twice 0
    #: radius of the smallest spot that is looked for in the whole frame [px]: hot pixels and their neighbours are
    #: smaller; and ratio of neighbouring ones
    tiniest: float = 2.0
    spot_ratio: float = 1.4
    #: log light by which a spot must stand out, and share of it that another one may have: of near_retina's ideal
    #: frames the patches have 3.4 to 3.9
    spot: float = 2.0
    only: float = 0.7
    #: how wide the gradients along a ring that was found are taken out of the vote [bins]: both sides of a blurred rim
    hidden_width: int = 3  # half and twice 0
    #: rings nearer than this share of the larger radius, and less than this ratio apart in size, are one
    one_ring_place: float = 0.5  # half and twice 0
    one_ring_size: float = 2.0  # half -5 and 2 wrong ones fewer, twice 0

    # Rays across an outline; what follows is in units of the distance from the patch's middle to its outline.

    #: rays around an outline, one every 10 deg, and of how many the frame must show enough: a quarter of the outline
    rays: int = 36  # half 0 and 1 wrong one fewer, twice 0
    fewest_rays: int = 9  # half and twice 0
    #: from where to where a ray is sampled, how densely, and how many of the outer samples may lie outside the frame
    reach: tuple[float, float] = (0.5, 1.43)  # half -43 and 2 wrong ones fewer, twice -43 and 2 wrong ones fewer
    spacing: float = 0.04  # half 0, twice 0 and 2 wrong ones fewer
    samples_missed: int = 4  # half and twice 0
    #: by how much the outline is moved at a time, and how often to either side: a quarter of the radius, as far as a
    #: ring of neighbouring radius and place may be off
    shift: float = 0.03  # half -2 and 2 wrong ones fewer, twice 0 and 11 wrong ones more
    most_shift: int = 8  # half and twice 0
    #: up to where a sample is safely inside, and from where outside, for the contrast between the two
    inside: float = 0.7  # half -43 and 2 wrong ones fewer, twice -2
    outside: float = 1.15  # half -21 and 3 wrong ones more, twice -43 and 2 wrong ones fewer
    #: blur of what the rays see, the step of the shifts; at least so much [px of the overview], and what bilinear
    #: sampling blurs besides (a triangle's sigma is 1 / sqrt(6) = 0.41 px); of the model's blur this is the most
    ray_blur: float = 0.03  # half -11 and 2 wrong ones fewer, twice +2 and 10 wrong ones more
    least_blur: float = 0.5  # half 0, twice +3 and 1 wrong one fewer
    sampling_blur: float = 0.4  # half 0, twice -2 and 2 wrong ones more
    widest_blur: float = 0.25  # half and twice 0
    #: blurs of the image, over a patch's size, that are tried where more than this share of the gradients is left
    #: unexplained, and what they must leave of that: a blur of 20 um is 0.03 of a patch seen from 4 mm. On frames
    #: without blur no start changes
    image_blurs: tuple[float, ...] = (0.03, 0.06)
    doubted: float = 0.3
    clearly: float = 0.6
    #: share of white from which on a sample is clipped, and share of clipped samples that make a patch clipped
    white: float = 0.97  # half 0, twice -4
    clipped_share: float = 0.3  # half and twice 0
    #: the contrast is never taken to be less than this log light, nor the profile inside darker than this share
    least_contrast: float = 0.05  # half and twice 0
    darkest_profile: float = 0.02  # half and twice 0
    #: contrasts that are tried, over the one measured: of a clipped patch only the rim is seen, so that it may be
    #: brighter by any factor; where other things are bright, what lies inside and outside the outline says little
    clipped_contrasts: tuple[float, ...] = (1.0, 4.0, 16.0, 64.0)  # half and twice 0
    doubted_contrasts: tuple[float, ...] = (0.06, 0.12, 0.25, 0.5, 1.0, 2.0)
    #: a patch over its surroundings, for where its soft rim seems to be; only the logarithm matters
    rim_contrast: float = 30.0

    # Rigs: the patches of several spotlights on the rings.

    #: rolls that are tried, one every 10 deg, and how far two must be apart to count as two [rad]: less than the
    #: 2 pi / 6 between the spotlights of the largest rig the designs have
    rolls: int = 36
    turned: float = 0.6
    #: rounds in which a ring's pose and the axis of its spotlight are brought together
    rig_steps: int = 3
    #: what a ratio of e between the radii of ring and patch counts as, as a distance in radii, and the distance at
    #: which a patch counts as not found
    size_weight: float = 0.5
    matched: float = 0.8
    #: share of the RCM's distance that a tip may be away from its patch: it is below the RCM
    farthest: float = 0.95

    # The search.

    #: rings that are followed, and how many more for each spotlight of a rig
    most_rings: int = 6
    rings_per_spotlight: int = 2
    #: share of the best ring's votes with which another may be the patch, if it is this many radii apart
    rival_votes: float = 0.85
    rival_distance: float = 0.7
    #: steps from a ring's pose to that of the outline the rays see, and below which a step is the last
    turns: int = 4
    still_mm: float = 0.01
    still_rad: float = 1e-3
    #: share of a ray's gradients that must say where the outline is, and how many rays must say so: twice the
    #: parameters of a rig's pose through the RCM
    ray_worth: float = 0.2
    fewest_points: int = 8
    #: scatter of the rays' outline that is always granted, a third of their step, and the longest step of the tip over
    #: its distance from the wall
    outline_error: float = 0.01
    longest_step: float = 0.4
    #: share explained of one spotlight's outline below which it is not there
    dark: float = 0.05
    #: a ring whose outline is within `same` of a start that explains more than `solid` is not followed once more
    solid: float = 0.5
    same: float = 0.3
    #: starts or answers nearer than this are one [mm, rad]: 0.2 rad is two of the rolls tried
    apart_mm: float = 0.1
    apart_rad: float = 0.2
    #: how often the best start's sigma of the tip another roll of a rig's must be to be dismissed: the wrong ones of
    #: three frames of `theatre` with three spotlights have 5 to 9 times
    less_sure: float = 4.0
    #: and by how much its bins' log-likelihood, one in the mean, must be less: 0.38 in the one frame of `theatre` that
    #: the tips' sigmas do not decide, 0.08 in one that they do. A band's thousands of bins count as hundreds, since
    #: neighbours err together
    less_likely: float = 0.1
    #: share of the gradients that a patch explains where nothing else is bright; a disc may explain nearly as much
    convincing: float = 0.6
    #: share that a quarter of the rays across a ring elsewhere exceed where that may be another spotlight's patch: of
    #: six pairs of patches the least has 0.5, of the other rings there none more than 0
    elsewhere: float = 0.3
    #: what crosses a rim hides it on some rays only: a quarter of them must see more of the beam's edge than of all
    #: else, so more than half
    clear: float = 0.52
    #: votes with which a refused frame's best ring is said to be something round: frames of noise have 0.14, hard and
    #: soft patches 0.88 (`pytest tests/unit/localize/test_doubt.py`); it decides on no answer
    round: float = 0.5
    #: log light that all rays together must see in the mean, and the share of it: the retina's own mottle stays below
    faintest: float = 0.3
    least_share: float = 0.25
    #: share of the best start's evidence with which another one may be right: after a convincing one, and otherwise
    #: where the two touch, so that each hides part of the other's outline, or lie apart; and how many are fitted. With
    #: less than the least of these no ring is another instrument's patch
    as_good: float = 0.8
    touching: float = 0.25
    apart: float = 0.5
    most_starts: int = 3
    #: of a patch's radius within which a fit stays near its start, which is good to a third of it
    near: float = 0.1

    @property
    def along(self) -> Array:
        """Where rays are sampled, over the distance from a patch's middle to its outline."""
        return np.arange(*self.reach, self.spacing, dtype=np.float64)

    @property
    def shifts(self) -> Array:
        """Moves of the outline that are tried, over the same distance."""
        return self.shift * np.arange(-self.most_shift, self.most_shift + 1, dtype=np.float64)


START = StartSettings()
