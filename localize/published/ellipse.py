"""An ellipse through points of a plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Ellipse:
    """Centre `[2]`, semi-axes a >= b, and the unit direction `[2]` of the major one; units of the points fitted."""

    centre: Array
    a: float
    b: float
    major: Array


def fit_ellipse(points: Array) -> Ellipse | None:
    """The ellipse of least algebraic error through points `[N, 2]`; None where the best conic is no ellipse.

    As OpenCV's fitEllipse: the centre from A x^2 + B y^2 + C x y + D x + E y = 1, then the axes from
    A x^2 + B y^2 + C x y = 1 about that centre. In double precision, which noise-free outlines need.
    """
    if len(points) < 5:
        return None
    middle = points.mean(axis=0)
    scale = float(np.abs(points - middle).max())
    if not scale > 0.0:
        return None
    x, y = ((points - middle) / scale).T
    one = np.ones(len(points))
    p, _, rank, _ = np.linalg.lstsq(np.column_stack([x * x, y * y, x * y, x, y]), one, rcond=None)
    if rank < 5:
        return None
    form = np.array([[p[0], p[2] / 2.0], [p[2] / 2.0, p[1]]])
    if not np.linalg.det(form) > 1e-12 * np.sum(form**2):
        return None
    centre = np.linalg.solve(form, -p[3:] / 2.0)
    x, y = x - centre[0], y - centre[1]
    p = np.linalg.lstsq(np.column_stack([x * x, y * y, x * y]), one, rcond=None)[0]
    curvature, directions = np.linalg.eigh(np.array([[p[0], p[2] / 2.0], [p[2] / 2.0, p[1]]]))
    if not curvature[0] > 0.0:
        return None
    a, b = scale / np.sqrt(curvature)
    return Ellipse(centre * scale + middle, float(a), float(b), directions[:, 0])
