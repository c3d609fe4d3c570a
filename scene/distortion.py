"""Lens distortion: where a lens puts what a pinhole would have seen elsewhere."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from conespot.scene.model import Model

Array = NDArray[np.float64]
#: the coefficients in OpenCV's order
COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3")
#: that a coefficient may be: a microscope's narrow view has large ones, since they go with powers of a small r
LARGEST = 1e12
#: tangent of the angle off the axis up to which a fold is looked for, in steps: beyond, no lens is described so
_WIDEST, _STEPS, _AROUND = 2.0, 2000, 48
#: Newton's steps, of which most lenses take three; the residual that is lost in rounding, and the one that is none
_MOST_STEPS, _CONVERGED, _FOUND = 40, 1e-14, 1e-12


class Distortion(Model):
    """Radial (k1, k2, k3) and tangential (p1, p2), as OpenCV has them (D. C. Brown, Decentering distortion, 1966).

    Of coordinates (x, y) on the plane at distance 1, x to the right and y down, with r^2 = x^2 + y^2:

        x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2),
        y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y.

    It is the gradient of a potential, so its Jacobian is symmetric, and one-to-one on any disc where that is positive.
    """

    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @model_validator(mode="before")
    @classmethod
    def _listed(cls, data: Any) -> Any:
        if not isinstance(data, (list, tuple)):
            return data
        if len(data) not in (4, 5):
            raise ValueError(f"give k1, k2, p1, p2 and perhaps k3 (OpenCV's order), got {len(data)} values")
        return dict(zip(COEFFICIENTS, data, strict=False))

    @model_validator(mode="after")
    def _finite(self) -> Distortion:
        if not np.all(np.abs(self.coefficients) <= LARGEST):
            raise ValueError(
                f"coefficients must be finite, and at most {LARGEST:g}, got {max(self.coefficients, key=abs):g}"
            )
        return self

    @property
    def coefficients(self) -> tuple[float, float, float, float, float]:
        """k1, k2, p1, p2, k3: OpenCV's `distCoeffs`."""
        return self.k1, self.k2, self.p1, self.p2, self.k3

    @property
    def reach(self) -> float:
        """Distance from the axis up to which the map is one-to-one, on the undistorted plane at distance 1."""
        return _reach(self.coefficients)

    def distorted(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Where the lens puts (x, y), any shape; NaN beyond `reach`."""
        r2 = x * x + y * y
        factor = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        factor = np.where(r2 <= self.reach**2, factor, np.nan)
        to_x = x * factor + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x)
        to_y = y * factor + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y
        return to_x, to_y

    def jacobian(self, x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Derivatives dx'/dx, dx'/dy = dy'/dx and dy'/dy at (x, y)."""
        r2 = x * x + y * y
        factor = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3))
        twice = 2.0 * (self.k1 + r2 * (2.0 * self.k2 + r2 * 3.0 * self.k3))
        xx = factor + twice * x * x + 2.0 * self.p1 * y + 6.0 * self.p2 * x
        xy = twice * x * y + 2.0 * self.p1 * x + 2.0 * self.p2 * y
        yy = factor + twice * y * y + 6.0 * self.p1 * y + 2.0 * self.p2 * x
        return xx, xy, yy

    def undistorted(self, to_x: Array, to_y: Array) -> tuple[Array, Array]:
        """The inverse of `distorted`, by Newton's method; NaN for what it puts nothing at."""
        x, y, left = to_x, to_y, np.inf
        for _ in range(_MOST_STEPS):
            with np.errstate(over="ignore", invalid="ignore"):  # steps that lead away end as NaN
                x, y, off = self._closer(x, y, to_x, to_y)
            before, left = left, float(np.max(off, initial=0.0, where=np.isfinite(off)))
            if left <= _CONVERGED or (left < 1e-10 and left >= before):
                break
        ahead_x, ahead_y = self.distorted(x, y)
        found = np.hypot(ahead_x - to_x, ahead_y - to_y) <= _FOUND
        return np.where(found, x, np.nan), np.where(found, y, np.nan)

    def steps(self, to_x: Array, to_y: Array, within: float) -> int:
        """How many of Newton's steps bring all of (to_x, to_y) to `within` of the inverse."""
        end_x, end_y = self.undistorted(to_x, to_y)
        x, y, count = to_x, to_y, 0
        while count < _MOST_STEPS and not np.all(np.hypot(x - end_x, y - end_y) <= within):
            x, y, _ = self._closer(x, y, to_x, to_y)
            count += 1
        return count

    def _closer(self, x: Array, y: Array, to_x: Array, to_y: Array) -> tuple[Array, Array, Array]:
        """(x, y) after one of Newton's steps, and how far it was off before."""
        ahead_x, ahead_y = self.distorted(x, y)
        off_x, off_y = to_x - ahead_x, to_y - ahead_y
        xx, xy, yy = self.jacobian(x, y)
        with np.errstate(divide="ignore", invalid="ignore"):
            per = 1.0 / (xx * yy - xy * xy)
        return x + per * (yy * off_x - xy * off_y), y + per * (xx * off_y - xy * off_x), np.hypot(off_x, off_y)


@functools.lru_cache(maxsize=64)
def _reach(coefficients: tuple[float, float, float, float, float]) -> float:
    lens = Distortion(**dict(zip(COEFFICIENTS, coefficients, strict=True)))
    r = np.linspace(0.0, _WIDEST, _STEPS + 1)[:, None]
    angle = np.arange(_AROUND) * 2.0 * np.pi / _AROUND
    xx, xy, yy = lens.jacobian(r * np.cos(angle), r * np.sin(angle))
    folded = np.flatnonzero(np.any((xx * yy - xy * xy <= 0.0) | (xx <= 0.0), axis=1))
    return float(r[max(folded[0] - 1, 0), 0]) if len(folded) else _WIDEST
