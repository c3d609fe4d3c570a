"""Monte Carlo of light in layers of tissue, as MCML does it, in Dr.Jit.

L. Wang, S. L. Jacques, L. Zheng, Comput. Methods Programs Biomed. 47:131 (1995). Absorption takes its part all along a
photon's way (and not where it is scattered), so that a layer may absorb without scattering.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from conespot.render import kernel
from conespot.scene.tissue import Layer

Array = NDArray[np.float64]

#: a photon of less weight is taken for absorbed
_SPENT = 1e-7
#: further than light can get, in place of an infinite thickness [mm]
_FAR = 1e6
#: photons under way at once; each that ends makes room for the next, so that none waits for the longest way
_LANES = 2**13


@dataclass(frozen=True)
class Tally:
    """What became of a beam of photons, each of weight 1 before it meets the first layer."""

    launched: int
    specular: float  #: part reflected by the first boundary without entering
    returned: Array  #: part that came back out of the first layer, by ring of distance `[K + 1]`
    returned_error: Array  #: standard errors of it `[K + 1]`
    transmitted: float  #: part that left through the last layer
    transmitted_error: float  #: its standard error
    absorbed: float  #: part absorbed
    drift: float  #: mean distance along x of what came back from where it entered [mm]

    @property
    def reflectance(self) -> float:
        """Part that came back, diffusely."""
        return float(self.returned.sum())

    @property
    def reflectance_error(self) -> float:
        """Its standard error (that of the rings, which no photon shares, without their small correlation)."""
        return float(np.linalg.norm(self.returned_error))

    @property
    def enclosed(self) -> Array:
        """Share of what came back that did so within each radius `[K]`."""
        return np.asarray(np.cumsum(self.returned)[:-1] / self.returned.sum())


def traced(
    stacks: Sequence[Sequence[Layer]],
    radii: ArrayLike,
    photons: int,
    seed: int,
    *,
    incidence: float = 0.0,
    outside: float | None = None,
) -> list[Tally]:
    """The way of at least `photons` through layers, all of which enter at one place: a tally for each of the `stacks`.

    The stacks may differ by absorption alone: they share the photons' ways. What comes back is counted by its distance
    from where it entered, in rings between `radii` `[K]` [mm], which increase, and beyond the last. Photons come at an
    angle of `incidence` [rad] to the normal, towards +x, from a medium of index `outside` (that of the first layer
    where it is not given, so that its boundary does not reflect), which also lies behind the last layer. Boundaries
    reflect by Fresnel's equations. Raises KernelError without a JIT variant.
    """
    mi, dr, chosen = kernel.load()
    if not chosen.vectorized:
        raise kernel.KernelError(f"tissue needs a JIT variant, and this is {chosen.variant}: see `campaign doctor`")
    layers = stacks[0]
    around = layers[0].index if outside is None else outside
    walls = np.cumsum([0.0, *(min(layer.thickness, _FAR) for layer in layers)])
    column: dict[str, Sequence[float]] = {
        "top": walls[:-1].tolist(),
        "bottom": walls[1:].tolist(),
        "scattering": [layer.scattering for layer in layers],
        "anisotropy": [layer.anisotropy for layer in layers],
        "index": [layer.index for layer in layers],
        "above": [around, *(layer.index for layer in layers[:-1])],
        "below": [*(layer.index for layer in layers[1:]), around],
        **{f"absorption {i}": [layer.absorption for layer in stack] for i, stack in enumerate(stacks)},
    }
    # as constants they would make another kernel of every stack
    table = {name: [dr.opaque(mi.Float, value) for value in values] for name, values in column.items()}
    specular = fresnel(around, layers[0].index, math.cos(incidence))
    sideways = math.sin(incidence) * around / layers[0].index
    begin = mi.Vector3f(*(dr.opaque(mi.Float, v) for v in (sideways, 0.0, math.sqrt(1.0 - sideways**2))))
    entered, edges = dr.opaque(mi.Float, 1.0 - specular), mi.Float(np.asarray(radii, np.float32))
    quota = -(-photons // _LANES)
    rings = len(edges) + 1
    # weights by ring, the last of which is what goes through; their squares; and weight times x of what comes back
    sums = [dr.zeros(mi.Float64, 2 * (rings + 1) + 1) for _ in stacks]

    def step(at: Any, along: Any, weights: Any, lost: Any, layer: Any, left: Any, rng: Any, ended: Any) -> Any:
        """To the next scattering or boundary, and what happens there."""
        here = {name: _of_layer(dr, values, layer) for name, values in table.items()}
        left = dr.select(left > 0.0, left, -dr.log(1.0 - rng.next_float32()))
        wall = dr.select(along.z > 0.0, here["bottom"], here["top"])
        to_wall = dr.select(along.z == 0.0, dr.inf, (wall - at.z) / along.z)
        meets = left >= here["scattering"] * to_wall
        way = dr.select(meets, to_wall, left / here["scattering"])
        kept = [weight * dr.exp(-here[f"absorption {i}"] * way) for i, weight in enumerate(weights)]
        lost = [total + mi.Float64(before - after) for total, before, after in zip(lost, weights, kept, strict=True)]
        at = at + way * along
        at = mi.Point3f(at.x, at.y, dr.select(meets, wall, at.z))
        crossed, onwards = _crossing(mi, dr, along, here, rng.next_float32())
        turned = _scattered(mi, dr, along, here["anisotropy"], rng.next_float32(), rng.next_float32())
        along = dr.select(meets, onwards, turned)
        left = dr.select(meets, dr.maximum(left - here["scattering"] * way, 0.0), 0.0)
        layer = layer + dr.select(meets & crossed, dr.select(along.z > 0.0, 1, -1), 0)
        back, through = layer < 0, layer >= len(layers)
        strongest = kept[0]
        for weight in kept[1:]:
            strongest = dr.maximum(strongest, weight)
        spent = ~back & ~through & (strongest <= _SPENT)
        ring = dr.binary_search(0, rings - 1, lambda i: dr.gather(mi.Float, edges, i) < dr.norm(at.xy))
        ring = dr.select(through, rings, ring)
        for i, weight in enumerate(kept):
            exact = mi.Float64(weight)
            dr.scatter_add(sums[i], exact, ring, back | through)
            dr.scatter_add(sums[i], dr.square(exact), ring + (rings + 1), back | through)
            dr.scatter_add(sums[i], exact * mi.Float64(at.x), mi.UInt(2 * (rings + 1)), back)
            lost[i] = lost[i] + dr.select(spent, exact, 0.0)
        end = back | through | spent
        at, along = dr.select(end, mi.Point3f(0.0), at), dr.select(end, begin, along)
        kept = [dr.select(end, entered, weight) for weight in kept]
        layer, left = dr.select(end, 0, layer), dr.select(end, 0.0, left)
        return at, along, kept, lost, layer, left, rng, ended + dr.select(end, mi.UInt(1), mi.UInt(0))

    zero = dr.zeros(mi.Float, _LANES)
    state = (
        dr.zeros(mi.Point3f, _LANES),
        begin + mi.Vector3f(zero),
        [entered + zero for _ in stacks],
        [dr.zeros(mi.Float64, _LANES) for _ in stacks],
        dr.zeros(mi.Int, _LANES),
        zero,
        mi.PCG32(size=_LANES, initstate=seed),
        dr.zeros(mi.UInt, _LANES),
    )
    ending = dr.while_loop(state, lambda *s: s[-1] < quota, step)
    lost = [float(np.asarray(total).sum()) for total in ending[3]]
    return [_tally(np.asarray(total), away, quota * _LANES, specular) for total, away in zip(sums, lost, strict=True)]


def _tally(sums: Array, lost: float, launched: int, specular: float) -> Tally:
    """Means and their standard errors of the sums over all that were launched."""
    first, second = sums[:-1].reshape(2, -1)
    mean = first / launched
    error = np.sqrt(np.maximum(second / launched - mean**2, 0.0) / launched)
    drift = float(sums[-1] / max(first[:-1].sum(), 1e-300))
    return Tally(launched, specular, mean[:-1], error[:-1], float(mean[-1]), float(error[-1]), lost / launched, drift)


def _of_layer(dr: Any, values: Sequence[Any], layer: Any) -> Any:
    """The value of each photon's layer: for a few layers quicker than a gather."""
    found = values[0]
    for i, value in enumerate(values[1:], start=1):
        found = dr.select(layer == i, value, found)
    return found


