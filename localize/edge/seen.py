"""What a band's bins see, and the rows that a Jacobian has for what is doubted at a fit's end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.edge.nuisances import Nuisances
from conespot.localize.edge.settings import EDGE
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.irradiance import Irradiance, Lights
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.sight import Sight
from conespot.localize.model.suspicion import TRANSFER, UNEVEN
from conespot.localize.model.transfer import mistake
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.motion import Tremor
from conespot.scene.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Seen:
    """What a band's bins of `side` px at `pixels` `[N, 2]` see, and the light there."""

    sight: Sight
    pixels: Array
    side: int
    irradiance: Array  #: ambient `[N]`
    lights: Irradiance  #: of the spotlights

    def softer(self, estimate: Estimate, hard: Array) -> Array | None:
        """How the irradiance `hard` `[N]` changes as the edge gets soft; None of others, which have a softness."""
        beam = estimate.scene.beam
        if not isinstance(beam, HardBeam):
            return None
        soft = CyclesBeam(half_angle=beam.half_angle, blend=EDGE.softer)
        there = Estimate(estimate.pose, estimate.scene.model_copy(update={"beam": soft}))
        every = np.ones(len(self.pixels), bool)
        soften = Irradiance(self.sight, self.pixels, self.side, there, Knowns().within(there.scene), every)
        softened = soften(there)[0][0]
        return np.asarray((softened - hard) / EDGE.softer)

    def doubts(
        self, channels: Sequence[Nuisances], lights: Lights, by_blur: Sequence[Array], scene: Scene
    ) -> tuple[list[str], list[Array]]:
        """Names `[D]` and derivatives of the light by what is in no scene, a channel each `[D, N]`.

        A blur that varies around the outline by one wave or two, where `by_blur` `[N]` are a channel's derivatives by a
        blur that does not: a lens out of focus on a slope, a tip that moves (a tremor's way is fitted, and is
        not quite straight). And values that were decoded amiss, of hard edges: what the foot of a soft one lacks below
        a sensor's last level looks the same.
        """
        strips = channels[0].strips
        waves = strips.around[1 : 1 if isinstance(scene.motion, Tremor) else None, strips.index]
        names, each = [UNEVEN] * len(waves), []
        transfer = mistake(scene.sensor) if isinstance(scene.beam, HardBeam) else None
        for c, channel in enumerate(channels):
            rows = [waves * by_blur[min(c, len(by_blur) - 1)]]
            if transfer is not None:
                gain = math.exp(channel.gain)
                rows.append(transfer(channel.model)[None] * (self.irradiance + gain * lights[c][0]) / gain)
            each.append(np.concatenate(rows))
        return names if transfer is None else [*names, TRANSFER], each
