"""Light that comes back from under the retina, in the image model: the patch's irradiance, spread on the retina.

Of a channel's light the share d is deep:

    L = a / pi * (E + I0 ((1 - d) f sum_k G_k + d K * (f sum_k G_k)))

with `forward`'s names and the kernel K of `scene.spread`. The microscope's light is even over the kernel's reach and
stays what it is. The albedo is taken to be the same for both parts: how it differs is for the fits' own albedo. The
convolution is that of the mean irradiance of cells of an equal-area map about the patches (`scene.chart`), by FFT;
derivatives by the pose are convolved as well. Gaussians of the kernel that are narrower than a cell would be evened out
over it: of a beam whose edge is as narrow they are spreads of the image model instead (`nearby`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
import scipy.sparse
from numpy.typing import NDArray

from conespot.localize.model.deep import Deep
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import Light, light, rotation_basis
from conespot.localize.model.nearby import Nearby
from conespot.localize.model.point_spread import lens_variance
from conespot.localize.model.quantity import Quantity
from conespot.localize.model.sight import Sight
from conespot.scene.chart import Chart
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.spotlights import spotlight_axes
from conespot.scene.spread import WIDTHS, Kernel

Array = NDArray[np.float64]
Maps = NDArray[np.float32]


@dataclass(frozen=True)
class GlowSettings:
    """How finely deep light is worked out."""

    #: cells over the kernel's median radius
    fineness: float = 10.0
    #: cells a side, at most: patches far apart have coarser ones
    most_cells: int = 96
    #: beyond the outlines and what is looked at, where a fit may still move the patches [mm]
    margin_mm: float = 0.15
    #: share of the deep light that may be lost at the map's border
    lost: float = 0.01
    #: as far as the tip [mm], the axis and a roll [rad] and the kernel's length (its logarithm) move, deep light is
    #: taken to change in proportion: at a hard rim a place is off by up to 1 % after half of that
    straight: tuple[float, float, float] = (0.004, 0.001, 0.05)


GLOW = GlowSettings()


@dataclass(frozen=True)
class DeepLight:
    """Deep light at N places, of one channel."""

    value: Array  #: as if all light were deep `[N]` [1/mm^2]
    jacobian: Array  #: `[P, N]`, the rows of `forward.light`
    by_length: Array  #: its derivative by the logarithm of the kernel's length `[N]`

    def after(self, step: Array, longer: float) -> DeepLight:
        """The same, with the pose's rows alone, after a step of its parameters and of the length, to first order."""
        by_pose = self.jacobian[: len(step)]
        return DeepLight(self.value + step @ by_pose + longer * self.by_length, by_pose, self.by_length)

    def plus(self, share: float, near: Light, by_length: Array) -> DeepLight:
        """The same with a share of the kernel whose light is `near`."""
        return DeepLight(
            self.value + share * near.value,
            self.jacobian + share * near.jacobian,
            self.by_length + share * by_length,
        )


