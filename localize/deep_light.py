"""The deep light that the frames of one retina share: each frame's edge fit leaves it free, and what they say is added.

How much light comes back from under the retina and how far it goes differ from place to place, so beside the frames'
mean stands how much another place may differ from it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.calibration import CALIBRATION
from conespot.localize.image import AnyImage
from conespot.localize.model.deep import Deep
from conespot.localize.model.knowns import DEEP_SIGMA, Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.quantity import quantity
from conespot.localize.model.solve import inverse
from conespot.localize.settled_fits import Begun
from conespot.scene.retina import LEAST_DEEP, MOST_DEEP
from conespot.scene.scene import Scene

Array = NDArray[np.float64]
DEEP = (quantity("deep_amount"), quantity("deep_length"))
#: standard deviation of the logarithms that the image model itself may be off by, per mm that a pixel shows: of a hard
#: edge amounts are 7, 4 and 1 % off, and lengths 5, 5 and 1 %, where a pixel shows 0.044, 0.026 and 0.013 mm
_MODEL_PER_MM = 2.0


@dataclass(frozen=True)
class SharedDeep:
    """Logarithms of the amount of deep light and of how far it goes."""

    values: Array  #: `[2]`
    covariance: Array  #: of the frames' mean `[2, 2]`
    places: Array  #: standard deviations of another place's values `[2]`
    frames: int  #: that told

    @property
    def sigmas(self) -> Array:
        """Standard deviations of the mean `[2]`."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def observable(self) -> dict[str, bool]:
        """Which of the two the frames tell, by the name of the quantity, as `localize.calibration` has it."""
        seen = CALIBRATION.observable * self.sigmas <= DEEP_SIGMA
        return {each.name: bool(told) for each, told in zip(DEEP, seen, strict=True)}

    def statement(self) -> str:
        """One sentence for each of the two: a factor, and by which factor one standard deviation may change it."""
        lines = []
        for each, value, sigma, place in zip(DEEP, self.values, self.sigmas, self.places, strict=True):
            said = f"{math.exp(value):.3f} (times or over {math.exp(sigma):.3f})"
            if self.observable[each.name]:
                lines.append(f"{each.name}: {said}; at another place times or over {math.exp(place):.3f}")
            else:
                lines.append(f"{each.name}: not observable from this sequence ({said})")
        return "\n".join(lines)

    def applied(self, scene: Scene) -> Scene:
        """The scene with what is observable, as far as a scene can have it."""
        for each, value in zip(DEEP, self.values, strict=True):
            if self.observable[each.name]:
                scene = each.write(scene, math.log(min(max(math.exp(value), LEAST_DEEP), MOST_DEEP)))
        return scene


def shared_deep(frames: Begun | Iterable[AnyImage], scene: Scene, noise: NoiseModel | None = None) -> SharedDeep | None:
    """The deep light of checked frames of one retina, whose poses are not known.

    None where the scene has no deep light, and where fewer than three frames show an edge.
    """
    if Deep.of(scene) is None:
        return None
    knowns = Knowns().within(scene)
    nominal, prior = np.array([each.value(scene) for each in DEEP]), np.eye(2) / DEEP_SIGMA**2
    values, told, pulls = [], [], []
    for fit in Begun.of(frames).settled_fits(scene, knowns, noise):
        at = [fit.estimate.pose_size + fit.knowns.free.index(each) for each in DEEP]
        here = np.array([each.value(fit.estimate.scene) for each in DEEP])
        # all that the frame says less the prior, which all frames have only once
        whole = inverse(fit.covariance[np.ix_(at, at)])
        sizes, axes = np.linalg.eigh(whole - prior)
        data = (axes * np.maximum(sizes, 0.0)) @ axes.T
        values.append(here)
        told.append(data)
        pulls.append(whole @ (here - nominal))
    if len(values) < 3:
        return None
    model = _MODEL_PER_MM * scene.camera.pixel_pitch
    return _pooled(np.array(values), np.array(told), np.array(pulls), nominal, prior, model)


def _pooled(values: Array, told: Array, pulls: Array, nominal: Array, prior: Array, model: float) -> SharedDeep:
    """The mean by the frames' informations; Birge, as `localize.calibration`, for how much they disagree."""
    covariance = inverse(prior + told.sum(axis=0))
    step = covariance @ pulls.sum(axis=0)
    off = pulls - told @ step  # of each frame
    degrees = 2 * (len(values) - 1)
    scatter = max(1.0, float(np.sum([o @ np.linalg.pinv(i) @ o for o, i in zip(off, told, strict=True)])) / degrees)
    covariance = inverse(prior + told.sum(axis=0) / scatter)
    step = covariance @ (pulls.sum(axis=0) / scatter)
    covariance += model**2 * np.eye(2)
    # the frames' own noise is in there too: a place is rather believed to differ too much than too little
    places = np.sqrt(np.diag(covariance) + np.var(values, axis=0, ddof=1))
    return SharedDeep(nominal + step, covariance, np.minimum(places, DEEP_SIGMA), len(values))