def fresnel(first: float, second: float, cosine: float) -> float:
    """Unpolarized reflectance of the boundary from index `first` to `second` at a cosine of incidence.

    >>> round(fresnel(1.0, 1.5, 1.0), 6)
    0.04
    """
    sine = first / second * math.sqrt(1.0 - cosine**2)
    if sine >= 1.0:
        return 1.0
    beyond = math.sqrt(1.0 - sine**2)
    across = (first * cosine - second * beyond) / (first * cosine + second * beyond)
    along = (second * cosine - first * beyond) / (second * cosine + first * beyond)
    return 0.5 * (across**2 + along**2)


def _crossing(mi: Any, dr: Any, along: Any, here: dict[str, Any], chance: Any) -> tuple[Any, Any]:
    """Whether a photon crosses the boundary that it meets, and its direction afterwards."""
    beyond_index = dr.select(along.z > 0.0, here["below"], here["above"])
    ratio = here["index"] / beyond_index
    cosine = dr.abs(along.z)
    squared = 1.0 - dr.square(ratio) * (1.0 - dr.square(cosine))
    beyond = dr.select(ratio == 1.0, cosine, dr.sqrt(dr.maximum(squared, 0.0)))
    across = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    in_plane = (cosine - ratio * beyond) / (cosine + ratio * beyond)
    reflected = dr.select(squared <= 0.0, 1.0, 0.5 * (dr.square(across) + dr.square(in_plane)))
    crossed = chance >= reflected
    refracted = mi.Vector3f(ratio * along.x, ratio * along.y, dr.copysign(beyond, along.z))
    return crossed, dr.select(crossed, refracted, mi.Vector3f(along.x, along.y, -along.z))


def _scattered(mi: Any, dr: Any, along: Any, anisotropy: Any, first: Any, second: Any) -> Any:
    """A direction after one scattering: L. G. Henyey, J. L. Greenstein, Astrophys. J. 93:70 (1941)."""
    g = dr.maximum(anisotropy, 1e-4)
    term = (1.0 - dr.square(g)) / (1.0 - g + 2.0 * g * first)
    # below a thousandth the formula loses its digits, and a distribution that even is uniform
    cosine = dr.select(anisotropy < 1e-3, 2.0 * first - 1.0, (1.0 + dr.square(g) - dr.square(term)) / (2.0 * g))
    cosine = dr.clip(cosine, -1.0, 1.0)
    sine = dr.sqrt(1.0 - dr.square(cosine))
    sin_phi, cos_phi = dr.sincos(2.0 * dr.pi * second)
    return dr.normalize(mi.Frame3f(along).to_world(mi.Vector3f(sine * cos_phi, sine * sin_phi, cosine)))
