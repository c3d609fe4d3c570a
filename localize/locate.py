"""One call for every localizer."""

from __future__ import annotations

import difflib
from collections.abc import Callable

from numpy.typing import ArrayLike

from localize.image import AnyImage, checked
from localize.outcome import Outcome
from localize.published import paper, paper_code, paper_code_float, paper_code_oracle
from scene import InputError, Pose, Scene

#: a checked image `[H, W]` or `[H, W, 3]`, the scene that took it and, for an oracle, the truth
Localizer = Callable[[AnyImage, Scene, Pose | None], Outcome]

#: every localizer by its name; a name that ends in "-oracle" is given the true pose, no other one is
LOCALIZERS: dict[str, Localizer] = {
    "paper": paper,
    "paper-code": paper_code,
    "paper-code-float": paper_code_float,
    "paper-code-oracle": paper_code_oracle,
}


def locate(image: ArrayLike, scene: Scene, localizer: str = "paper", *, oracle: Pose | None = None) -> Outcome:
    """Where the instrument is, from one image of its spotlights' patches.

    `image` is `[H, W]` grey or `[H, W, 3]` RGB with the resolution of `scene.camera`: uint8 (255 is white), uint16
    (`scene.sensor.full_scale` is white) or float (1.0 is white). `oracle` is the true pose, needed by the localizers
    whose name ends in "-oracle" and refused by all others.

    Returns a Localization (`apex_mm [3]`, unit `axis [3]` from the RCM into the light), or a LocalizationFailure,
    which is falsy and has a `reason`. Raises InputError for an unknown localizer, an image that cannot be read or
    does not fit the scene, and a missing or unwanted `oracle`.
    """
    if localizer not in LOCALIZERS:
        near = difflib.get_close_matches(str(localizer), list(LOCALIZERS), n=1)
        hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(LOCALIZERS)}"
        raise InputError(f"unknown localizer '{localizer}'; {hint}")
    if localizer.endswith("-oracle") and oracle is None:
        raise InputError(f"localizer '{localizer}' chooses by the true pose; give it as oracle=")
    if not localizer.endswith("-oracle") and oracle is not None:
        raise InputError(f"localizer '{localizer}' must not see the true pose; leave oracle= out")
    return LOCALIZERS[localizer](checked(image, scene), scene, oracle)