class Glow:
    """The deep light that bins of an image show, of patches near an estimate."""

    def __init__(self, near: Estimate, sight: Sight, side_mm: float) -> None:
        """`sight` is what the bins of `side_mm` [mm] see; those that see no retina show none.

        The estimate's scene has deep light.
        """
        deep, scene = Deep.of(near.scene), near.scene
        assert deep is not None
        self._kernels = tuple(dict.fromkeys(deep.kernels))
        self._which = [self._kernels.index(kernel) for kernel in deep.kernels]
        self._bins, self._bin = sight, side_mm
        chart = _chart(deep, scene, near.pose, sight.points)
        self._side, cell = chart.side, chart.cell
        self._sight, self._lit = _cells(chart, scene, near.pose)
        reach = max(kernel.reach(GLOW.lost) for kernel in deep.kernels)
        self._size = int(scipy.fft.next_fast_len(self._side + min(self._side, int(np.ceil(reach / cell))), real=True))
        self._read = _reading(chart, sight.points)
        # cells and the straight lines between them blur as well, bins and the lens blur what they show
        self._blur = side_mm**2 / 12.0 + lens_variance(scene) - cell**2 / 4.0
        self._near = Nearby.of(self._kernels, cell if _edge(near, chart) < cell else 0.0)
        self._far = np.array([w >= cell or not len(self._near.variances) for w in self._kernels[0].widths], float)
        y, x = np.fft.fftfreq(self._size, cell), np.fft.rfftfreq(self._size, cell)
        self._frequency = -2.0 * np.pi**2 * np.square(y), -2.0 * np.pi**2 * np.square(x)
        self._last: tuple[Estimate, list[DeepLight]] | None = None

    def light(self, estimate: Estimate, free: tuple[Quantity, ...], sharp: Light) -> list[DeepLight]:
        """The deep light of every channel, of which the bins would see `sharp` if none of it were.

        The Jacobians have its rows: for the pose and the `free` quantities of the beam and of what spreads the image.
        """
        # deep light on the map is wider than any spread of the image: it does not change with that
        none = sum(each.changes == "spread" for each in free)
        found = [
            DeepLight(one.value, np.pad(one.jacobian, ((0, none), (0, 0))), one.by_length)
            for one in self._wide(estimate, free)
        ]
        each = self._near.lights(self._bins, self._bin, estimate, free, sharp, _length(estimate))
        for (near, longer), shares in zip(each, self._near.shares.T.tolist(), strict=True):
            found = [one.plus(share, near, longer) for one, share in zip(found, shares, strict=True)]
        return [found[k] for k in self._which]

    def _wide(self, estimate: Estimate, free: tuple[Quantity, ...]) -> list[DeepLight]:
        """What the map holds, by each of the kernels; rows for the pose and the beam."""
        beam = any(each.changes == "beam" for each in free)
        if self._last is not None and not beam:
            before, found = self._last
            step, longer = _step(before, estimate), float(np.log(_length(estimate) / _length(before)))
            tip, turn, length = GLOW.straight
            size = estimate.pose_size
            if max(np.abs(step[:3]).max() / tip, np.abs(step[3:size]).max() / turn, abs(longer) / length) < 1.0:
                return [one.after(step[:size], longer) for one in found]
        changes = estimate.beam_changes(free)
        scene, pose = estimate.scene, estimate.pose
        here = light(self._sight, pose, scene, estimate.profile, pose_size=estimate.pose_size, changes=changes)
        self._last = estimate, self._spread(here, _length(estimate))
        return self._last[1]

    def _spread(self, here: Light, length: float) -> list[DeepLight]:
        """What becomes of the light of the lit cells, by each of the kernels."""
        planes = np.zeros((1 + len(here.jacobian), self._side**2), np.float32)
        planes[0, self._lit], planes[1:, self._lit] = here.value, here.jacobian
        shape = (self._size, self._size)
        waves = scipy.fft.rfft2(planes.reshape(-1, self._side, self._side), s=shape)
        return [self._seen(waves, *self._transfer(kernel, length)) for kernel in self._kernels]

    def _seen(self, waves: NDArray[np.complex64], transfer: Maps, slope: Maps) -> DeepLight:
        """The places' deep light, from the Fourier transforms of the light and its derivatives."""
        spread = scipy.fft.irfft2(np.concatenate([waves * transfer, waves[:1] * slope]), s=(self._size, self._size))
        spread = spread[:, : self._side, : self._side].reshape(len(spread), -1)
        seen = (self._read @ np.ascontiguousarray(spread.T)).T.astype(float)
        return DeepLight(seen[0], seen[1:-1], seen[-1])

    def _transfer(self, kernel: Kernel, length: float) -> tuple[Maps, Maps]:
        """The kernel's Fourier transform with widths times `length`, and its derivative by that one's logarithm."""
        own = np.square(length * WIDTHS)
        variance = np.maximum(own + self._blur, 0.0)
        fy, fx = self._frequency
        down, along = (np.exp(np.multiply.outer(variance, f)) for f in self._frequency)
        parts = kernel.parts * self._far
        moves = np.where(own + self._blur > 0.0, 2.0 * own, 0.0) * parts
        transfer = (parts[:, None] * down).T @ along
        slope = (moves[:, None] * down * fy).T @ along + (moves[:, None] * down).T @ (along * fx)
        return np.asarray(transfer, np.float32), np.asarray(slope, np.float32)


