"""Trajectories: where the tip goes. Every one gives `[N, 3]` tip positions [mm] for N poses."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from conespot.scene.csv_lines import CsvLine, columns, csv_lines, within
from conespot.scene.model import Model, Words, unknown_name
from conespot.scene.quantity import Length, Seconds, parse_quantity
from conespot.scene.text_file import at_home

Array = NDArray[np.float64]
Point = tuple[Length, Length, Length]
_COLUMNS = ("x_mm", "y_mm", "z_mm")
_TIME = "t_s"
_MOST_POINTS = 100_000


class Box(Model):
    """A closed loop through `corners`, in equal steps a side, each side with its first corner (paper, 4.1)."""

    kind: Literal["box"] = "box"
    corners: tuple[Point, ...] = Field(
        ((-2.5, -2.5, 3.0), (2.5, -2.5, 4.0), (2.5, 2.5, 5.0), (-2.5, 2.5, 6.0)), min_length=2, max_length=1000
    )

    def positions(self, poses: int, rng: np.random.Generator) -> Array:
        """Tip positions `[poses, 3]` [mm]."""
        sides = len(self.corners)
        loop = np.array([*self.corners, self.corners[0]])
        u = np.arange(poses) * sides / poses
        return np.stack([np.interp(u, np.arange(sides + 1), loop[:, k]) for k in range(3)], axis=-1)


class Helix(Model):
    """x = R sin(phi), y = R cos(phi), z = z0 + pitch phi, phi over `turns` turns, both ends included (4.1).

    >>> Helix(turns=0.25).positions(2, np.random.default_rng(0)).round(3).tolist()
    [[0.0, 2.0, 2.0], [2.0, 0.0, 2.393]]
    """

    kind: Literal["helix"] = "helix"
    radius: Length = Field(2.0, gt=0.0)
    start_height: Length = Field(2.0, gt=0.0)
    pitch: Length = 0.25  #: climb per radian [mm]
    turns: float = Field(3.5, gt=0.0, le=1000.0)

    def positions(self, poses: int, rng: np.random.Generator) -> Array:
        """Tip positions `[poses, 3]` [mm]."""
        phi = np.linspace(0.0, 2.0 * math.pi * self.turns, poses)
        z = self.start_height + self.pitch * phi
        return np.stack([self.radius * np.sin(phi), self.radius * np.cos(phi), z], axis=-1)


class Spiral(Model):
    """An Archimedean spiral outwards, at one height or climbing steadily by `climb` from the first pose to the last."""

    kind: Literal["spiral"] = "spiral"
    radius: Length = Field(3.0, gt=0.0)
    height: Length = Field(5.0, gt=0.0)
    climb: Length = 0.0
    turns: float = Field(3.0, gt=0.0, le=1000.0)

    def positions(self, poses: int, rng: np.random.Generator) -> Array:
        """Tip positions `[poses, 3]` [mm]."""
        u = np.linspace(0.0, 1.0, poses)
        phi = 2.0 * math.pi * self.turns * u
        z = self.height + self.climb * u
        return np.stack([self.radius * u * np.cos(phi), self.radius * u * np.sin(phi), z], axis=-1)


class Line(Model):
    """Equal steps from `start` to `end`, both included."""

    kind: Literal["line"] = "line"
    start: Point = (-2.5, 0.0, 3.0)
    end: Point = (2.5, 0.0, 6.0)

    def positions(self, poses: int, rng: np.random.Generator) -> Array:
        """Tip positions `[poses, 3]` [mm]."""
        return np.linspace(self.start, self.end, poses)


class Volume(Model):
    """A box-shaped volume: the paper's volume of interest is 10 x 10 x 5 mm (sections 1 and 3.3)."""

    size: tuple[Length, Length, Length] = (5.0, 5.0, 5.0)
    bottom: Length = 2.0  #: height of the lower face above the pole [mm]

    def at(self, unit: Array) -> Array:
        """Points [mm] at coordinates `[..., 3]` in the unit cube; x and y are centred on the optical axis."""
        size = np.asarray(self.size)
        return np.asarray(unit * size + [-size[0] / 2.0, -size[1] / 2.0, self.bottom])


