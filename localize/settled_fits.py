"""The edge fits of a sequence's frames: what all measures that frames share begin with."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from conespot.localize.edge.fit import fit_edge
from conespot.localize.edge.sandwich import EdgeFit
from conespot.localize.image import AnyImage, Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.outcome import LocalizationFailure
from conespot.localize.start.search import find_start
from conespot.scene.scene import Scene


def settled_fits(
    frames: Iterable[AnyImage], scene: Scene, knowns: Knowns, noise: NoiseModel | None
) -> Iterator[EdgeFit]:
    """The fit of each checked frame in which the patch is found and the fit settles; the scene's own noise if None."""
    for image in frames:
        frame = Frame(image, scene.sensor)
        start = find_start(frame, scene)
        if isinstance(start, LocalizationFailure):
            continue
        fit = fit_edge(frame, Estimate(start.pose, scene), knowns, noise or scene.sensor.noise)
        if not isinstance(fit, LocalizationFailure) and fit.settled:
            yield fit
