"""How far light spreads in choroid and sclera: `pmmc` (Q. Fang), photons through a mesh, against the table.

Wants another Python with pmmc, which computes on the processor but asks for an OpenCL device all the same:
pip install pmmc==0.3.12 pocl-binary-distribution==3.0
Exits 1 where a radius is further off than chance allows.

python benchmarks/peer_pmmc.py /path/to/that/python [--wavelength 850] [--photons 300000]
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from conespot.scene.spread import spread_table
from conespot.scene.tissue import deep_layers

#: photons of each row of the table
_PHOTONS = 1_500_000
#: chance that a right table fails
_LEVEL = 0.01

PEER = """
import glob, itertools, json, os, sys, sysconfig
folder = sys.argv[1]
(device,) = glob.glob(sysconfig.get_path("purelib") + "/pyopencl/.libs/libpocl*.so")
with open(folder + "/pocl.icd", "w") as vendor:
    vendor.write(device)
os.environ["OCL_ICD_VENDORS"] = folder
import numpy as np, pmmc

asked = json.load(sys.stdin)
# cells of 5 mm across and a layer high, each of six tetrahedra; the beam lies on none of their faces
axes = np.linspace(-10, 10, 5) + 0.013, np.linspace(-10, 10, 5) + 0.017, np.cumsum([0.0, *asked["thickness"]])
nodes = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
number = np.arange(len(nodes)).reshape([len(axis) for axis in axes])
elements, media = [], []
for cell in itertools.product(*(range(len(axis) - 1) for axis in axes)):
    for way in itertools.permutations(np.eye(3, dtype=int)):
        corners = [number[tuple(c)] for c in np.cumsum([cell, *way], axis=0)]
        if np.linalg.det(nodes[corners[1:]] - nodes[corners[0]]) < 0:
            corners[2], corners[3] = corners[3], corners[2]
        elements.append(corners)
        media.append(1 + cell[2])
tetrahedra = nodes[elements]
beam = np.array([0.001, 0.0015, 1e-4])
inside = np.linalg.solve(np.swapaxes(tetrahedra[:, 1:] - tetrahedra[:, :1], 1, 2), (beam - tetrahedra[:, 0])[..., None])
first = 1 + int(np.argmax(np.minimum(inside[..., 0].min(1), 1 - inside[..., 0].sum(1))))
# pmmc 0.3.12 takes the number of nodes for that of elements
nodes = np.concatenate([nodes, np.repeat(nodes[:1], max(0, len(elements) - len(nodes)), 0)])
config = dict(
    nphoton=asked["photons"], maxdetphoton=asked["photons"], seed=1234, compute="sse", method="elem",
    node=nodes, elem=np.array(elements, np.int32) + 1, elemprop=np.array(media, np.int32), e0=first, unitinmm=1.0,
    prop=np.array([[0, 0, 1, 1.37], *asked["media"]]), isreflect=0, tstart=0.0, tend=5e-9, tstep=5e-9,
    srcpos=beam.tolist(), srcdir=[0, 0, 1], detpos=np.array([[0, 0, 0, 8.0]]), issavedet=1, issaveexit=1,
)
left = pmmc.run(config)["detp"]
# rows: detector, scatterings in either medium, way in either [mm], where (3), whither (3), weight at the start
back = left[:, left[7] < 1e-5]
weight = np.exp(-np.array([m[0] for m in asked["media"]]) @ back[3:5])
np.save(folder + "/back.npy", np.stack([np.hypot(back[5] - beam[0], back[6] - beam[1]), weight]))
"""


def returned(python: str, wavelength: float, photons: int) -> NDArray[np.float64]:
    """Distances [um] from the beam, and weights, of what the medium eye's choroid and sclera send back: `[2, N]`."""
    layers = deep_layers(wavelength, "medium")
    media = [(layer.absorption, layer.scattering, layer.anisotropy, layer.index) for layer in layers]
    asked = json.dumps({"media": media, "thickness": [layer.thickness for layer in layers], "photons": photons})
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([python, "-c", PEER, folder], input=asked, stdout=subprocess.DEVNULL, text=True, check=True)
        distances, weights = np.load(Path(folder) / "back.npy").astype(float)
    return np.stack([1e3 * distances, weights])


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("python", help="one that has pmmc")
    parser.add_argument("--wavelength", type=float, default=850.0, help="[nm], one of the table's")
    parser.add_argument("--photons", type=int, default=300_000)
    options = parser.parse_args()
    distances, weights = returned(options.python, options.wavelength, options.photons)
    table = spread_table("medium")
    at = list(table.scattering).index(1.0), list(table.wavelengths).index(options.wavelength)
    scores = []
    for radius, share in zip(1e3 * table.radii, table.enclosed[at], strict=True):
        if share <= 0.01:
            continue
        inside = np.where(distances < radius, weights, 0.0)
        mean = inside.sum() / options.photons
        error = math.sqrt((inside**2).sum() / options.photons - mean**2) / math.sqrt(options.photons)
        expected = float(share * table.reflectance[at])
        # a photon's weight is at most 1, so this is no less than the table's own standard error
        own = math.sqrt(expected / _PHOTONS)
        scores.append((mean - expected) / math.hypot(error, own))
        theirs, ours = f"{mean:.5f} +- {error:.5f}", f"{expected:.5f} +- {own:.5f}"
        print(f"within {radius:.0f} um: {theirs}, table {ours}, z {scores[-1]:+.2f}")
    # Sidak's level for the largest, as if radii were independent: discs within each other are not, which is stricter
    largest = stats.norm.isf(0.5 * (1.0 - (1.0 - _LEVEL) ** (1.0 / len(scores))))
    furthest = max(abs(z) for z in scores)
    print(f"largest z {furthest:.2f} of {largest:.2f}")
    sys.exit(int(furthest > largest))


if __name__ == "__main__":
    main()
