"""How far light spreads in choroid and sclera: Mitsuba's `volpath` through the same layers against the table.

A narrow beam enters and a disc about it sees what comes back. `volpath` follows light backwards, so here the beam is
the sensor, a single ray, and the disc the light: the mean is the share that returns within the disc's radius.

python benchmarks/peer_volpath.py [--wavelength 850] [--samples 4096] [--passes 32]
"""

from __future__ import annotations

import argparse
import math

import numpy as np

from conespot.render import kernel
from conespot.scene.spread import spread_table
from conespot.scene.tissue import deep_layers

#: half the layers' width [mm]
_WIDE = 30.0
#: heights of the beam's start and of the disc over the tissue [mm]
_START, _DISC = 0.0005, 0.001
_FACTOR = 1


def layered_scene(wavelength: float, radius: float) -> dict[str, object]:
    """The medium eye's choroid and sclera under a disc of light of a `radius` [mm] and of radiance 1."""
    mi, _, _ = kernel.load()
    media = []
    for layer in deep_layers(wavelength, "medium"):
        extinction = layer.scattering + layer.absorption
        phase = {"type": "hg", "g": layer.anisotropy}
        albedo = layer.scattering / extinction
        media.append({"type": "homogeneous", "sigma_t": extinction, "albedo": albedo, "phase": phase})
    depths = np.cumsum([0.0, *(layer.thickness for layer in deep_layers(wavelength, "medium"))])
    held = [mi.load_dict(medium) for medium in media]
    place = mi.ScalarTransform4f
    scene: dict[str, object] = {"type": "scene", "integrator": {"type": "volpath", "max_depth": -1, "rr_depth": 100}}
    for i, depth in enumerate(depths):
        to_world = place().translate([0, 0, -float(depth)]).scale([_WIDE, _WIDE, 1.0])
        wall: dict[str, object] = {"type": "rectangle", "to_world": to_world, "bsdf": {"type": "null"}}
        if i > 0:
            wall["exterior"] = held[i - 1]
        if i < len(held):
            wall["interior"] = held[i]
        scene[f"wall_{i}"] = wall
    over = place().translate([0, 0, _DISC]).scale([radius, radius, 1.0]) @ place().rotate([1, 0, 0], 180)
    scene["disc"] = {
        "type": "disk",
        "to_world": over,
        "emitter": {"type": "area", "radiance": {"type": "uniform", "value": 1.0}},
    }
    film = {"type": "specfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}}
    film["all"] = {"type": "regular", "wavelength_min": 500.0, "wavelength_max": 501.0, "values": "1, 1"}
    down = place().look_at(origin=[0, 0, _START], target=[0, 0, -1], up=[0, 1, 0])
    scene["sensor"] = {"type": "radiancemeter", "to_world": down, "film": film}
    return scene


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--wavelength", type=float, default=850.0, help="[nm], one of the table's")
    parser.add_argument("--samples", type=int, default=4096, help="of a pass")
    parser.add_argument("--passes", type=int, default=32, help="whose scatter is the standard error")
    options = parser.parse_args()
    mi, _, _ = kernel.load()
    table = spread_table("medium")
    enclosed = table.enclosed[_FACTOR, list(table.wavelengths).index(options.wavelength)]
    chosen = [i for i in range(len(table.radii)) if enclosed[i] > 0.05][::2]

    def returned(radius: float, seed: int) -> tuple[float, float]:
        loaded = mi.load_dict(layered_scene(options.wavelength, radius))
        seeds = range(seed * options.passes, (seed + 1) * options.passes)
        found = [float(np.asarray(mi.render(loaded, spp=options.samples, seed=s)).ravel()[0]) for s in seeds]
        return float(np.mean(found)), float(np.std(found, ddof=1) / math.sqrt(len(found)))

    total, total_error = returned(_WIDE / 2.0, 0)
    print(f"returned: {total:.4f} +- {total_error:.4f}")
    for k, i in enumerate(chosen, start=1):
        mean, error = returned(float(table.radii[i]), k)
        share, share_error = mean / total, math.hypot(error, total_error * mean / total) / total
        z = (share - enclosed[i]) / share_error
        print(f"within {1e3 * table.radii[i]:.0f} um: {share:.4f} +- {share_error:.4f} ({enclosed[i]:.4f}), z {z:+.2f}")


if __name__ == "__main__":
    main()
