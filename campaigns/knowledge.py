"""What a campaign tells its localizers beside the image: the scene, how wrong, how well known, and unlit frames.

The renderer has the true scene. A localizer is told one whose quantities carry errors drawn anew for every pose, the
sigmas it may assume (`Knowns`, all that a localizer itself sees of this), and perhaps a reference. None of it is the
pose.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, PlainSerializer, WrapValidator, model_validator

from conespot.localize.model.knowns import RCM_SIGMA_MM, Knowns
from conespot.localize.model.quantity import quantity
from conespot.scene import Scene
from conespot.scene.beam import Beam
from conespot.scene.model import Model, Words
from conespot.scene.quantity import Angle, Length, format_quantity
from conespot.scene.retina import Spread
from conespot.scene.surface import AnySurface

FREE = "free"


def _sigma(kind: str | None, quantity: Any, *words: str) -> Any:
    """A sigma of that kind of quantity, `free`, or another of the words."""

    def read(value: object, quantity: Callable[[object], float]) -> float | str | None:
        if value == FREE:
            return None
        return value if isinstance(value, str) and value in words else quantity(value)

    def write(value: float | str | None) -> float | str:
        if value is None:
            return FREE
        return value if kind is None or isinstance(value, str) else format_quantity(value, kind)

    return Annotated[
        Annotated[quantity, Field(ge=0.0)],
        WrapValidator(read),
        Words(lambda: [FREE, *words]),
        PlainSerializer(write, when_used="json"),
    ]


if TYPE_CHECKING:
    Sigma = float | None
    LengthSigma = float | None
    AngleSigma = float | None
    DoubtedSigma = float | Literal["doubted"] | None
    UsualSigma = float | Literal["usual"] | None
else:
    Sigma = _sigma(None, float)
    LengthSigma = _sigma("length", Length)  #: [mm], None if free
    AngleSigma = _sigma("angle", Angle)  #: [rad], None if free
    DoubtedSigma = _sigma("length", Length, "doubted")  #: [mm]
    UsualSigma = _sigma(None, float, "usual")


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)


class Knowledge(Model):
    """Errors (standard deviations of what is told) and sigmas (what a localizer may assume); `free` is not known.

    `rcm` is in mm along each axis, the others are in their own unit. `surface` and `beam` are what the localizers are
    told in place of the true ones, and so is `blur`, the width of what the camera's lens does not resolve (0 mm: it
    resolves all). Blur and core are `doubted` where nothing is said: free once a frame contradicts the scene by three
    sigmas. Without `spread_told` they are told that no light spreads under the retina; `spread_error` is of the
    logarithms of its amount and of how far it goes. `reference` is how many frames without spotlights they are given,
    averaged; `sequence` from how many of the trajectory's own frames, evenly spread, they learn the same view.
    """

    rcm_error: Length = Field(0.0, ge=0.0)
    rcm_sigma: LengthSigma = RCM_SIGMA_MM
    half_angle_error: Angle = Field(0.0, ge=0.0)
    half_angle_sigma: AngleSigma = 0.0
    eye_radius_error: Length = Field(0.0, ge=0.0)
    eye_radius_sigma: LengthSigma = 0.0
    camera_height_error: Length = Field(0.0, ge=0.0)
    camera_height_sigma: LengthSigma = 0.0
    camera_tilt_sigma: AngleSigma = 0.0
    semi_axes_sigma: LengthSigma = 0.0
    relief_sigma: Length = Field(0.0, ge=0.0)
    deep_amount_sigma: UsualSigma = "usual"
    deep_length_sigma: UsualSigma = "usual"
    softness_sigma: Sigma = 0.0
    blur_sigma: DoubtedSigma = "doubted"
    core_sigma: DoubtedSigma = "doubted"
    blur: Length | None = Field(None, ge=0.0, le=0.2)
    surface: AnySurface | None = None
    beam: Beam | None = None
    spread_told: bool = True
    spread_error: float = Field(0.0, ge=0.0, le=2.0)
    reference: int = Field(0, ge=0, le=1000, strict=True)
    sequence: int = Field(0, ge=0, le=1000, strict=True)

    @model_validator(mode="after")
    def _one_view(self) -> Knowledge:
        if self.reference and self.sequence:
            raise ValueError("give either reference or sequence: both are the view without spotlights")
        if self.sequence == 1:
            raise ValueError("sequence must be at least 2: one frame hides what its own patch covers")
        return self

    @property
    def drawn_anew(self) -> bool:
        """Whether every pose is told a scene of its own."""
        return any((self.rcm_error, self.half_angle_error, self.eye_radius_error, self.camera_height_error))

    @property
    def knowns(self) -> Knowns:
        """What a localizer may assume of the scene that it is told."""
        return Knowns(
            rcm_sigma_mm=self.rcm_sigma,
            half_angle_sigma_deg=_degrees(self.half_angle_sigma),
            eye_radius_sigma_mm=self.eye_radius_sigma,
            camera_height_sigma_mm=self.camera_height_sigma,
            camera_tilt_sigma_deg=_degrees(self.camera_tilt_sigma),
            semi_axes_sigma_mm=self.semi_axes_sigma,
            relief_sigma_mm=self.relief_sigma,
            deep_amount_sigma=self.deep_amount_sigma,
            deep_length_sigma=self.deep_length_sigma,
            softness_sigma=self.softness_sigma,
            blur_sigma_mm=self.blur_sigma,
            core_sigma_mm=self.core_sigma,
        )

    def told(self, scene: Scene, rng: np.random.Generator) -> Scene:
        """The scene as a localizer is told it at one pose."""
        # always the same draws, so that one quantity's error does not change another's
        rcm, others = rng.standard_normal(3), rng.standard_normal(3)
        update: dict[str, Any] = {}
        if self.rcm_error:
            told = np.asarray(scene.instrument.rcm) + self.rcm_error * rcm
            update["instrument"] = scene.instrument.model_copy(update={"rcm": tuple(map(float, told))})
        if self.half_angle_error:
            update["beam"] = scene.beam.stretched(scene.beam.half_angle + self.half_angle_error * float(others[0]))
        if self.eye_radius_error:
            radius = scene.eye.radius + self.eye_radius_error * float(others[1])
            update["eye"] = scene.eye.model_copy(update={"radius": radius})
        if self.camera_height_error:
            height = scene.camera.height + self.camera_height_error * float(others[2])
            update["camera"] = scene.camera.model_copy(update={"height": height})
        if self.surface is not None:
            update["surface"] = self.surface
        if self.beam is not None:
            update["beam"] = self.beam
        if scene.spread is not None:
            update["retina"] = scene.retina.model_copy(update={"spread": self._spread(scene.spread, rng)})
        told_scene = scene.model_copy(update=update)
        return told_scene if self.blur is None else quantity("blur").write(told_scene, self.blur**2)

    def _spread(self, true: Spread, rng: np.random.Generator) -> Spread | None:
        """What is told of light under the retina."""
        if not self.spread_told:
            return None
        amount, length = np.exp(self.spread_error * rng.standard_normal(2)).tolist()
        return true.model_copy(update={"amount": true.amount * amount, "length": true.length * length})
