"""What a localizer is to everybody else: what it does, what it is given, and the words for what it assumes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from conespot.localize.image import AnyImage, Reference
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.outcome import Outcome
from conespot.scene import Pose, Scene

NOT_STATED = "not stated"


@dataclass(frozen=True)
class Beside:
    """What a localizer is given beside the image and the scene; None is not given.

    `truth` is the pose itself and goes to those that need it alone. `knowns` says how well the scene's quantities are
    known, `reference` is the view without spotlights, `noise` the sensor's where it is not the scene's.
    """

    truth: Pose | None = None
    knowns: Knowns | None = None
    reference: Reference | None = None
    noise: NoiseModel | None = None


@dataclass(frozen=True)
class Localizer:
    """A localizer. `run` answers a checked image `[H, W]` or `[H, W, 3]` and the scene that took it.

    `threshold` and `ambiguity` are the words of the assumption tables: how light is told from dark, and how the two
    cones over one ellipse. One that `needs_truth` is an oracle; one that `takes_knowledge` is given `Beside.knowns`,
    `reference` and `noise`, and should answer with a covariance.
    """

    run: Callable[[AnyImage, Scene, Beside], Outcome]
    threshold: str = NOT_STATED
    ambiguity: str = NOT_STATED
    needs_truth: bool = False
    takes_knowledge: bool = False

    @classmethod
    def plain(
        cls, function: Callable[[AnyImage, Scene], Outcome], threshold: str = NOT_STATED, ambiguity: str = NOT_STATED
    ) -> Localizer:
        """A localizer that looks at the image and the scene, and at nothing beside them."""
        return cls(lambda image, scene, beside: function(image, scene), threshold, ambiguity)
