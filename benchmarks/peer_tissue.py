"""Reflectance and transmittance of choroid over sclera: this project's Monte Carlo against adding-doubling.

Wants another Python with iadpython (S. Prahl), an independent solver without chance: pip install iadpython==0.5.3 scipy

python benchmarks/peer_tissue.py /path/to/that/python
"""

from __future__ import annotations

import json
import subprocess
import sys

from conespot.render.layered import traced
from conespot.scene.tissue import Layer, deep_layers

PEER = """
import contextlib, io, json, sys
with contextlib.redirect_stdout(io.StringIO()):
    import iadpython
found = []
for layers in json.load(sys.stdin):
    slabs = []
    for thickness, scattering, absorption, g in layers:
        total = scattering + absorption
        slab = iadpython.Sample(a=scattering / total, b=total * thickness, g=g, d=1, n=1, quad_pts=32)
        r, _, t, _ = slab.rt_matrices()
        slabs.append((r, r, t, t))
    r, _, t, _ = iadpython.add_layers(slab, *slabs[0], *slabs[1])
    found.append([float(v) for v in slab.UX1_and_UXU(r, t)[:2]])
print(json.dumps(found))
"""


def main(peer: str) -> None:
    """The command."""
    cases = [(w, kind) for w in (650.0, 850.0) for kind in ("light", "medium", "dark")]
    stacks = [deep_layers(wavelength, kind) for wavelength, kind in cases]
    sent = json.dumps([[_numbers(layer) for layer in stack] for stack in stacks])
    ran = subprocess.run([peer, "-c", PEER], input=sent, capture_output=True, text=True, check=True)
    for (wavelength, kind), stack, theirs in zip(cases, stacks, json.loads(ran.stdout.splitlines()[-1]), strict=True):
        (ours,) = traced([stack], [1.0], 200_000, seed=11)
        print(
            f"{wavelength:g} nm {kind}: R {ours.reflectance:.4f} +- {ours.reflectance_error:.4f} ({theirs[0]:.4f}),"
            f" T {ours.transmitted:.4f} +- {ours.transmitted_error:.4f} ({theirs[1]:.4f})"
        )


def _numbers(layer: Layer) -> list[float]:
    return [layer.thickness, layer.scattering, layer.absorption, layer.anisotropy]


if __name__ == "__main__":
    main(sys.argv[1])
