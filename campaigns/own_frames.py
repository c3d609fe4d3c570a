"""`campaign localize`: the needle in frames of one's own camera."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from conespot.campaigns.answer_row import FLAT, Answer
from conespot.campaigns.answer_table import Table
from conespot.campaigns.answers import CsvOutput, JsonOutput, Output, OverlayOutput
from conespot.campaigns.destinations import check_destinations
from conespot.campaigns.given_names import GivenNames
from conespot.campaigns.own_scene import described_scene
from conespot.campaigns.trajectory_outputs import McapOutput, TumOutput
from conespot.localize.distance import Alarm
from conespot.localize.frames.reader import GivenFrame, read_frames
from conespot.localize.frames.stamp import nanoseconds, seconds
from conespot.localize.image import Reference
from conespot.localize.locate import LOCALIZERS, find_localizer, locate
from conespot.localize.model.knowns import Knowns
from conespot.scene import InputError, Scene
from conespot.scene.quantity import parse_quantity


@dataclass
class Count:
    """Frames, and how many of them were refused for which reason."""

    frames: int = 0
    refused: Counter[str] = field(default_factory=Counter)

    @property
    def sentence(self) -> str:
        """Why some were refused; empty if none was."""
        total = sum(self.refused.values())
        reasons = "; ".join(f"{number} x {reason}" for reason, number in self.refused.most_common(5))
        return f"{total} of {self.frames} frames refused: {reasons}" if total else ""


class OwnFrames:
    """Localizes frames from outside, one after the other, with what their scene says.

    Raises InputError, before any frame is looked at, for a scene or a localizer that cannot be used.
    """

    #: of a row of an answer
    columns: tuple[str, ...] = FLAT

    def __init__(self, name: str, settings: Sequence[str], localizer: str, rate_hz: float | None = None) -> None:
        self.scene, knowledge = described_scene(name, settings, "localize")
        entry = find_localizer(localizer)
        if entry.needs_truth:
            others = ", ".join(name for name, known in LOCALIZERS.items() if not known.needs_truth)
            raise InputError(f"localizer '{localizer}' needs the true pose, which your own frames lack; take {others}")
        self.localizer = localizer
        self._knowns: Knowns | None = knowledge.knowns if entry.takes_knowledge else None
        self._reference: Reference | None = None
        self._rate_hz = rate_hz

    def learn(self, unlit: Sequence[Path]) -> None:
        """Take frames without spotlights, averaged, as the view of the retina. Raises InputError."""
        if self._knowns is None:
            raise InputError(f"--reference: localizer '{self.localizer}' has no use for it; leave it out")
        reference = Reference.mean((frame.image for frame in read_frames(unlit, self.scene)), self.scene)
        if not reference.pixels.any():
            raise InputError("--reference: is black everywhere, so it shows nothing of the retina; leave it out")
        self._reference = reference

    def answers(self, sources: Sequence[Path], alarm: Alarm | None) -> Iterator[Answer]:
        """An answer for every frame. Raises InputError where it gets to one that does not fit the scene."""
        for frame in timed(read_frames(sources, self.scene), self._rate_hz):
            outcome = locate(frame.image, self.scene, self.localizer, knowns=self._knowns, reference=self._reference)
            yield Answer.of(frame, outcome, alarm)


def make_rate(text: str | None) -> float | None:
    """Frames a second of an option; None without it. Raises InputError."""
    if text is None:
        return None
    try:
        rate = parse_quantity(text, "frequency", bare=False)
        if not 1e-6 <= rate <= 1e6:
            raise ValueError(f"{text} is no rate of frames")
    except ValueError as error:
        raise InputError(f"--rate: {error}") from None
    return rate


def timed(frames: Iterator[GivenFrame], rate_hz: float | None) -> Iterator[GivenFrame]:
    """The frames, with the time stamps [s] of a rate in place of none or of their own, or their own without one.

    They are whole nanoseconds, which is all that an MCAP keeps: its replay is of the same times.
    """
    for number, frame in enumerate(frames):
        time = frame.time_s if rate_hz is None else number / rate_hz
        yield frame if time is None else replace(frame, time_s=seconds(nanoseconds(time)))


#: the chance that a tip called safe is not, where none is asked for
FALSE_SAFE = 1e-3


def make_alarm(distance: str | None, false_safe: float | None, scene: Scene) -> Alarm | None:
    """The alarm of two options; None without one. Raises InputError, also for a scene whose camera has no noise."""
    if distance is None:
        if false_safe is not None:
            raise InputError("--false-safe: is the chance of an --alarm; give --alarm DISTANCE, or leave it out")
        return None
    if note := noiseless(scene):
        raise InputError(f"--alarm: {note}")
    try:
        return Alarm(parse_quantity(distance, "length", bare=False), FALSE_SAFE if false_safe is None else false_safe)
    except ValueError as error:
        raise InputError(f"--alarm: {error}") from None


def noiseless(scene: Scene) -> str:
    """What makes every sigma too small, in words: a camera that is described without its noise; empty if it is not."""
    if scene.sensor.noise.electrons is not None:
        return ""
    return (
        f"scene.sensor ({scene.sensor.camera.kind}) has no noise but rounding, so that no sigma holds of a real"
        " camera's frames; describe it as kind: emva, with gain and read_noise"
    )


def outputs(own: OwnFrames, alarm: Alarm | None, options: argparse.Namespace) -> list[Output]:
    """What the options ask for beside the table. Raises InputError for what could not be written, or is read."""
    csv, json, tum, mcap, overlay = (getattr(options, name) for name in ("csv", "json", "tum", "mcap", "overlay"))
    read = {"FRAMES": options.frames, "--reference": options.reference or []}
    files = {"--csv": csv, "--json": json, "--tum": tum, "--mcap": mcap}
    check_destinations(files, read, (options.scene, options.set), overlay)
    found: list[Output] = []
    if csv is not None:
        found.append(CsvOutput(csv, own.columns))
    if json is not None:
        found.append(JsonOutput(json, own.scene, own.localizer, alarm))
    if tum is not None:
        found.append(TumOutput(tum))
    if mcap is not None:
        found.append(McapOutput(mcap, own.scene))
    if overlay is not None:
        found.append(OverlayOutput(overlay, own.scene, own.localizer, GivenNames(options.frames)))
    return found


def localize(
    own: OwnFrames, sources: Sequence[Path], alarm: Alarm | None, beside: Sequence[Output], count: Count
) -> Iterator[str]:
    """The lines of the table for people, as the frames come; `count` is counted up, and the outputs are written.

    Nothing is said before all has been done with the first answer: a sentence that refuses its frame stands alone.
    """
    table, begun = Table(alarm, GivenNames(sources), states="state" in own.columns), False
    for answer in own.answers(sources, alarm):
        for output in beside:
            output.add(answer)
        if not begun:
            begun = True
            if note := noiseless(own.scene):
                yield f"note: {note}"
            yield from table.head()
        count.frames += not answer.dropped
        if not answer.outcome and not answer.dropped:
            count.refused[str(getattr(answer.outcome, "reason", ""))] += 1
        yield table.line(answer)
    for output in beside:
        output.close()