class Grid(Volume):
    """A regular grid of cell centres; of n^3 >= poses cells every (n^3 / poses)-th is taken."""

    kind: Literal["grid"] = "grid"

    def positions(self, poses: int, rng: np.random.Generator) -> Array:
        """Tip positions `[poses, 3]` [mm]."""
        n = math.ceil(round(poses ** (1.0 / 3.0), 9))
        index = np.arange(poses) * n**3 // poses
        cells = np.stack([index % n, index // n % n, index // n**2], axis=-1)
        return self.at((cells + 0.5) / n)


class Random(Volume):
    """Uniformly random in the volume, from the campaign's seed."""

    kind: Literal["random"] = "random"

    def positions(self, poses: int, rng: np.random.Generator) -> Array:
        """Tip positions `[poses, 3]` [mm]."""
        return self.at(rng.random((poses, 3)))


class Shell(Model):
    """Random tips near the wall of an eye of `radius`: evenly from `nearest` to `farthest` off it, and over its area.

    They lie within `reach` of the posterior pole, along the wall. Of another shape than the sphere's the distances are
    those from the sphere.
    """

    kind: Literal["shell"] = "shell"
    radius: Length = Field(12.0, gt=0.0, le=100.0)
    nearest: Length = Field(0.05, gt=0.0)
    farthest: Length = Field(1.0, gt=0.0)
    reach: Length = Field(2.0, ge=0.0)

    @model_validator(mode="after")
    def _inside(self) -> Shell:
        if not self.nearest <= self.farthest < self.radius:
            raise ValueError("nearest, farthest and radius must grow in this order")
        if self.reach > math.pi * self.radius:
            raise ValueError("reach goes round the eye; half its girth is the most")
        return self

    def positions(self, poses: int, rng: np.random.Generator) -> Array:
        """Tip positions `[poses, 3]` [mm]."""
        u = rng.random((poses, 3))
        height = self.radius - (self.nearest + (self.farthest - self.nearest) * u[:, 0])
        down = 1.0 - (1.0 - math.cos(self.reach / self.radius)) * u[:, 1]
        across, turn = np.sqrt(1.0 - down * down), 2.0 * math.pi * u[:, 2]
        direction = np.stack([across * np.cos(turn), across * np.sin(turn), -down], axis=-1)
        return np.array([0.0, 0.0, self.radius]) + height[:, None] * direction


class Waypoints(Model):
    """Tip positions from the columns x_mm, y_mm, z_mm of a CSV file, in its order; the first N of them are used.

    A column t_s says when the tip is there, which a motion asks for.
    """

    kind: Literal["csv"] = "csv"
    file: str
    points: tuple[Point, ...] = Field((), max_length=_MOST_POINTS, validate_default=False)
    times: tuple[Seconds, ...] = Field((), max_length=_MOST_POINTS, validate_default=False)

    def positions(self, poses: int, rng: np.random.Generator) -> Array:
        """Tip positions `[poses, 3]` [mm]. Raises ValueError if the file has fewer rows."""
        if poses > len(self.points):
            raise ValueError(f"{self.file} has {len(self.points)} positions but {poses} poses are asked for")
        return np.array(self.points[:poses])


def _read_points(path: Path) -> tuple[list[Point], list[float]]:
    """The positions [mm] in a CSV file with the columns x_mm, y_mm, z_mm, and their times [s] if it has a column t_s.

    Raises ValueError with file and line.
    """
    lines = csv_lines(path, "list of positions")
    header = next(lines, CsvLine(1, ()))
    x, y, z = columns(path, header, _COLUMNS)
    timed = columns(path, header, (_TIME,)) if _TIME in header.cells else []
    points: list[Point] = []
    times: list[float] = []
    for line in lines:
        within(path, header, line)
        try:
            points.append((_millimetres(line, x), _millimetres(line, y), _millimetres(line, z)))
        except ValueError as error:
            raise ValueError(f"{path}:{line.number}: x_mm, y_mm, z_mm must be finite numbers ({error})") from None
        for column in timed:
            times.append(_seconds(path, line, column, times))
        if len(points) > _MOST_POINTS:
            raise ValueError(f"{path}:{line.number}: more than {_MOST_POINTS} positions")
    return points, times


def _seconds(path: Path, line: CsvLine, column: int, before: list[float]) -> float:
    try:
        time = parse_quantity(line.value(column), "time")
    except ValueError as error:
        raise ValueError(f"{path}:{line.number}: t_s must be a finite number ({error})") from None
    if before and time <= before[-1]:
        raise ValueError(f"{path}:{line.number}: t_s must increase, and {time:g} comes after {before[-1]:g}")
    return time


def _millimetres(line: CsvLine, column: int) -> float:
    return parse_quantity(line.value(column), "length")


Trajectory = Annotated[
    Box | Helix | Spiral | Line | Grid | Random | Shell | Waypoints,
    Field(discriminator="kind"),
]
KINDS: dict[str, type[Model]] = {
    "box": Box,
    "helix": Helix,
    "spiral": Spiral,
    "line": Line,
    "grid": Grid,
    "random": Random,
    "shell": Shell,
    "csv": Waypoints,
}


def _named_trajectory(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, str):
        value = {"kind": value}
    if isinstance(value, dict):
        kind = value.get("kind")
        if kind not in KINDS:
            raise unknown_name(str(kind), list(KINDS), "trajectory")
        if kind == "csv" and isinstance(value.get("file"), str) and "points" not in value:
            folder = Path((info.context or {}).get("folder", "."))
            points, times = _read_points(folder / at_home(Path(value["file"])))
            value = {**value, "points": [tuple(f"{c!r} mm" for c in p) for p in points]}
            value = {**value, "times": [f"{time!r} s" for time in times]} if times else value
    return value


AnyTrajectory = Annotated[Trajectory, BeforeValidator(_named_trajectory), Words(lambda: KINDS)]
