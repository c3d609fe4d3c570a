"""What a method of somebody else found in exported frames: a CSV, hostile until validated.

    frame,x_mm,y_mm,z_mm[,axis_x,axis_y,axis_z][,reason]

A frame that the method refused has a reason and no numbers, or is left out. Without an axis it is the line from the
remote centre of motion to the tip.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from conespot.campaigns.row import FARTHEST
from conespot.scene import InputError
from conespot.scene.csv_lines import CsvLine, columns, csv_lines, within

TIP = ("x_mm", "y_mm", "z_mm")
AXIS = ("axis_x", "axis_y", "axis_z")
REASON = "reason"
_LONGEST_REASON = 200
#: columns that give the tip in another unit, or in none that is stated
_OTHER_UNITS = {f"{axis}_{unit}" for axis in "xyz" for unit in ("m", "cm", "um", "px", "inch")} | set("xyz")
#: an axis' length may be off 1 by this much, as far as a few decimals take it
_ROUNDED = 1e-2
#: the median distance of tips from the pole [mm] lies between these in any eye: it is neither metres nor pixels
_NEAREST, _FARTHEST = 0.05, 60.0

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Estimate:
    """What a method says of a frame: the tip [mm] and the unit axis, None if it says none; or a `reason`."""

    line: int
    tip: Vector | None = None
    axis: Vector | None = None
    reason: str = ""


def read_estimates(path: Path) -> dict[str, Estimate]:
    """Estimates by the frame's name. Raises InputError, with the line, for what is not as above."""
    try:
        lines = csv_lines(path, "table of estimates")
        header = next(lines, None)
        if header is None:
            raise ValueError(f"{path}: is empty; a header {','.join(('frame', *TIP))} is needed")
        found = _read(path, header, lines)
    except ValueError as error:
        raise InputError(str(error)) from None
    _check_units(path, found)
    return found


def _read(path: Path, header: CsvLine, lines: Iterator[CsvLine]) -> dict[str, Estimate]:
    unit = next((cell for cell in header.cells if cell.lower() in _OTHER_UNITS), None)
    if unit is not None and not set(TIP) <= set(header.cells):
        raise ValueError(f"{path}:{header.number}: the column {unit} is not in millimetres; give {', '.join(TIP)}")
    frame, *tip = columns(path, header, ("frame", *TIP))
    axis = columns(path, header, AXIS) if set(AXIS) & set(header.cells) else []
    reason = header.cells.index(REASON) if REASON in header.cells else None
    found: dict[str, Estimate] = {}
    for line in lines:
        within(path, header, line)
        name = line.cells[frame] if frame < len(line.cells) else ""
        if name in found:
            raise ValueError(f"{path}:{line.number}: the frame {name[:40]} stands in line {found[name].line} too")
        said = line.cells[reason] if reason is not None and reason < len(line.cells) else ""
        try:
            found[name] = _estimate(line, tip, axis, said)
        except ValueError as error:
            raise ValueError(f"{path}:{line.number}: {error}") from None
    return found


def _estimate(line: CsvLine, tip: list[int], axis: list[int], reason: str) -> Estimate:
    numbers = any(at < len(line.cells) and line.cells[at] for at in (*tip, *axis))
    if reason:
        if numbers:
            raise ValueError("has both numbers and a reason; a frame is either localized or not")
        if len(reason) > _LONGEST_REASON or not reason.isprintable():
            raise ValueError(f"reason must be up to {_LONGEST_REASON} printable characters")
        return Estimate(line.number, reason=reason)
    x, y, z = (line.value(at) for at in tip)
    if not all(math.isfinite(v) and abs(v) <= FARTHEST for v in (x, y, z)):
        raise ValueError(f"the tip ({x:g}, {y:g}, {z:g}) is none; leave the line out, or give a reason in its place")
    if not axis:
        return Estimate(line.number, (x, y, z))
    u, v, w = (line.value(at) for at in axis)
    length = math.hypot(u, v, w)
    if not abs(length - 1.0) <= _ROUNDED:
        raise ValueError(f"the axis has a length of {length:g}; give a unit vector from the RCM into the light")
    return Estimate(line.number, (x, y, z), (u / length, v / length, w / length))


def _check_units(path: Path, found: dict[str, Estimate]) -> None:
    """Raises InputError where tips as a whole are in no eye: single ones may be anywhere, and are errors."""
    tips = np.array([estimate.tip for estimate in found.values() if estimate.tip is not None]).reshape(-1, 3)
    if not len(tips):
        return
    median = float(np.median(np.linalg.norm(tips, axis=1)))
    if not _NEAREST <= median <= _FARTHEST:
        raise InputError(
            f"{path}: half of the tips are {'within' if median < _NEAREST else 'beyond'} {median:.3g} mm of the"
            " posterior pole; give millimetres from there, +z towards the camera"
        )
