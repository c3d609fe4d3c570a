"""Makes scene/data/tissue_spread.csv anew: how deep light spreads in choroid and sclera, by Monte Carlo.

python benchmarks/tissue_kernel.py [--photons 2000000]
"""

from __future__ import annotations

import argparse
import csv
import os
from importlib import resources
from pathlib import Path
from typing import get_args

import numpy as np

from conespot.render.layered import traced
from conespot.scene.retina import Pigmentation
from conespot.scene.tissue import deep_layers

WAVELENGTHS = np.arange(500.0, 951.0, 50.0)
SCATTERING = (0.5, 1.0, 2.0)
#: [um]
RADII = np.round(10.0 * 2.0 ** (np.arange(19) / 2.0), 1)
HEADER = """\
# Share of the light that came back out of choroid and sclera within a distance [um] of where it entered them.
# Source: Monte Carlo of this project (render/layered.py), {photons} photons straight down for each wavelength and
# scattering; remade by `python benchmarks/tissue_kernel.py`. Layers and their sources: scene/tissue.py.
# Light enters and is counted under the pigment epithelium, whose melanin is in the closed form of scene/fundus.py.
# `reflectance` is the diffuse reflectance of the two layers alone, `scattering` the factor on every coefficient mu_s.
"""


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--photons", type=int, default=2_000_000, help="a combination of wavelength and scattering")
    photons = parser.parse_args().photons
    kinds = get_args(Pigmentation)
    rows = []
    for i, (scattering, wavelength) in enumerate((s, w) for s in SCATTERING for w in WAVELENGTHS):
        stacks = [deep_layers(float(wavelength), kind, scattering) for kind in kinds]
        for kind, tally in zip(kinds, traced(stacks, RADII * 1e-3, photons, seed=i), strict=True):
            shares = [f"{share:.5f}" for share in tally.enclosed]
            rows.append([f"{wavelength:g}", kind, scattering, f"{tally.reflectance:.5f}", *shares])
        print(f"{wavelength:g} nm, scattering times {scattering:g}: {tally.launched} photons", flush=True)
    path = Path(str(resources.files("conespot.scene").joinpath("data/tissue_spread.csv")))
    temporary = path.with_suffix(".part")
    with open(temporary, "w", encoding="utf-8", newline="") as stream:
        stream.write(HEADER.format(photons=photons))
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(["wavelength_nm", "pigmentation", "scattering", "reflectance", *(f"{r:g}" for r in RADII)])
        writer.writerows(rows)
    os.replace(temporary, path)


if __name__ == "__main__":
    main()
