"""How well what is known beside the image is known: the RCM, the half angle, the eye, the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass

from conespot.localize.model.quantity import QUANTITIES, Quantity
from conespot.scene.document import InputError

#: how well the RCM is known where nobody says: an assumption and no measurement. An RCM that is 0.1 mm off sideways
#: moves the tip by 12 um (3 mm high) to 25 um (6 mm), so this one leaves half of that
RCM_SIGMA_MM = 0.05


@dataclass(frozen=True)
class Knowns:
    """Standard deviations of what the scene states; 0 is exactly known, None is free.

    The needle passes through the scene's RCM within `rcm_sigma_mm` sideways; every other field is that of one of
    `QUANTITIES`. Raises InputError for a negative value.
    """

    rcm_sigma_mm: float | None = RCM_SIGMA_MM
    half_angle_sigma_deg: float | None = 0.0
    softness_sigma: float | None = 0.0  #: of a `cycles` beam's blend
    eye_radius_sigma_mm: float | None = 0.0
    camera_height_sigma_mm: float | None = 0.0
    #: of each of the retina's semi-axes: `scene.population.SEMI_AXES_SIGMA_MM` about the mean eye for an unknown one
    semi_axes_sigma_mm: float | None = 0.0
    #: how far the wall may be raised or sunk at any place beside what the scene's surface says [mm]: bumps nobody
    #: measured, a height map's error. No fit sees it; the distance from the wall does
    relief_sigma_mm: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value is not None and not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"knowns: {name} must be 0 (exact), positive, or None (free), got {value!r}")

    @property
    def free(self) -> tuple[Quantity, ...]:
        """The scene's quantities that join the fit, in the order of its parameters."""
        return tuple(each for each in QUANTITIES if self.sigma(each) != 0.0)

    def sigma(self, quantity: Quantity) -> float | None:
        """Sigma of a quantity in the unit held inside; None if it is free."""
        own: float | None = getattr(self, quantity.known)
        return None if own is None else own * quantity.per_unit
