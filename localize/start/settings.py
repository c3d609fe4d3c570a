"""The tuned numbers of the start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StartSettings:
    """Tuned numbers of the start: rings, rays, rigs, and the search over them."""

    # rings
    overview_px: int = 500
    bin_side: int = 4
    fine_bin_side: int = 2
    fine_reach: float = 8.0
    dark_share: float = 0.5
    noise_sigmas: float = 4.0
    vote_blur: float = 0.7
    half_vote: float = 0.12
    radius_ratio: float = 1.2
    ring_width: float = 0.6
    ring_width_share: float = 0.08
    nearest: float = 0.7
    smallest: float = 1.2
    hidden_width: int = 3
    one_ring_size: float = 2.0
    one_ring_place: float = 0.5
    # rays
    rays: int = 36
    fewest_rays: int = 9
    reach: tuple[float, float] = (0.5, 1.43)
    spacing: float = 0.04
    samples_missed: int = 4
    shift: float = 0.03
    most_shift: int = 8
    inside: float = 0.7
    outside: float = 1.15
    ray_blur: float = 0.03
    least_blur: float = 0.5
    sampling_blur: float = 0.4
    widest_blur: float = 0.25
    white: float = 0.97
    clipped_share: float = 0.3
    least_contrast: float = 0.05
    darkest_profile: float = 0.02
    clipped_contrasts: tuple[float, ...] = (1.0, 4.0, 16.0, 64.0)
    doubted_contrasts: tuple[float, ...] = (0.06, 0.12, 0.25, 0.5, 1.0, 2.0)
    rim_contrast: float = 30.0
    # rigs
    rolls: int = 36
    rig_steps: int = 3
    size_weight: float = 0.5
    matched: float = 0.8
    turned: float = 0.6
    farthest: float = 0.95
    # search
    most_rings: int = 6
    rings_per_spotlight: int = 2
    rival_votes: float = 0.85
    rival_distance: float = 0.7
    turns: int = 4
    ray_worth: float = 0.2
    fewest_points: int = 8
    outline_error: float = 0.01
    longest_step: float = 0.4
    still_mm: float = 0.01
    still_rad: float = 1e-3
    dark: float = 0.05
    solid: float = 0.5
    same: float = 0.3
    apart_mm: float = 0.1
    apart_rad: float = 0.2
    convincing: float = 0.6
    clear: float = 0.52
    least_share: float = 0.25
    faintest: float = 0.3
    as_good: float = 0.8
    touching: float = 0.25
    apart: float = 0.5
    most_starts: int = 3
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
