"""Localizers of other installed packages: found by entry point, loaded when first used, and believed in nothing.

A package offers one by an entry point of the group `conespot.localizers`, whose value is a `Localizer` or a function
of image and scene. Its name is that of the entry point.
"""

from __future__ import annotations

import functools
from dataclasses import replace
from importlib.metadata import EntryPoint
from typing import Any

import numpy as np

from conespot.localize.image import AnyImage
from conespot.localize.localizer import Beside, Localizer
from conespot.localize.outcome import Localization, LocalizationFailure, Outcome
from conespot.scene import InputError, Scene
from conespot.scene.installed import described, loaded, offered, sentence

GROUP = "conespot.localizers"
_LONGEST_WORDS, _LONGEST_REASON = 200, 500


def plugins() -> dict[str, EntryPoint]:
    """Every localizer that installed packages offer, by name and not yet loaded; of equal names the first found."""
    return offered(GROUP)


@functools.cache
def load_plugin(entry: EntryPoint) -> Localizer:
    """The localizer of an entry point. Raises InputError if it cannot be loaded or is none."""
    value, which = loaded(entry, "localizer"), f"localizer {described(entry)}"
    if not isinstance(value, Localizer) and (isinstance(value, type) or not callable(value)):
        raise InputError(f"{which} is no conespot.localize.localizer.Localizer and no function of image and scene")
    localizer = value if isinstance(value, Localizer) else Localizer.plain(value)
    for words in (localizer.threshold, localizer.ambiguity):
        if not (isinstance(words, str) and words.isprintable() and 0 < len(words) <= _LONGEST_WORDS):
            raise InputError(f"{which}: threshold and ambiguity must be a line of up to {_LONGEST_WORDS} characters")

    def answer(image: AnyImage, scene: Scene, beside: Beside) -> Outcome:
        return _answer(entry.name, localizer, image, scene, beside)

    return replace(localizer, run=answer)


def _answer(name: str, localizer: Localizer, image: AnyImage, scene: Scene, beside: Beside) -> Outcome:
    """What the plug-in answers; a failure where it raises or answers something else."""
    seen = image.view()
    seen.flags.writeable = False  # the next localizer looks at the same pixels
    try:
        found: object = localizer.run(seen, scene, beside)
        wrong = _wrong(found)
    except (Exception, SystemExit) as error:
        return LocalizationFailure(f"{name} raised {sentence(error)}")
    if isinstance(found, LocalizationFailure) and wrong is None:
        return found
    if isinstance(found, Localization) and wrong is None:
        return _plain(found)
    return LocalizationFailure(f"{name} broke its word: {wrong}")


def _wrong(found: object) -> str | None:
    """What is wrong with an answer, or None."""
    if isinstance(found, LocalizationFailure):
        reason: object = found.reason
        good = isinstance(reason, str) and reason.isprintable() and 0 < len(reason) <= _LONGEST_REASON
        return None if good else f"a reason must be a line of 1 to {_LONGEST_REASON} characters"
    if not isinstance(found, Localization):
        return f"it answered {type(found).__name__}, no Localization or LocalizationFailure"
    for what, value in (("apex_mm", found.apex_mm), ("axis", found.axis)):
        if not _finite(value, [(3,)]):
            return f"{what} must be three finite numbers"
    if abs(float(np.linalg.norm(np.asarray(found.axis, float))) - 1.0) > 1e-6:
        return "axis must be a unit vector"
    if found.covariance is not None and not _finite(found.covariance, [(5, 5), (6, 6)]):
        return "covariance must be finite numbers, [5, 5] or [6, 6]"
    for what, number in (("roll", found.roll), ("spread_mm", found.spread_mm)):
        if number is not None and not _finite(number, [()]):
            return f"{what} must be a finite number"
    return None


def _finite(value: Any, shapes: list[tuple[int, ...]]) -> bool:
    array = np.asarray(value, float)
    return array.shape in shapes and bool(np.isfinite(array).all())


def _plain(found: Localization) -> Localization:
    """The answer in the types it should have."""
    covariance = None if found.covariance is None else np.asarray(found.covariance, float)
    roll, spread = (None if v is None else float(v) for v in (found.roll, found.spread_mm))
    return Localization(np.asarray(found.apex_mm, float), np.asarray(found.axis, float), covariance, spread, roll)
