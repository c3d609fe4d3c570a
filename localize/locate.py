"""One call for every localizer, and one entry for each."""

from __future__ import annotations

import difflib
from collections.abc import Iterator

from numpy.typing import ArrayLike

from conespot.localize.distance import with_distance
from conespot.localize.image import AnyImage, Reference, checked
from conespot.localize.localizer import Beside, Localizer
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.outcome import OUTSIDE, Localization, LocalizationFailure, Outcome
from conespot.localize.plugin import load_plugin, plugins
from conespot.localize.published.methods import paper, paper_code, paper_code_float, paper_code_oracle
from conespot.scene import InputError, Pose, Scene


def _oracle(image: AnyImage, scene: Scene, beside: Beside) -> Outcome:
    assert beside.truth is not None
    return paper_code_oracle(image, scene, beside.truth)


# the fits are imported where they are used: they load scipy, for which every process of a campaign would wait
def _cone(image: AnyImage, scene: Scene, beside: Beside) -> Outcome:
    from conespot.localize.cone import cone

    return cone(image, scene, knowns=beside.knowns, reference=beside.reference, noise=beside.noise)


def _photometric(image: AnyImage, scene: Scene, beside: Beside) -> Outcome:
    from conespot.localize.photometric import photometric

    return photometric(image, scene, knowns=beside.knowns, reference=beside.reference, noise=beside.noise)


_CODED = "fixed 50 of 255 after median 9"
_WHOLE = f"{_CODED}, outline cut to whole pixels"
_RCM = "RCM for one spotlight, least spread for several"
_EXACT = "none (exact cone, RCM as a prior)"

#: every localizer of this package by its name; those of others come by entry points
LOCALIZERS: dict[str, Localizer] = {
    "paper": Localizer.plain(paper, "Otsu after Gaussian and median", _RCM),
    "paper-code": Localizer.plain(paper_code, _WHOLE, _RCM),
    "paper-code-float": Localizer.plain(paper_code_float, _CODED, _RCM),
    "paper-code-oracle": Localizer(_oracle, _WHOLE, "candidate nearest the truth (oracle)", needs_truth=True),
    "cone": Localizer(_cone, "none (edges below the pixel)", _EXACT, takes_knowledge=True),
    "photometric": Localizer(_photometric, "none (likelihood of the pixels)", _EXACT, takes_knowledge=True),
}


def localizer_names() -> list[str]:
    """The names of all localizers, those of this package first; a plug-in cannot take the name of one of these."""
    return list(dict.fromkeys([*LOCALIZERS, *plugins()]))


def in_words() -> Iterator[str]:
    """A line for each localizer: its name, how it tells light from dark and the two cones apart, and what it is given.

    A plug-in that cannot be loaded has the reason in its line.
    """
    names = localizer_names()
    width = max(map(len, names))
    for name in names:
        try:
            entry = find_localizer(name)
        except InputError as error:
            yield f"{name:{width}}  {error}"
            continue
        given = "; needs the truth" * entry.needs_truth + "; takes knowledge" * entry.takes_knowledge
        source = "" if name in LOCALIZERS else f"; {plugins()[name].value}"
        yield f"{name:{width}}  threshold: {entry.threshold}; ambiguity: {entry.ambiguity}{given}{source}"


def find_localizer(name: str) -> Localizer:
    """The localizer of that name. Raises InputError if there is none, or it is a plug-in that cannot be loaded."""
    if name in LOCALIZERS:
        return LOCALIZERS[name]
    others = plugins()
    if name in others:
        return load_plugin(others[name])
    known = localizer_names()
    near = difflib.get_close_matches(str(name), known, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"known: {', '.join(known)}"
    raise InputError(f"unknown localizer '{name}'; {hint}")


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
    that choose by it and refused by all others.

    `cone`, `photometric` and plug-ins like them take more: `knowns` says how well RCM, half angle, eye and camera are
    known (default: the RCM to 0.05 mm, all else exactly), `reference` is a frame without spotlights, shaped like the
    image, or a `Reference` averaged over several, and `noise` the sensor's noise where it is not the scene's. They
    answer with a covariance.

    Returns a Localization (`apex_mm [3]`, unit `axis [3]` from the RCM into the light), or a LocalizationFailure,
    which is falsy and has a `reason`. A localization knows the tip's `distance` from the wall.

    Raises InputError for an unknown localizer, an image that cannot be read or does not fit the scene, and a missing
    or unwanted `oracle`.
    """
    entry = find_localizer(localizer)
    if entry.needs_truth and oracle is None:
        raise InputError(f"localizer '{localizer}' chooses by the true pose; give it as oracle=")
    if not entry.needs_truth and oracle is not None:
        raise InputError(f"localizer '{localizer}' must not see the true pose; leave oracle= out")
    if not entry.takes_knowledge:
        for name, given in {"knowns": knowns, "reference": reference, "noise": noise}.items():
            if given is not None:
                others = ", ".join(k for k, known in LOCALIZERS.items() if known.takes_knowledge)
                raise InputError(
                    f"localizer '{localizer}' has no use for {name}=; leave it out, or take one of {others}"
                )
    unlit = None if reference is None else Reference.of(reference, scene)
    outcome = entry.run(checked(image, scene), scene, Beside(oracle, knowns, unlit, noise))
    if isinstance(outcome, Localization) and not scene.depth(outcome.apex_mm) > 0.0:
        return LocalizationFailure(OUTSIDE)
    return with_distance(outcome, scene, knowns or Knowns())
