"""What is done with the answers on frames from outside: each output takes them one by one and writes at the end."""

from __future__ import annotations

import csv
import io
import json
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from conespot.campaigns.answer_row import RESEARCH, Answer, flat
from conespot.campaigns.given_names import GivenNames
from conespot.localize.distance import Alarm
from conespot.localize.outcome import Localization
from conespot.scene.atomic import can_hold, write_atomically
from conespot.scene.document import InputError, dump
from conespot.scene.scene import Scene


class Output(Protocol):
    """Where answers go."""

    def add(self, answer: Answer) -> None:
        """Take one."""

    def close(self) -> None:
        """Write what has been taken, as a whole or not at all. Raises InputError if that cannot be done."""


class CsvOutput:
    """A row a frame: `campaign score` takes its tips and axes as they stand."""

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        can_hold(path, "--csv")
        self._path, self._columns, self._rows = path, columns, list[dict[str, Any]]()

    def add(self, answer: Answer) -> None:
        """Take one."""
        self._rows.append(flat(answer))

    def close(self) -> None:
        """Write the file."""
        text = io.StringIO(newline="")
        table = csv.DictWriter(text, self._columns, lineterminator="\n")
        table.writeheader()
        table.writerows(self._rows)
        write_atomically(self._path, text.getvalue().encode(), "--csv")


class JsonOutput:
    """The same with covariances, and what it was found with."""

    def __init__(self, path: Path, scene: Scene, localizer: str, alarm: Alarm | None) -> None:
        can_hold(path, "--json")
        self._path = path
        self._head = {
            "note": RESEARCH,
            "localizer": localizer,
            "alarm": None if alarm is None else {"least_mm": alarm.least_mm, "false_safe": alarm.false_safe},
            "scene": dump(scene),
        }
        self._frames: list[dict[str, Any]] = []

    def add(self, answer: Answer) -> None:
        """Take one."""
        known = {name: value for name, value in flat(answer).items() if value != ""}
        if isinstance(answer.outcome, Localization) and answer.outcome.covariance is not None:
            known["covariance"] = answer.outcome.covariance.tolist()
        self._frames.append(known)

    def close(self) -> None:
        """Write the file."""
        text = json.dumps({**self._head, "frames": self._frames}, indent=1, ensure_ascii=True)
        write_atomically(self._path, text.encode(), "--json")


class OverlayOutput:
    """A picture of every frame with what was seen in it."""

    def __init__(self, folder: Path, scene: Scene, localizer: str, names: GivenNames) -> None:
        nearest = folder
        while not os.path.lexists(nearest) and nearest != nearest.parent:
            nearest = nearest.parent
        if not nearest.is_dir():
            raise InputError(f"{folder}: cannot be made: {nearest} is no folder; choose another --overlay")
        can_hold(nearest / "f.png", "--overlay")  # it is made with the first picture
        self._folder, self._scene, self._localizer, self._names = folder, scene, localizer, names
        self._taken: set[str] = set()

    def add(self, answer: Answer) -> None:
        """Draw one, at once: a video's would not fit into memory."""
        from conespot.campaigns.picture import draw_answer

        if answer.dropped:
            return
        if not self._taken:
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(
                    f"{self._folder}: cannot be made: {error.strerror}; choose another --overlay"
                ) from None
        shown = self._names.of(answer.frame)
        stem = re.sub(r"[^A-Za-z0-9.+_-]+", "-", shown).strip("-")[-120:]
        name = stem
        while name in self._taken:  # frames of one name in two folders
            name = f"{stem}-{len(self._taken)}"
        self._taken.add(name)
        draw_answer(answer, shown, self._scene, self._localizer, self._folder / f"{name}.png")

    def close(self) -> None:
        """Nothing is left to do."""
