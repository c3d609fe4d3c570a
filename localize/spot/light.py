"""The light of a hard cone whose patch is hardly larger than what spreads it: a wide core, a tip on its way.

Where an outline bends within what spreads it, no kernel along its normal tells how it looks. So the core is taken as
seven narrower ones and the exposure as three shorter ones. What is left to spread each of their patches is narrow, and
a Gaussian: a disc of radius R under one of deviation s reaches half its light s^2 / 2 R further in. Light from under
the retina is spread in the image.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.special import ndtr

from conespot.localize.model.deep import Deep
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.point_spread import lens_variance
from conespot.localize.model.quantity import Quantity
from conespot.localize.model.sight import Sight, look
from conespot.localize.model.view import Window
from conespot.scene.pose import tangents
from conespot.scene.scene import Scene
from conespot.scene.spread import WIDTHS

Array = NDArray[np.float64]
#: seven discs of a seventh of a disc's area, six of them around the first: places over its radius, of its variance
_AROUND = [(math.cos(angle), math.sin(angle)) for angle in np.arange(6) * math.pi / 3.0]
_PLACES = np.array([(0.0, 0.0), *(math.sqrt(0.5) * np.array(_AROUND))])
_INSTANTS = (-1.0 / 3.0, 0.0, 1.0 / 3.0)  # middles of thirds of an exposure


@dataclass(frozen=True)
class Moving:
    """An estimate whose tip moves steadily: by `way` `[3]` [mm] during the exposure, about the pose."""

    estimate: Estimate
    way: Array

    def moved(self, step: Array, free: tuple[Quantity, ...]) -> Moving:
        """After `step`: pose and free quantities first, then the way."""
        return Moving(self.estimate.moved(step[:-3], free), self.way + step[-3:])


class SpotLight:
    """The light of one spotlight on the bins of a window, as `model.forward` has it where edges are narrow."""

    def __init__(self, at: Window, scene: Scene) -> None:
        self._at, self._pixels = at, at.pixels
        sight = look(scene, self._pixels, at.side)
        self.seen = np.isfinite(sight.points[:, 0])
        self._sight = sight.part(np.flatnonzero(self.seen))
        self._bin = float(np.mean(np.linalg.norm(self._sight.along_x, axis=1))) if self.seen.any() else 1.0  # [mm]
        self._size = [int(scipy.fft.next_fast_len(2 * side, real=True)) for side in (at.height, at.width)]

    def __call__(self, here: Moving, free: tuple[Quantity, ...] = (), channel: int = 0) -> tuple[Array, Array]:
        """Irradiance for unit intensity `[h * w]` and its derivatives `[P, h * w]`: pose, free quantities, way."""
        estimate = here.estimate
        local = self._local(here, self._sight)
        whole = self._with_deep(local, estimate.scene, channel)
        rows = [*whole[1:6]]
        for each in free:
            beside = Moving(replace(estimate, scene=estimate.beside(each, each.step)), here.way)
            moved = local[:1]
            if each.changes != "glow":
                sight = self._sight
                if each.changes == "sight":
                    sight = look(beside.estimate.scene, self._pixels[self.seen], self._at.side)
                moved = self._local(beside, sight)[:1]
            rows.append((self._with_deep(moved, beside.estimate.scene, channel)[0] - whole[0]) / each.step)
        return whole[0], np.stack([*rows, *whole[6:]])

    def _local(self, here: Moving, sight: Sight) -> Array:
        """What falls there: irradiance, and its derivatives by pose and way `[9, h * w]`."""
        pose, scene = here.estimate.pose, here.estimate.scene
        u, v = tangents(pose.axis)
        length = float(np.linalg.norm(pose.apex - np.asarray(scene.instrument.rcm)))
        radius, beta = scene.beam.source_diameter / 2.0, scene.beam.half_angle
        places = radius * (_PLACES if radius > 0.0 else _PLACES[:1])
        instants = _INSTANTS if np.any(here.way) else (0.0,)
        even = np.asarray(self._bin**2 / 12.0 + lens_variance(scene) + radius**2 / (4.0 * len(places)))
        if len(sight.confusion):
            even = even + sight.confusion * (self._bin / sight.side) ** 2 / 4.0
        part = here.way / len(instants)
        found = np.zeros((9, len(sight.points)))
        for instant in instants:
            shift = instant * here.way
            axis = length * pose.axis + shift  # the needle goes on through where it is held
            axis /= np.linalg.norm(axis)
            for x, y in places:
                apex = pose.apex + shift + x * u + y * v
                value, by_tip, by_axis = _cone(sight, apex, axis, beta, even, part)
                turns = np.stack([u @ by_axis, v @ by_axis])
                found[0] += value
                found[1:4] += by_tip
                found[4:6] += turns
                found[6:] += instant * (by_tip + (np.outer(u, turns[0]) + np.outer(v, turns[1])) / length)
        full = np.zeros((9, len(self.seen)))
        full[:, self.seen] = found / (len(places) * len(instants))
        return full

    def _with_deep(self, local: Array, scene: Scene, channel: int) -> Array:
        """The same `[M, h * w]` with the share of it that comes back from under the retina."""
        deep = Deep.of(scene)
        if deep is None:
            return local
        channel = min(channel, len(deep.kernels) - 1)
        kernel, share = deep.kernels[channel], float(deep.shares[channel])
        variances = np.square(kernel.length * WIDTHS)
        down, along = (
            np.exp(-2.0 * np.pi**2 * np.multiply.outer(variances, np.square(f)))
            for f in (scipy.fft.fftfreq(self._size[0], self._bin), scipy.fft.rfftfreq(self._size[1], self._bin))
        )
        transfer = (kernel.parts[:, None] * down).T @ along
        planes = local.reshape(-1, self._at.height, self._at.width)
        waves = scipy.fft.rfft2(planes, s=self._size) * transfer
        spread = scipy.fft.irfft2(waves, s=self._size)[:, : self._at.height, : self._at.width]
        return np.asarray((1.0 - share) * local + share * spread.reshape(len(local), -1))


def _cone(sight: Sight, apex: Array, axis: Array, beta: float, even: Array, way: Array) -> tuple[Array, Array, Array]:
    """Irradiance `[N]` of a cone of half angle `beta`, and its derivatives by apex and axis `[3, N]`.

    It is spread by a Gaussian of the variance `even` [mm^2] and along a `way` [mm].
    """
    to = (sight.points - apex).T
    d = np.sqrt(np.einsum("ij,ij->j", to, to))
    to /= d
    cosine = np.maximum(-np.einsum("ji,ij->j", sight.normals, to), 0.0)
    along = axis @ to
    aside = axis[:, None] - along * to  # towards the axis
    sine = np.maximum(np.sqrt(np.einsum("ij,ij->j", aside, aside)), 1e-9)
    aside /= sine
    angle = np.arctan2(sine, along)
    sigma = np.sqrt(even + np.square(way @ aside) / 12.0)
    t = d * (beta - angle) / sigma - sigma / (2.0 * d * math.sin(beta))
    bright = cosine / np.square(d)
    value = bright * ndtr(t)
    edge = bright * np.exp(-0.5 * np.square(t)) / math.sqrt(2.0 * math.pi) / sigma
    # away from the axis an apex leaves the place behind at a smaller angle
    inner = value / np.maximum(cosine, 1e-9) / d
    by_tip = -edge * aside + 3.0 * value / d * to + inner * sight.normals.T
    return value, by_tip, edge * d * to / sine
