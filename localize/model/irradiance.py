"""The spotlights' irradiance on bins of an image, and how it changes with all that is free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from conespot.localize.model.deep import Deep
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import Cones, Light, light_by_surface
from conespot.localize.model.glow import DeepLight, Glow
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.quantity import Quantity
from conespot.localize.model.sight import Sight, look

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lights:
    """Irradiance on bins, and its derivatives by pose and free quantities, channel by channel."""

    each: tuple[tuple[Array, Array], ...]  #: `[N]` and `[P, N]`; one for all channels where they see the same
    #: and by the log odds of light from under the retina `[N]`, where there is any
    odds: tuple[Array, ...] = ()

    def __getitem__(self, channel: int) -> tuple[Array, Array]:
        """A channel's irradiance `[N]` and its derivatives `[P, N]`."""
        return self.each[min(channel, len(self.each) - 1)]


class Irradiance:
    """The spotlights' irradiance on bins: what falls there, and what comes back from under the retina as if it did."""

    def __init__(
        self, sight: Sight, pixels: Array, side: int, near: Estimate, knowns: Knowns, lit: NDArray[np.bool_]
    ) -> None:
        """`sight` is what the bins of `side` px at `pixels` `[N, 2]` see of the surface `near` an estimate.

        Light falls on those that are `lit` `[N]` alone.
        """
        self._sight, self._pixels, self._side, self._knowns, self._near = sight, pixels, side, knowns, near.scene
        self._lit = np.flatnonzero(lit)
        self._there = sight if lit.all() else sight.part(self._lit)
        deep = Deep.of(near.scene)
        self._glow = None if deep is None else Glow(near, sight, side * near.scene.camera.pixel_pitch)
        # what was asked of an estimate last: more derivatives of the same one may follow
        self._found: tuple[Estimate, tuple[Quantity, ...], Lights] | None = None
        self._last: tuple[Estimate, Sight, Cones] | None = None

    def __call__(self, estimate: Estimate, knowns: Knowns | None = None) -> Lights:
        """The irradiance where a fit stands, with derivatives by all that its own or other `knowns` leave free."""
        free = (knowns or self._knowns).free
        if self._found is None or self._found[0] is not estimate or self._found[1] != free:
            self._found = estimate, free, self._lights(estimate, free)
        return self._found[2]

    def _lights(self, estimate: Estimate, free: tuple[Quantity, ...]) -> Lights:
        lit = self._lit
        local = self._local(estimate, free)
        if self._glow is None:
            return Lights((local,))
        if len(lit) < len(self._pixels):
            value, rows = local
            local = np.zeros(len(self._pixels)), np.zeros((len(rows), len(self._pixels)))
            local[0][lit], local[1][:, lit] = value, rows
        deep = Deep.of(estimate.scene)
        assert deep is not None
        moving = sum(each.changes in ("sight", "glow") for each in free)
        sharp = Light(local[0], local[1][: estimate.pose_size + len(free) - moving])
        lights = self._glow.light(estimate, free, sharp)
        shares = deep.shares.tolist()
        # the share's odds against the local light are what is known to a factor
        odds = [share * (1.0 - share) * (light.value - local[0]) for share, light in zip(shares, lights, strict=True)]
        each = zip(lights, shares, odds, strict=True)
        return Lights(tuple(self._mixed(local, *one, estimate, free) for one in each), tuple(odds))

    def _local(self, estimate: Estimate, free: tuple[Quantity, ...]) -> tuple[Array, Array]:
        """The irradiance that falls on lit bins `[M]` and its derivatives by pose, beam, spread and what is seen."""
        moving = [each for each in free if each.changes == "sight"]
        seen, cones = self._cones(estimate)
        rows = [cones.by_beam(*change) for change in estimate.beam_changes(free)]
        rows += [cones.by_spread(*wider) for wider in estimate.wider(free)]
        here = Light(cones.value, np.stack([*cones.rows, *rows]))
        if not moving:
            return here.value, here.jacobian
        sides = [_sides(estimate, each, self._pixels[self._lit], self._side) for each in moving]
        by_sight = [
            light_by_surface(here, seen, estimate.pose, both, each.step) + cones.by_pixels(both, each.step)
            for both, each in zip(sides, moving, strict=True)
        ]
        # and the iris before some of the bins
        return np.nan_to_num(here.value), np.nan_to_num(np.stack([*here.jacobian, *by_sight]))

    def _cones(self, estimate: Estimate) -> tuple[Sight, Cones]:
        """What lit bins see, and the cones there: those of the last estimate once more, if it is that one."""
        if self._last is None or self._last[0] is not estimate:
            scene, near = estimate.scene, self._near
            still = scene.camera is near.camera and scene.eye is near.eye and scene.surface is near.surface
            moved = not still and any(each.changes == "sight" for each in self._knowns.free)
            seen = look(scene, self._pixels[self._lit], self._side) if moved else self._there
            cones = Cones(seen, estimate.pose, scene, estimate.profile, pose_size=estimate.pose_size)
            self._last = estimate, seen, cones
        return self._last[1:]

    def _mixed(
        self,
        local: tuple[Array, Array],
        deep: DeepLight,
        share: float,
        odds: Array,
        estimate: Estimate,
        free: tuple[Quantity, ...],
    ) -> tuple[Array, Array]:
        """A channel's irradiance of which a `share` is deep, and its derivatives."""
        value, rows = local
        by_pose = [deep.jacobian]
        here = Light(deep.value, deep.jacobian)
        for each in (each for each in free if each.changes == "sight"):
            sides = _sides(estimate, each, self._pixels, self._side)
            by_pose.append(light_by_surface(here, self._sight, estimate.pose, sides, each.step)[None])
        mixed = (1.0 - share) * rows + share * np.nan_to_num(np.concatenate(by_pose))
        by_glow = {"deep_amount": odds, "deep_length": share * deep.by_length}
        own = [by_glow[each.name][None] for each in free if each.changes == "glow"]
        return (1.0 - share) * value + share * deep.value, np.concatenate([mixed, *own])


def _sides(estimate: Estimate, quantity: Quantity, pixels: Array, side: int) -> tuple[Sight, Sight]:
    """What bins see with a little more of a quantity, and a little less."""
    more, less = (look(estimate.beside(quantity, step), pixels, side) for step in (quantity.step, -quantity.step))
    return more, less