def _length(estimate: Estimate) -> float:
    """How many times longer than the table's the kernel is."""
    deep = Deep.of(estimate.scene)
    assert deep is not None
    return deep.kernels[0].length


def _step(before: Estimate, after: Estimate) -> Array:
    """The step `[6]` of `forward.moved` from one pose to another near it."""
    turn = after.pose.rotation() @ before.pose.rotation().T
    vector = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return np.concatenate([after.pose.apex - before.pose.apex, rotation_basis(before.pose.axis) @ vector])


def _edge(near: Estimate, chart: Chart) -> float:
    """How far from its rim a beam reaches half of its light [mm]."""
    middle = chart.surface.points(chart.eye, chart.centre)
    beam = near.scene.beam
    return float(np.linalg.norm(middle - near.pose.apex)) * (beam.half_angle - near.profile.angle_at(0.5))


def _directions(away: Array) -> Array:
    return np.asarray(away / np.linalg.norm(away, axis=-1, keepdims=True))


def _chart(deep: Deep, scene: Scene, pose: Pose, places: Array) -> Chart:
    """A map about the patches that holds them and the places `[N, 3]` [mm]."""
    rim = np.concatenate([scene.outline(pose, k, 48) for k in range(len(scene.spotlights))])
    rim = rim[np.all(np.isfinite(rim), axis=1)]
    eye = scene.eye
    centre = _directions(0.5 * (rim.min(axis=0) + rim.max(axis=0)) - eye.centre)
    points = np.concatenate([rim, places[np.isfinite(places[:, 0])]])
    flat = Chart(eye, scene.surface, centre, 2, 1.0).places(_directions(points - eye.centre))
    half = float(np.abs(flat).max()) + GLOW.margin_mm
    finest = min(kernel.reach(0.5) for kernel in deep.kernels) / GLOW.fineness
    side = int(min(GLOW.most_cells, 2.0 * np.ceil(half / finest)))
    return Chart(eye, scene.surface, centre, side, 2.0 * half / side)


def _cells(chart: Chart, scene: Scene, pose: Pose) -> tuple[Sight, NDArray[np.intp]]:
    """What the cells that the cones may reach look at, and which they are `[M]`."""
    points = scene.surface.points(scene.eye, chart.cells)
    to = points.reshape(-1, 3) - pose.apex
    distance = np.linalg.norm(to, axis=1)
    off = np.arccos(np.clip(to @ spotlight_axes(pose, scene.spotlights).T / distance[:, None], -1.0, 1.0))
    slack = (GLOW.margin_mm + 2.0 * chart.cell) / np.maximum(distance, 1e-9)
    lit = np.flatnonzero(off.min(axis=1) < scene.beam.half_angle + slack)
    normals = scene.surface.normals(scene.eye, chart.cells.reshape(-1, 3)[lit])
    by_row, by_column = np.gradient(points, axis=(0, 1))
    place, along, across = (plane.reshape(-1, 3)[lit] for plane in (points, by_column, by_row))
    return Sight(place, normals, along, across, chart.cell / scene.camera.pixel_pitch), lit


def _reading(chart: Chart, places: Array) -> scipy.sparse.csr_array:
    """The matrix `[N, cells]` that reads a chart's maps at places `[N, 3]` [mm], between four cells each."""
    seen = np.isfinite(places[:, 0])
    shares = list(chart.shares(_directions(places[seen] - chart.eye.centre)))
    columns = np.stack([cell for cell, _ in shares], axis=1)
    values = np.stack([share for _, share in shares], axis=1).astype(np.float32)
    pointers = np.concatenate([[0], np.cumsum(np.where(seen, len(shares), 0))])
    return scipy.sparse.csr_array((values.ravel(), columns.ravel(), pointers), shape=(len(places), chart.side**2))
