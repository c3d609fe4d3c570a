"""A measured relief of the retina: heights on a regular grid, smooth between its nodes."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from conespot.scene.csv_lines import csv_lines
from conespot.scene.model import Model
from conespot.scene.quantity import Length
from conespot.scene.text_file import at_home

Array = NDArray[np.float64]
_FEWEST, _MOST = 4, 512  #: nodes a side
_HIGHEST = 100.0  #: [mm], above any eye: what a spline can still be put through


@dataclass(frozen=True, eq=False)
class Spline:
    """A bicubic spline over a matrix, mirrored at its border and constant beyond: twice differentiable inside."""

    coefficients: Array  #: of its B-splines, with one more on every side than the matrix `[rows + 2, columns + 2]`

    @classmethod
    def through(cls, nodes: Array) -> Spline:
        """The spline through `nodes` `[rows, columns]`."""
        c = np.asarray(nodes, float)
        for _ in range(2):
            n = len(c)
            system = (4.0 * np.eye(n) + np.eye(n, k=1) + np.eye(n, k=-1)) / 6.0
            system[0, 1] = system[-1, -2] = 2.0 / 6.0
            c = np.asarray(np.linalg.solve(system, c).T, float)
        return cls(np.pad(c, 1, mode="reflect"))

    @property
    def bound(self) -> float:
        """A bound of its size: a B-spline stays between its coefficients."""
        return float(np.max(np.abs(self.coefficients)))

    def __call__(self, column: Array, row: Array) -> tuple[Array, Array, Array]:
        """Values `[N]` and slopes along columns and rows at fractional columns and rows `[N]`."""
        rows, columns = self.coefficients.shape
        column, row = np.clip(column, 0.0, columns - 3.0), np.clip(row, 0.0, rows - 3.0)
        i, j = np.minimum(column.astype(np.intp), columns - 4), np.minimum(row.astype(np.intp), rows - 4)
        near = (j * columns + i)[:, None] + (np.arange(4)[:, None] * columns + np.arange(4)).ravel()
        c = self.coefficients.ravel()[near].reshape(-1, 4, 4)
        across, slope_across = _cubic(column - i)
        down, slope_down = _cubic(row - j)
        lines = np.einsum("nji,ni->nj", c, across)
        value = np.einsum("nj,nj->n", lines, down)
        return value, np.einsum("nji,ni,nj->n", c, slope_across, down), np.einsum("nj,nj->n", lines, slope_down)


class ReliefMap(Model):
    """Heights towards the inside from a CSV matrix: rows from +y down to -y, columns from -x to +x, square cells.

    `width` is the distance of the first column from the last along the retina (arc coordinates, as the retina's
    texture), `unit` the height that the number 1 stands for, and (x, y) where the matrix's middle lies. Between the
    nodes runs the bicubic spline through them, whose normals are continuous; beyond the border each border height
    goes on outwards, which it meets without a kink.
    """

    kind: Literal["csv"]
    file: str
    width: Length = Field(gt=0.0)
    unit: Length = Field(0.001, gt=0.0)
    x: Length = 0.0
    y: Length = 0.0
    points: tuple[tuple[float, ...], ...] = Field((), max_length=_MOST, validate_default=False)

    @model_validator(mode="after")
    def _a_matrix(self) -> ReliefMap:
        sides = {len(row) for row in self.points} | {len(self.points)}
        if len({len(row) for row in self.points}) != 1 or min(sides) < _FEWEST or max(sides) > _MOST:
            raise ValueError(f"{self.file}: a height map needs {_FEWEST} to {_MOST} equally long rows and columns")
        if not float(np.max(np.abs(self.points))) * self.unit < _HIGHEST:
            raise ValueError(f"{self.file}: heights must be finite and below {_HIGHEST:g} mm")
        return self

    @property
    def pitch(self) -> float:
        """Distance between neighbouring nodes [mm]."""
        return self.width / (len(self.points[0]) - 1)

    @property
    def reach(self) -> float:
        """Distance of the farthest corner from the posterior pole, along the retina [mm]."""
        rows = self.pitch * (len(self.points) - 1)
        return float(np.hypot(abs(self.x) + self.width / 2.0, abs(self.y) + rows / 2.0))

    @property
    def words(self) -> str:
        """The map in words: its file, and the range of its heights."""
        low, high = float(np.min(self.points)) * self.unit, float(np.max(self.points)) * self.unit
        return f"height map {Path(self.file).name} ({low:.3g} to {high:.3g} mm)"

    @functools.cached_property
    def spline(self) -> Spline:
        """The heights [mm] between the nodes, in units of the pitch from the matrix's first element."""
        return Spline.through(np.array(self.points) * self.unit)

    def at(self, arc: Array) -> tuple[Array, Array]:
        """Heights `[N]` [mm] and their gradients `[N, 2]` at arc coordinates `[N, 2]` [mm]."""
        column = (arc[:, 0] - self.x) / self.pitch + (len(self.points[0]) - 1) / 2.0
        row = (self.y - arc[:, 1]) / self.pitch + (len(self.points) - 1) / 2.0
        height, by_column, by_row = self.spline(column, row)
        return height, np.stack([by_column, -by_row], axis=1) / self.pitch


def _cubic(f: Array) -> tuple[Array, Array]:
    """Values and slopes `[N, 4]` of the four uniform cubic B-splines that reach over a cell, at `f` `[N]` in it."""
    g = 1.0 - f
    value = np.stack([g**3, 4.0 - 3.0 * f * f * (1.0 + g), 4.0 - 3.0 * g * g * (1.0 + f), f**3], axis=1) / 6.0
    slope = np.stack([-g * g, f * (3.0 * f - 4.0), g * (4.0 - 3.0 * g), f * f], axis=1) / 2.0
    return value, slope


def _read_matrix(path: Path) -> list[list[float]]:
    """The numbers in a CSV file, row by row; `#` lines are left out. Raises ValueError with file and line."""
    matrix: list[list[float]] = []
    for line in csv_lines(path, "height map"):
        if len(matrix) == _MOST or len(line.cells) > _MOST:
            raise ValueError(f"{path}:{line.number}: a height map has at most {_MOST} rows and columns")
        try:
            row = [line.value(column) for column in range(len(line.cells))]
        except ValueError as error:
            example = "expected heights separated by commas, as in `0, 12.5, 30`"
            raise ValueError(f"{path}:{line.number}: {example} ({error})") from None
        if not np.all(np.isfinite(row)):
            raise ValueError(f"{path}:{line.number}: heights must be finite numbers")
        if matrix and len(row) != len(matrix[0]):
            raise ValueError(f"{path}:{line.number}: {len(row)} heights where the first row has {len(matrix[0])}")
        matrix.append(row)
    return matrix


def _with_points(value: Any, info: ValidationInfo) -> Any:
    if isinstance(value, dict) and isinstance(value.get("file"), str) and "points" not in value:
        folder = Path((info.context or {}).get("folder", "."))
        return {**value, "points": _read_matrix(folder / at_home(Path(value["file"])))}
    return value


HeightMap = Annotated[ReliefMap, BeforeValidator(_with_points)]
