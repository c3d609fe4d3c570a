"""How well what is known beside the image is known: the RCM, the half angle, the eye, the camera."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

from conespot.localize.model.deep import Deep
from conespot.localize.model.quantity import QUANTITIES, Quantity
from conespot.localize.model.smear import smear_sigma
from conespot.scene.document import InputError
from conespot.scene.scene import Scene

#: how well the RCM is known where nobody says: an assumption and no measurement. An RCM that is 0.1 mm off sideways
#: moves the tip by 12 um (3 mm high) to 25 um (6 mm), so this one leaves half of that
RCM_SIGMA_MM = 0.05
#: how well the amount of a scene's deep light and how far it goes are known, as logarithms: scattering coefficients of
#: tissue are known to a factor of two
DEEP_SIGMA = math.log(2.0)
#: diameters of fibres' cores that nobody told of
CORE_SIGMA_MM = 0.1
_DOUBTED = ("blur_sigma_mm", "core_sigma_mm")
_USUAL = ("smear_sigma_mm", "deep_amount_sigma", "deep_length_sigma")


@dataclass(frozen=True)
class Knowns:
    """Standard deviations of what the scene states; 0 is exactly known, None is free.

    The needle passes through the scene's RCM within `rcm_sigma_mm` sideways; every other field is that of one of
    `QUANTITIES`. Raises InputError for a negative value.
    """

    rcm_sigma_mm: float | None = RCM_SIGMA_MM
    half_angle_sigma_deg: float | None = 0.0
    softness_sigma: float | None = 0.0  #: of a `cycles` beam's blend
    #: of the lens' residual blur, with what else spreads the image alike: the square of its width may be off by the
    #: square of this. Doubted, it is as the scene says until a frame contradicts that, and then free
    blur_sigma_mm: float | Literal["doubted"] | None = "doubted"
    #: of the diameter of the core that the light leaves: its square may be off by the square of this
    core_sigma_mm: float | Literal["doubted"] | None = "doubted"
    #: root mean square way of the tip along an axis in one exposure, about its middle, if it trembles; usual is what
    #: the scene's tremor has
    smear_sigma_mm: float | Literal["usual"] | None = "usual"
    eye_radius_sigma_mm: float | None = 0.0
    camera_height_sigma_mm: float | None = 0.0
    #: of each of the retina's semi-axes: `scene.population.SEMI_AXES_SIGMA_MM` about the mean eye for an unknown one
    semi_axes_sigma_mm: float | None = 0.0
    camera_tilt_sigma_deg: float | None = 0.0  #: of how far the camera's axis leans, towards +x and towards +y each
    #: how far the wall may be raised or sunk at any place beside what the scene's surface says [mm]: bumps nobody
    #: measured, a height map's error. No fit sees it; the distance from the wall does
    relief_sigma_mm: float = 0.0
    #: of the logarithms of how much light comes back from under the retina and of how far it goes; usual is a factor of
    #: two where the scene's retina spreads light, and elsewhere that none does until a patch glows beyond its rim. An
    #: amount known exactly, with 0, is not doubted
    deep_amount_sigma: float | Literal["usual"] | None = "usual"
    deep_length_sigma: float | Literal["usual"] | None = "usual"

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if value is None or (value == "usual" and name in _USUAL) or (value == "doubted" and name in _DOUBTED):
                continue
            if isinstance(value, str) or not (math.isfinite(value) and value >= 0.0):
                raise InputError(f"knowns: {name} must be 0 (exact), positive, or None (free), got {value!r}")

    def within(self, scene: Scene) -> Knowns:
        """The same with what is usual in such a scene."""
        deep = 0.0 if Deep.of(scene) is None else DEEP_SIGMA
        usual = zip(_USUAL, (smear_sigma(scene), deep, deep), strict=True)
        return replace(self, **{name: sigma for name, sigma in usual if getattr(self, name) == "usual"})

    @property
    def free(self) -> tuple[Quantity, ...]:
        """The scene's quantities that join the fit, in the order of its parameters."""
        return _free(self)

    @property
    def doubting(self) -> Knowns:
        """The same with a doubted blur free."""
        return replace(self, blur_sigma_mm=None) if self.blur_sigma_mm == "doubted" else self

    @property
    def doubting_core(self) -> Knowns:
        """The same with a doubted core free as well, which only a hard edge tells from a blur."""
        doubting = self.doubting
        return replace(doubting, core_sigma_mm=CORE_SIGMA_MM) if self.core_sigma_mm == "doubted" else doubting

    def sigma(self, quantity: Quantity) -> float | None:
        """Sigma of a quantity in the unit held inside; None if it is free, 0 if it is doubted or usual."""
        own: float | str | None = getattr(self, quantity.known)
        if own is None:
            return None
        return 0.0 if isinstance(own, str) else (own * quantity.per_unit) ** quantity.power


@lru_cache(maxsize=64)
def _free(knowns: Knowns) -> tuple[Quantity, ...]:
    """A fit asks for those of the same knowns at each step."""
    return tuple(each for each in QUANTITIES if knowns.sigma(each) != 0.0)
