"""One call for every localizer."""

from __future__ import annotations

import difflib
from collections.abc import Callable

from numpy.typing import ArrayLike

from conespot.localize.cone import cone
from conespot.localize.image import AnyImage, Reference, checked
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.prior import Knowns
from conespot.localize.outcome import Outcome
from conespot.localize.photometric import photometric
from conespot.localize.published.methods import paper, paper_code, paper_code_float, paper_code_oracle
from conespot.scene import InputError, Pose, Scene

#: a checked image `[H, W]` or `[H, W, 3]`, the scene that took it and, for an oracle, the truth
Localizer = Callable[[AnyImage, Scene, Pose | None], Outcome]

#: every localizer by its name; a name that ends in "-oracle" is given the true pose, no other one is
LOCALIZERS: dict[str, Localizer] = {
    "paper": paper,
    "paper-code": paper_code,
    "paper-code-float": paper_code_float,
    "paper-code-oracle": paper_code_oracle,
    "cone": lambda image, scene, oracle: cone(image, scene),
    "photometric": lambda image, scene, oracle: photometric(image, scene),
}
#: localizers that use what is known beside the image: the sigmas, a view without spotlights, the sensor's noise
ESTIMATORS: dict[str, Callable[..., Outcome]] = {"cone": cone, "photometric": photometric}


def locate(
    image: ArrayLike,
    scene: Scene,
    localizer: str = "paper",
    *,
    oracle: Pose | None = None,
    knowns: Knowns | None = None,
    reference: ArrayLike | Reference | None = None,
    noise: NoiseModel | None = None,
) -> Outcome:
    """Where the instrument is, from one image of its spotlights' patches.

    `image` is `[H, W]` grey or `[H, W, 3]` RGB with the resolution of `scene.camera`: uint8 (255 is white), uint16
    (`scene.sensor.full_scale` is white) or float (1.0 is white). `oracle` is the true pose, needed by the localizers
    whose name ends in "-oracle" and refused by all others.

    `cone` and `photometric` take more: `knowns` says how well RCM, half angle, eye and camera are known (default: the
    RCM to 0.05 mm, all else exactly), `reference` is a frame without spotlights, shaped like the image, or a
    `Reference` averaged over several, and `noise` the sensor's noise where it is not the scene's. They answer with a
    covariance.

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
    if localizer in ESTIMATORS:
        unlit = None if reference is None else Reference.of(reference, scene)
        return ESTIMATORS[localizer](checked(image, scene), scene, knowns=knowns, reference=unlit, noise=noise)
    for name, given in {"knowns": knowns, "reference": reference, "noise": noise}.items():
        if given is not None:
            raise InputError(
                f"localizer '{localizer}' has no use for {name}=; leave it out, or take one of {', '.join(ESTIMATORS)}"
            )
    return LOCALIZERS[localizer](checked(image, scene), scene, oracle)
