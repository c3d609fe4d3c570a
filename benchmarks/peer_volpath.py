"""How far light spreads in choroid and sclera: Mitsuba's `volpath` through the same layers against the table.

A narrow beam enters and a disc about it sees what comes back. `volpath` follows light backwards, so here the beam is
the sensor, a single ray, and the disc the light: the mean is the part of the beam that
returns within the disc's radius.
Exits 1 where a radius is further off than chance allows.

python benchmarks/peer_volpath.py [--wavelength 850] [--samples 32768] [--passes 16]
"""

from __future__ import annotations

import argparse
import math
import sys

import numpy as np
from scipy import stats

from conespot.render import kernel
from conespot.scene.spread import spread_table
from conespot.scene.tissue import deep_layers

# Lengths are um: Mitsuba begins rays about 1e-4 of a unit off a surface, which must be little beside everything here.

#: half the layers' width
_WIDE = 30_000.0
#: heights of the disc and of the beam's start over the tissue, of the disc's radius
_DISC, _START = 1e-3, 0.5e-3
_FACTOR = 1
#: photons of each row of the table
_PHOTONS = 1_500_000
#: chance that a right table fails
_LEVEL = 0.01


def layered_scene(wavelength: float, radius: float) -> dict[str, object]:
    """The medium eye's choroid and sclera under a disc of light of a `radius` [um] and of radiance 1."""
    mi, _, _ = kernel.load()
    layers = deep_layers(wavelength, "medium")
    held = []
    for layer in layers:
        extinction = layer.scattering + layer.absorption
        phase = {"type": "hg", "g": layer.anisotropy}
        albedo = layer.scattering / extinction
        medium = {"type": "homogeneous", "sigma_t": 1e-3 * extinction, "albedo": albedo, "phase": phase}
        held.append(mi.load_dict(medium))
    depths = 1e3 * np.cumsum([0.0, *(layer.thickness for layer in layers)])
    place = mi.ScalarTransform4f
    # roulette after 100 scatterings leaves rare, strong samples of what returns far away
    scene: dict[str, object] = {
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": -1, "rr_depth": 100_000},
    }
    for i, depth in enumerate(depths):
        to_world = place().translate([0, 0, -float(depth)]).scale([_WIDE, _WIDE, 1.0])
        wall: dict[str, object] = {"type": "rectangle", "to_world": to_world, "bsdf": {"type": "null"}}
        if i > 0:
            wall["exterior"] = held[i - 1]
        if i < len(held):
            wall["interior"] = held[i]
        scene[f"wall_{i}"] = wall
    over = place().translate([0, 0, _DISC * radius]).scale([radius, radius, 1.0]) @ place().rotate([1, 0, 0], 180)
    scene["disc"] = {
        "type": "disk",
        "to_world": over,
        # opaque, it would hide itself from what is scattered close to it, whose rays begin off their surfaces
        "bsdf": {"type": "null"},
        "emitter": {"type": "area", "radiance": {"type": "uniform", "value": 1.0}},
    }
    film = {"type": "specfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}}
    film["all"] = {"type": "regular", "wavelength_min": 500.0, "wavelength_max": 501.0, "values": "1, 1"}
    down = place().look_at(origin=[0, 0, _START * radius], target=[0, 0, -1], up=[0, 1, 0])
    scene["sensor"] = {"type": "radiancemeter", "to_world": down, "film": film}
    return scene


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--wavelength", type=float, default=850.0, help="[nm], one of the table's")
    parser.add_argument("--samples", type=int, default=32768, help="of a pass")
    parser.add_argument("--passes", type=int, default=16, help="whose scatter is the standard error")
    options = parser.parse_args()
    mi, _, _ = kernel.load()
    table = spread_table("medium")
    at = _FACTOR, list(table.wavelengths).index(options.wavelength)
    radii = 1e3 * table.radii
    # every other radius of the table that holds a part of all that returns; the last holds all of it
    chosen = [i for i in range(0, len(radii), 2) if 0.01 < table.enclosed[at][i] < 0.999] + [len(radii) - 1]
    scores = []
    for k, i in enumerate(chosen):
        loaded = mi.load_dict(layered_scene(options.wavelength, float(radii[i])))
        seeds = range(k * options.passes, (k + 1) * options.passes)
        found = [float(np.asarray(mi.render(loaded, spp=options.samples, seed=s)).ravel()[0]) for s in seeds]
        mean, error = float(np.mean(found)), float(np.std(found, ddof=1)) / math.sqrt(len(found))
        expected = float(table.enclosed[at][i] * table.reflectance[at])
        # a photon's weight is at most 1, so this is no less than the table's own standard error
        own = math.sqrt(expected / _PHOTONS)
        scores.append((mean - expected) / math.hypot(error, own))
        theirs, ours = f"{mean:.5f} +- {error:.5f}", f"{expected:.5f} +- {own:.5f}"
        print(f"within {radii[i]:.0f} um: {theirs}, table {ours}, z {scores[-1]:+.2f}", flush=True)
    # Sidak's level for the largest; few passes make it Student's rather than normal
    largest = stats.t.isf(0.5 * (1.0 - (1.0 - _LEVEL) ** (1.0 / len(scores))), options.passes - 1)
    furthest = max(abs(z) for z in scores)
    print(f"largest z {furthest:.2f} of {largest:.2f}, mean square {np.mean(np.square(scores)):.2f}")
    sys.exit(int(furthest > largest))


if __name__ == "__main__":
    main()
