"""What is done with the answers on frames from outside: each output takes them one by one and writes at the end."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from conespot.localize.distance import Alarm
from conespot.localize.frames.reader import GivenFrame
from conespot.localize.outcome import Localization, Outcome
from conespot.results.columns import TIP_SIGMA
from conespot.scene.atomic import can_hold, write_atomically
from conespot.scene.document import InputError, dump
from conespot.scene.scene import Scene

#: what stands beside every distance
RESEARCH = "Research, no safety device."


@dataclass(frozen=True, eq=False)
class Answer:
    """A frame, what was found in it, and whether an alarm lets it pass as safe; None without an alarm."""

    frame: GivenFrame
    outcome: Outcome
    safe: bool | None = None

    @classmethod
    def of(cls, frame: GivenFrame, outcome: Outcome, alarm: Alarm | None) -> Answer:
        """The answer with what the alarm makes of it."""
        return cls(frame, outcome, None if alarm is None else alarm.safe(outcome))


class Output(Protocol):
    """Where answers go."""

    def add(self, answer: Answer) -> None:
        """Take one."""

    def close(self) -> None:
        """Write what has been taken, as a whole or not at all. Raises InputError if that cannot be done."""


class CsvOutput:
    """A row a frame: `campaign score` takes its tips and axes as they stand."""

    def __init__(self, path: Path) -> None:
        can_hold(path, "--csv")
        self._path, self._rows = path, list[dict[str, Any]]()

    def add(self, answer: Answer) -> None:
        """Take one."""
        self._rows.append(flat(answer))

    def close(self) -> None:
        """Write the file."""
        text = io.StringIO(newline="")
        table = csv.DictWriter(text, FLAT, lineterminator="\n")
        table.writeheader()
        table.writerows(self._rows)
        write_atomically(self._path, text.getvalue().encode("utf-8", "surrogateescape"), "--csv")


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


#: columns of a row; those of a tip and an axis are the ones that `campaign score` reads
FLAT = (
    "frame",
    "time_s",
    "status",
    "x_mm",
    "y_mm",
    "z_mm",
    "axis_x",
    "axis_y",
    "axis_z",
    *(name.removeprefix("est_") for name in TIP_SIGMA),
    "sigma_axis_deg",
    "nearest_mm",
    "sigma_nearest_mm",
    "along_mm",
    "sigma_along_mm",
    "source_mm",
    "safe",
    "reason",
)


def flat(answer: Answer) -> dict[str, Any]:
    """An answer as a row: what is not known is empty."""
    row: dict[str, Any] = dict.fromkeys(FLAT, "")
    row["frame"] = answer.frame.name
    row["time_s"] = "" if answer.frame.time_s is None else round(answer.frame.time_s, 9)
    row["safe"] = "" if answer.safe is None else ("yes" if answer.safe else "no")
    found = answer.outcome
    if not isinstance(found, Localization):
        return row | {"status": "refused", "reason": found.reason}
    row["status"] = "localized"
    row |= dict(zip(("x_mm", "y_mm", "z_mm"), map(float, found.apex_mm), strict=True))
    row |= dict(zip(("axis_x", "axis_y", "axis_z"), map(float, found.axis), strict=True))
    if found.covariance is not None:
        sigmas = [math.sqrt(max(float(found.covariance[i, i]), 0.0)) for i in range(5)]
        row |= {name.removeprefix("est_"): sigma for name, sigma in zip(TIP_SIGMA, sigmas, strict=False)}
        row["sigma_axis_deg"] = math.degrees(math.hypot(*sigmas[3:]))
    if found.distance is not None:
        values = {name: getattr(found.distance, name) for name in FLAT if hasattr(found.distance, name)}
        row |= {name: value for name, value in values.items() if value is not None and math.isfinite(value)}
    return row


_HEAD = ("frame", "tip x, y, z [mm]", "sigma [um]", "axis x, y, z", "nearest wall [mm]", "along axis [mm]")


class Table:
    """For people: a line a frame, as wide as a terminal."""

    def __init__(self, alarm: Alarm | None) -> None:
        self._alarm = alarm

    def head(self) -> Iterator[str]:
        """The lines above."""
        if self._alarm is not None:
            yield (
                f"safe: farther than {self._alarm.least_mm:g} mm from the wall, false with a chance of"
                f" {self._alarm.false_safe:g} by the stated sigma; a refused frame is not safe. {RESEARCH}"
            )
        yield self._line(*_HEAD, "" if self._alarm is None else "safe")

    def line(self, answer: Answer) -> str:
        """A frame's line."""
        name = Path(answer.frame.name).name
        row = flat(answer)
        safe = {"": "", "yes": "safe", "no": "NOT SAFE"}[row["safe"]]
        if row["status"] == "refused":
            return f"{name[-28:]:28} refused: {row['reason']}{f' ({safe})' if safe else ''}"
        tip = " ".join(f"{row[key]:8.4f}" for key in ("x_mm", "y_mm", "z_mm"))
        axis = " ".join(f"{row[key]:7.4f}" for key in ("axis_x", "axis_y", "axis_z"))
        sigma = "" if row["sigma_x_mm"] == "" else f"{1e3 * math.hypot(*(row[f'sigma_{c}_mm'] for c in 'xyz')):.1f}"
        return self._line(name, tip, sigma, axis, _within(row, "nearest"), _within(row, "along"), safe)

    @staticmethod
    def _line(name: str, tip: str, sigma: str, axis: str, nearest: str, along: str, safe: str) -> str:
        return f"{name[-28:]:28} {tip:>26} {sigma:>10} {axis:>23} {nearest:>17} {along:>16} {safe}".rstrip()


def _within(row: dict[str, Any], way: str) -> str:
    value, sigma = row[f"{way}_mm"], row[f"sigma_{way}_mm"]
    if value == "":
        return ""
    return f"{value:.4f}" + ("" if sigma == "" else f" +- {sigma:.4f}")


class OverlayOutput:
    """A picture of every frame with what was seen in it."""

    def __init__(self, folder: Path, scene: Scene, localizer: str) -> None:
        nearest = folder
        while not os.path.lexists(nearest) and nearest != nearest.parent:
            nearest = nearest.parent
        if not nearest.is_dir():
            raise InputError(f"{folder}: cannot be made: {nearest} is no folder; choose another --overlay")
        can_hold(nearest / "f.png", "--overlay")  # it is made with the first picture
        self._folder, self._scene, self._localizer = folder, scene, localizer
        self._taken: set[str] = set()

    def add(self, answer: Answer) -> None:
        """Draw one, at once: a video's would not fit into memory."""
        from conespot.campaigns.picture import draw_answer

        if not self._taken:
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(
                    f"{self._folder}: cannot be made: {error.strerror}; choose another --overlay"
                ) from None
        stem = re.sub(r"[^A-Za-z0-9.+_-]+", "-", Path(answer.frame.name).name)[-120:]
        name = stem
        while name in self._taken:  # frames of one name in two folders
            name = f"{stem}-{len(self._taken)}"
        self._taken.add(name)
        draw_answer(answer, self._scene, self._localizer, self._folder / f"{name}.png")

    def close(self) -> None:
        """Nothing is left to do."""
