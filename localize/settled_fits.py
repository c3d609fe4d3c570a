"""The edge fits of a sequence's frames: what all measures that frames share begin with."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from conespot.localize.edge.fit import fit_edge
from conespot.localize.edge.sandwich import EdgeFit
from conespot.localize.image import AnyImage, Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.noise import NoiseModel
from conespot.localize.outcome import LocalizationFailure
from conespot.localize.start.search import find_start
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene


@dataclass
class Begun:
    """A sequence of checked frames that several measures ask one after the other, and where its fits begin.

    `frames` is called for each of them and gives the same frames each time.
    """

    frames: Callable[[], Iterable[AnyImage]]
    #: where the patch of each frame was found first; None where it was not
    _starts: list[Pose | None] = field(default_factory=list)

    @classmethod
    def of(cls, frames: Begun | Iterable[AnyImage]) -> Begun:
        """The same, or one of frames that can be asked once."""
        return frames if isinstance(frames, Begun) else cls(lambda: frames)

    def settled_fits(self, scene: Scene, knowns: Knowns, noise: NoiseModel | None) -> Iterator[EdgeFit]:
        """The fit of each frame in which the patch is found and the fit settles; the scene's own noise if None."""
        for number, image in enumerate(self.frames()):
            frame = Frame(image, scene.sensor)
            if number == len(self._starts):
                found = find_start(frame, scene)
                self._starts.append(None if isinstance(found, LocalizationFailure) else found.pose)
            start = self._starts[number]
            if start is None:
                continue
            fit = fit_edge(frame, Estimate(start, scene), knowns, noise or scene.sensor.noise)
            if not isinstance(fit, LocalizationFailure) and fit.settled:
                yield fit
