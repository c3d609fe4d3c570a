"""How the cosine off one beam's axis, and with it the profile's variable, rises across an image: to second order."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.profile import Profile
from conespot.localize.model.sight import Sight, some

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Rise:
    """At what N pixels see; across a pixel the variable is a plane, but for what second derivatives add to it."""

    sight: Sight
    axis: Array  #: of the beam `[3]`
    to: Array  #: unit vectors from the tip to the surface points `[N, 3]`
    d: Array  #: distances from the tip `[N]` [mm]
    c: Array  #: the cosine off the axis `[N]`
    across: Array  #: its gradient over the surface point `[N, 3]` [1/mm]
    w: Array  #: the profile's variable `[N]`
    stretch: Array | float  #: its derivative by the cosine
    gx: Array  #: rise of the cosine a pixel to the right `[N]`
    gy: Array  #: and a pixel down

    @classmethod
    def of(cls, sight: Sight, axis: Array, to: Array, d: Array, profile: Profile) -> Rise:
        """For a beam's axis, and the tip by where it sees the surface points."""
        c = to @ axis
        across = (axis - c[:, None] * to) / d[:, None]
        w, stretch = profile.variable(c)
        gx = np.einsum("ij,ij->i", across, sight.along_x)
        gy = np.einsum("ij,ij->i", across, sight.along_y)
        return cls(sight, axis, to, d, c, across, w, stretch, gx, gy)

    @property
    def halves(self) -> tuple[Array, Array]:
        """Half the rise of the variable across a pixel and down it, without signs `[N]` each."""
        return np.abs(self.gx) * self.stretch / 2.0, np.abs(self.gy) * self.stretch / 2.0

    @property
    def along_wall(self) -> Array:
        """The cosine's gradient on the wall `[N, 3]` [1/mm]."""
        normals = self.sight.normals
        return np.asarray(self.across - np.einsum("ij,ij->i", self.across, normals)[:, None] * normals)

    def raised(self, at: NDArray[np.intp], by: Array) -> Array:
        """The variable `[N]` where the cosine is larger at some pixels."""
        w = self.w.copy()
        w[at] += by * (np.broadcast_to(self.stretch, w.shape)[at])
        return w

    def second(self, at: NDArray[np.intp], step: Array, radius: float | None = None) -> Array:
        """The cosine's second derivative at some pixels along `step` `[n, 3]` [mm]: in space, or on such a surface."""
        along = np.einsum("ij,ij->i", self.to[at], step) / self.d[at]
        gradient = self.across[at]
        rise = np.einsum("ij,ij->i", gradient, step)  # of the cosine
        size = np.einsum("ij,ij->i", step, step)
        flat = -2.0 * rise * along - self.c[at] * (size / self.d[at] ** 2 - along**2)
        if radius is None:
            return np.asarray(flat)
        normal = np.einsum("ij,ij->i", gradient, self.sight.normals[at])
        return np.asarray(flat + normal * size / radius)

    def in_image(self, at: NDArray[np.intp], radius: float) -> tuple[Array, Array]:
        """Second derivatives at some pixels by one pixel along the edge and across it, on a surface of that radius.

        The same as `second` of either step, from its parts by a pixel to the right and one down.
        """
        gx, gy, d, c = self.gx[at], self.gy[at], self.d[at], self.c[at]
        length = np.maximum(np.hypot(gx, gy), 1e-300)
        ex, ey = gx / length, gy / length
        x, y, to = (some(vectors, at) for vectors in (self.sight.along_x, self.sight.along_y, self.to))
        ax, ay = np.einsum("ij,ij->i", to, x) / d, np.einsum("ij,ij->i", to, y) / d
        xx, xy, yy = np.einsum("ij,ij->i", x, x), np.einsum("ij,ij->i", x, y), np.einsum("ij,ij->i", y, y)
        flat = np.einsum("ij,ij->i", some(self.across, at), some(self.sight.normals, at)) / radius - c / np.square(d)
        along, across = ex * ay - ey * ax, ex * ax + ey * ay
        # along the edge the cosine does not rise
        tangential = c * np.square(along) + flat * (ey * ey * xx - 2.0 * ex * ey * xy + ex * ex * yy)
        normal = (
            -2.0 * length * across + c * np.square(across) + flat * (ex * ex * xx + 2.0 * ex * ey * xy + ey * ey * yy)
        )
        return tangential, normal

    def steeper(self, at: NDArray[np.intp], turns: Array) -> Array:
        """Derivatives of the logarithm of the cosine's rise per pixel, at some pixels `[3 + K, n]`.

        By the tip [1/mm], and by the axis as it turns, its derivatives being `turns` `[K, 3]` [1/rad].
        """
        gx, gy = self.gx[at], self.gy[at]
        size = np.maximum(np.square(gx) + np.square(gy), 1e-300)
        # the step in space straight across the edge by which the cosine rises by 1
        step = (gx * some(self.sight.along_x, at).T + gy * some(self.sight.along_y, at).T) / size
        to, across, d = some(self.to, at).T, some(self.across, at).T, self.d[at]
        along = np.einsum("in,in->n", to, step)
        by_tip = (to + across * along) / d + self.c[at] / np.square(d) * (step - to * along)
        by_turn = (turns @ step - (turns @ to) * along) / d
        return np.concatenate([by_tip, by_turn])

    def larger(self, x: Array, y: Array) -> Array:
        """How the logarithm of the cosine's rise per pixel changes `[N]` where a pixel's sides do by `[N, 3]` each."""
        by = self.gx * np.einsum("ij,ij->i", self.across, x) + self.gy * np.einsum("ij,ij->i", self.across, y)
        return np.asarray(by / np.maximum(np.square(self.gx) + np.square(self.gy), 1e-300))

    def on_wall(self, at: NDArray[np.intp], radius: float) -> tuple[Array, Array]:
        """The same by one millimetre on the wall."""
        flat = self.along_wall[at]
        unit = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
        return self.second(at, np.cross(self.sight.normals[at], unit), radius), self.second(at, unit, radius)

    def at_tip(self, at: NDArray[np.intp]) -> tuple[Array, Array]:
        """The same by a millimetre of the tip in the plane across the axis."""
        flat = self.across[at] - (self.across[at] @ self.axis)[:, None] * self.axis
        unit = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
        return self.second(at, np.cross(self.axis, unit)), self.second(at, unit)

    def on_pixels(self, profile: Profile, radius: float) -> tuple[Array, Array]:
        """The variable `[N]` as a pixel has it in the mean, where an edge crosses it, and how fast that grows with it.

        Along the edge t^2 has the mean 1/12 over a pixel: a half plane covers more of it than the convex patch does, by
        1 / (24 R) px for a radius of R px. Across, the edge lies some way from the pixel's centre: a step counts where
        it is, a slope as the mean over the pixel.
        """
        px, py = self.halves
        step, pace = profile.begins_with_a_step, np.ones(len(self.w))
        # at the foot of a soft edge too: it is all that a clipped patch shows
        at = np.flatnonzero(np.abs(self.w - profile.knots[0]) < (1.5 if step else 4.0) * (px + py))
        if not len(at):
            return self.w, pace
        tangential, normal = self.in_image(at, radius)
        if step:
            missing = (profile.knots[0] - self.w[at]) / np.broadcast_to(self.stretch, self.w.shape)[at]
            length = np.maximum(np.hypot(self.gx[at], self.gy[at]), 1e-300)
            away: Array | float = np.clip(missing / length, -0.7, 0.7)
            pace[at] -= np.where(np.abs(missing) < 0.7 * length, normal * away / length, 0.0)
        else:
            away = math.sqrt(1.0 / 12.0)
        return self.raised(at, tangential / 24.0 + normal * away**2 / 2.0), pace
