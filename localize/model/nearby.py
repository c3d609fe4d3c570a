"""Deep light that comes back beside where it fell: the narrow Gaussians of a kernel, as spreads of the image model.

A map's cell would even them out. They matter where a beam's edge is as narrow: elsewhere they leave light as it is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import Light, light
from conespot.localize.model.quantity import Quantity
from conespot.localize.model.sight import Sight
from conespot.scene.spotlights import spotlight_axes
from conespot.scene.spread import WIDTHS, Kernel

Array = NDArray[np.float64]
#: widths that one Gaussian of their mean variance stands for, at most this factor apart
_ALIKE = 2.5
#: standard deviations of it beyond which no edge is seen, and sides of a bin
_FAR, _BINS = 5.0, 3.0


@dataclass(frozen=True, eq=False)
class Nearby:
    """The Gaussians of K kernels that are narrower than some length, a few of them in place of all."""

    variances: Array  #: at the kernels' own length of 1 `[J]` [mm^2]
    shares: Array  #: of the light of each kernel `[K, J]`

    @classmethod
    def of(cls, kernels: Sequence[Kernel], widest: float) -> Nearby:
        """Of kernels of one length; Gaussians count up to a standard deviation of `widest` [mm]."""
        narrow = kernels[0].widths < widest
        widths, parts = WIDTHS[narrow], np.stack([kernel.parts[narrow] for kernel in kernels])
        group = np.floor(np.log(widths / WIDTHS[0]) / np.log(_ALIKE) + 1e-9)
        every = [np.flatnonzero(group == number) for number in np.unique(group)]
        every = [at for at in every if parts[:, at].any()]
        mean = [parts[:, at].sum(axis=0) @ np.square(widths[at]) / parts[:, at].sum() for at in every]
        shares = [parts[:, at].sum(axis=1) for at in every]
        return cls(np.array(mean), np.stack(shares, axis=1) if shares else np.zeros((len(kernels), 0)))

    def lights(
        self, sight: Sight, side_mm: float, estimate: Estimate, free: tuple[Quantity, ...], sharp: Light, length: float
    ) -> Iterator[tuple[Light, Array]]:
        """The light that each of the Gaussians spreads, of kernels so long, and its derivative by that one's logarithm.

        `sight` are bins of `side_mm`, and `sharp` what they see of the spotlights without it.
        """
        scene, pose = estimate.scene, estimate.pose
        to = sight.points - pose.apex
        d = np.linalg.norm(to, axis=1)
        off = np.arccos(np.clip(to @ spotlight_axes(pose, scene.spotlights).T / d[:, None], -1.0, 1.0))
        away = np.abs(off - scene.beam.half_angle).min(axis=1) * d
        for variance in length**2 * self.variances:
            rim = np.flatnonzero(away < _FAR * np.sqrt(variance) + _BINS * side_mm)
            here = light(
                sight.part(rim), pose, scene, estimate.profile, pose_size=estimate.pose_size,
                changes=estimate.beam_changes(free), widenings=estimate.wider(free), wall=float(variance),
            )  # fmt: skip
            value, rows, longer = sharp.value.copy(), sharp.jacobian.copy(), np.zeros(len(d))
            value[rim], rows[:, rim], longer[rim] = here.value, here.jacobian[:-1], 2.0 * variance * here.jacobian[-1]
            yield Light(value, rows), longer
