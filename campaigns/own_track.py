"""`campaign track`: the needle through the frames of one camera, one after the other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from conespot.campaigns.answer_row import TRACKED, Answer
from conespot.campaigns.own_frames import OwnFrames, timed
from conespot.localize.distance import Alarm, with_distance
from conespot.localize.frames.reader import GivenFrame, read_frames
from conespot.localize.tracking.smoother import smoothed
from conespot.localize.tracking.tracker import State, Tracked, Tracker
from conespot.scene import InputError


class OwnTrack(OwnFrames):
    """Follows the needle; `tracked` are the answers so far, `dropped` the frames that came while it was busy.

    With `live`, frames come when their time stamps say: one that is followed by another before the tracker is free is
    dropped, as a camera's would be. A replay drops none. With `smooth` frames, each pose is smoothed with as many after
    it, and answers come when all frames have been read.
    """

    columns = (*OwnFrames.columns, *TRACKED)

    def __init__(
        self,
        name: str,
        settings: Sequence[str],
        localizer: str,
        rate_hz: float | None,
        *,
        live: bool = False,
        smooth: int = 0,
    ) -> None:
        super().__init__(name, settings, localizer, rate_hz)
        self._live, self._smooth = live, smooth
        self.tracked: list[Tracked] = []
        self.dropped = 0

    def answers(self, sources: Sequence[Path], alarm: Alarm | None) -> Iterator[Answer]:
        """An answer for every frame, the dropped ones too. Raises InputError as the reader and the tracker do."""
        tracker = Tracker(self.scene, self.localizer, knowns=self._knowns, reference=self._reference)
        kept: list[Answer] = []
        for answer in self._followed(sources, tracker, alarm):
            if self._smooth:
                # without its pixels: a video's would not fit into memory
                kept.append(replace(answer, frame=replace(answer.frame, image=np.empty((0, 0), np.uint8))))
            else:
                yield answer
        if kept:
            knowns = tracker.knowns
            times, outcomes = [t.time_s for t in self.tracked], [t.outcome for t in self.tracked]
            found = iter(smoothed(times, outcomes, self.scene, knowns, self._smooth))
            for answer in kept:
                if answer.dropped:
                    yield answer
                    continue
                outcome = next(found)
                yield Answer.of(answer.frame, with_distance(outcome, self.scene, knowns), alarm, answer.tracked)

    def _followed(self, sources: Sequence[Path], tracker: Tracker, alarm: Alarm | None) -> Iterator[Answer]:
        free_at = -np.inf
        waiting: GivenFrame | None = None
        for frame in timed(read_frames(sources, self.scene), self._rate_hz):
            if frame.time_s is None:
                raise InputError(f"{frame.name}: has no time stamp, which tracking needs; give --rate, as '60 Hz'")
            if self._live:
                # the newest frame waits until the tracker is free; one that another overtakes is dropped
                before, waiting = waiting, frame
                if before is None:
                    continue
                if frame.time_s <= free_at:
                    self.dropped += 1
                    yield Answer.late(before, alarm)
                    continue
                frame = before
            yield self._one(frame, tracker, alarm)
            free_at = max(free_at, self.tracked[-1].time_s) + self.tracked[-1].latency_s
        if waiting is not None:
            yield self._one(waiting, tracker, alarm)

    def _one(self, frame: GivenFrame, tracker: Tracker, alarm: Alarm | None) -> Answer:
        assert frame.time_s is not None
        try:
            self.tracked.append(tracker.track(frame.image, frame.time_s))
        except InputError as error:
            raise InputError(f"{frame.name}: {error}") from None
        return Answer.of(frame, self.tracked[-1].outcome, alarm, self.tracked[-1])

    def sentence(self) -> str:
        """How the frames were come by, how long that took, and how many were dropped."""
        states = Counter(tracked.state for tracked in self.tracked)
        told = ", ".join(f"{states[state]} {state.value}" for state in State if states[state])
        latency = 1e3 * np.array([tracked.latency_s for tracked in self.tracked])
        time = f"; {np.median(latency):.1f} ms a frame (median), {np.percentile(latency, 99):.1f} ms (99th percentile)"
        dropped = f"; {self.dropped} dropped, for which it was too late" if self._live else ""
        return f"{len(self.tracked)} frames: {told}{time if self.tracked else ''}{dropped}"
