"""The tuned numbers of the search for an optic disc under a patch."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DiscSettings:
    """Tuned numbers of the search for an optic disc under a patch."""

    #: bins across a patch, and of its size seen around it
    bins: int = 48
    margin: float = 0.3
    #: radii that are looked for [mm], and how many: in the mean discs are 1.77 mm wide and 1.88 high (H. A. Quigley et
    #: al., Arch. Ophthalmol. 108:51, 1990)
    radii: tuple[float, float] = (0.7, 1.2)
    sizes: int = 8
    #: of what it is like before it is fitted: width of the rim [mm] and height of the step
    rim: float = 0.05
    height: float = 1.5
    #: how far each coordinate may be off that, and go in a step
    sigmas: tuple[float, ...] = (0.3, 0.3, 0.25, 0.15, 0.15, 1.0, 1.0)
    longest: tuple[float, ...] = (0.05, 0.05, 0.05, 0.05, 0.05, 0.5, 0.5)
    #: blur before gradients vote [mm], how far off the votes for one middle fall [mm], the slope that has half a vote
    #: [1/mm] and the deviations of the slopes' noise that have
    vote_blur: float = 0.03
    vote_off: float = 0.1
    half_vote: float = 0.7
    vote_sigmas: float = 3.0
    #: a round with a smaller share of a whole rim's votes is none, nor is one that has less in common with the patch,
    #: over what both cover. What fits without a disc leave of 60 frames away from discs (`gross_errors` over eyes 200
    #: to 207) has at most 0.38 of the votes where it has 0.3 in common. The worst answers to 73 frames of the image
    #: model with a disc (eyes 210 to 249), 105 and 122 um off at stated 40 and 52, have 1.1. Not set on, but so: 22
    #: frames of two tips of `gross_errors --poses 76` have 0.65 to 1.28
    votes: float = 0.5
    shared_first: float = 0.3
    #: what disc and patch have in common over what both cover, from which on their rims may be mistaken for one
    #: another: 0.6 and 0.8 in those two. The 22 have 0.67 to 0.91
    shared: float = 0.5
    #: share of the model's light below which a bin counts as that dark, where rounds are looked for
    darkest: float = 0.02
    #: rms of what a log albedo of two levels leaves of a retina
    rest: float = 0.08
    #: steps of a fit, the first of which leave the tip where it is
    steps: int = 40
    still: int = 4
    #: a step that gains less ends a fit [twice a log-likelihood]
    done: float = 0.05
    #: longest step of the tip [mm], and how far it may go before the bins that it lights are looked up anew [mm]
    longest_mm: float = 0.15
    stale_mm: float = 0.04


DISC = DiscSettings()
