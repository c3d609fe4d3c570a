"""The blur that the frames of one microscope share: each frame's edge fit leaves it free, and their mean is weighed.

It is the width of what the lens leaves of a point. A soft beam's own slope looks alike: told a softness that is wrong,
frames show the difference as a blur, more of it where patches are larger.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from conespot.localize.image import AnyImage
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.model.quantity import quantity
from conespot.localize.settled_fits import Begun
from conespot.scene.scene import Scene

#: standard deviations of the squared width that one must have to be seen; a bound of 95 % on what is not
_SEEN, _BOUND = 3.0, 1.645
#: squared width [px^2] that the image model itself may be off by: a pixel's own is 1/12, and four frames of 300 px
#: without any blur show 0.09 (`tests/unit/localize/test_calibration.py` has three of them)
_MODEL = 0.05


@dataclass(frozen=True)
class SharedBlur:
    """A lens' residual blur: the square of its width with its standard deviation [mm^2]."""

    variance: float
    sigma: float
    frames: int  #: that told

    @property
    def observable(self) -> bool:
        """Whether the frames show that there is one."""
        return self.variance > _SEEN * self.sigma

    @property
    def width_mm(self) -> float:
        """The blur's standard deviation [mm]."""
        return math.sqrt(max(self.variance, 0.0))

    def statement(self) -> str:
        """One sentence: the width and its sigma, or below what it is."""
        if self.observable:
            return f"blur: {self.width_mm:.4f} +- {self.sigma / (2.0 * self.width_mm):.4f} mm"
        most = math.sqrt(max(self.variance, 0.0) + _BOUND * self.sigma)
        return f"blur: not observable from this sequence (below {most:.4f} mm, 95 %)"

    def applied(self, scene: Scene) -> Scene:
        """The scene with this blur, if it is observable."""
        return quantity("blur").write(scene, self.variance) if self.observable else scene


def shared_blur(frames: Begun | Iterable[AnyImage], scene: Scene, noise: NoiseModel | None = None) -> SharedBlur | None:
    """The blur of checked frames of one scene, whose poses are not known; None where fewer than three show an edge."""
    blur, knowns = quantity("blur"), Knowns(blur_sigma_mm=None).within(scene)
    found = []
    for fit in Begun.of(frames).settled_fits(scene, knowns, noise):
        at = fit.estimate.pose_size + fit.knowns.free.index(blur) if blur in fit.knowns.free else -1
        if at >= 0 and 0.0 < fit.covariance[at, at] < math.inf:
            found.append((blur.value(fit.estimate.scene), float(fit.covariance[at, at])))
    if len(found) < 3:
        return None
    value, variance = np.array(found).T
    weight = 1.0 / variance
    mean = float(np.sum(weight * value) / np.sum(weight))
    # Birge, as `localize.calibration`: how much the frames disagree beyond their own sigmas
    scatter = max(1.0, float(np.sum(weight * np.square(value - mean))) / (len(found) - 1))
    model = _MODEL * scene.camera.pixel_pitch**2
    return SharedBlur(mean, math.hypot(math.sqrt(scatter / float(np.sum(weight))), model), len(found))
