"""Traces rays through model eyes with other people's tracers, and writes where they meet the retina.

`PYTHON benchmarks/peer_optics.py tests/data/optics_reference.csv`, where PYTHON has visisipy 0.5 and optiland 0.6
(`pip install visisipy==0.5.* optiland==0.6.*`). Stands alone: it shares nothing with the package but published numbers.
Two chief rays of a whole Navarro eye are visisipy's own ray trace with the indices published with it; all other rays
are traced by optiland.
tests/unit/scene/test_optics.py holds the package to the table.
"""

from __future__ import annotations

import csv
import importlib.metadata
import itertools
import sys
import warnings
from pathlib import Path

import numpy as np
import visisipy
from optiland.materials import IdealMaterial, Material
from optiland.optic import Optic
from optiland.rays import RealRays
from scipy.optimize import brentq
from visisipy.models import materials as published

COLUMNS = ["eye", "lens", "contact", "refraction_d", "wavelength_nm", "rays"]
COLUMNS += ["ox", "oy", "oz", "dx", "dy", "dz", "x", "y", "z"]
PINHOLE = 110.0  # above the posterior pole [mm]
TOP = 30.0  # height above the posterior pole [mm] at which a ray is noted
#: of cornea, aqueous, lens and vitreous at 365, 486.1, 656.3 and 1014 nm (Navarro 1985)
MEASURED = np.array(
    [
        [1.3975, 1.3807, 1.37405, 1.3668],
        [1.3593, 1.3422, 1.3354, 1.3278],
        [1.4492, 1.42625, 1.4175, 1.4097],
        [1.3565, 1.3407, 1.3341, 1.3273],
    ]
)
#: Herzberger's interpolation between them: one row for each
HERZBERGER = np.array(
    [
        [0.66147196, -0.40352796, -0.2804679, 0.03385979],
        [-4.20146383, 2.73508956, 1.50543784, -0.11593235],
        [6.29834237, -4.69409935, -1.5750865, 0.10293038],
        [-1.75835059, 2.36253794, 0.35011657, -0.02085782],
    ]
)
FLAT = 1.0  # thickness of the contact lens [mm]


def indices(eye: str, wavelength: float) -> tuple[float, float, float, float]:
    """Cornea, aqueous, lens and vitreous."""
    if eye == "le-grand":
        found = published.GullstrandLeGrandUnaccommodatedMaterials()
        return tuple(getattr(found, name).refractive_index for name in ("cornea", "aqueous", "lens", "vitreous"))
    square = (wavelength / 1e3) ** 2
    pole = 1.0 / (square - 0.028)
    return tuple(MEASURED @ HERZBERGER @ [1.0, square, pole, pole * pole])


def length(eye: str, refraction: float) -> float:
    """Axial length [mm]."""
    return {"navarro": 23.9203, "le-grand": 24.19655, "atchison": 23.58 - 0.299 * refraction}[eye]


def built(eye: str, lens: str, contact: str, refraction: float, wavelength: float) -> Optic:
    """The eye as optiland has it."""
    cornea, aqueous, crystalline, vitreous = (IdealMaterial(n=n) for n in indices(eye, wavelength))
    front, back = {
        "navarro": ((7.72, -0.26), (6.50, 0.0)),
        "le-grand": ((7.8, 0.0), (6.5, 0.0)),
        "atchison": ((7.77 + 0.022 * refraction, -0.15), (6.40, -0.275)),
    }[eye]
    iris = 3.7 if eye == "atchison" else 3.6
    behind = length(eye, refraction) - iris
    axial, vertical = 10.148 - 0.163 * refraction, 11.365 - 0.090 * refraction
    retina = {
        "navarro": (-12.0, 0.0),
        "le-grand": (-13.4, 0.0),
        "atchison": (-(vertical**2) / axial, (vertical / axial) ** 2 - 1.0),
    }[eye]
    faces = [(*front, 0.55, cornea), (*back, iris - 0.55, aqueous)]
    if contact == "flat":
        pmma = Material("PMMA", reference="Sultanova")
        faces.insert(0, (np.inf, 0.0, FLAT, IdealMaterial(n=float(np.ravel(pmma.n(wavelength / 1e3))[0]))))
    if lens == "phakic":
        own = {"navarro": ((10.2, -3.1316), (-6.0, -1.0)), "le-grand": ((10.2, 0.0), (-6.0, 0.0))}[eye]
        faces += [(np.inf, 0.0, 0.0, aqueous), (*own[0], 4.0, crystalline), (*own[1], behind - 4.0, vitreous)]
    elif lens == "aphakic":
        faces += [(np.inf, 0.0, behind, vitreous)]
    else:
        faces += [(np.inf, 0.0, 4.70 - iris, aqueous), (21.557, 0.0, 0.593, IdealMaterial(n=1.554))]
        faces += [(-22.0, 0.0, behind - (4.70 - iris) - 0.593, vitreous)]
    optic = Optic()
    optic.surfaces.add(index=0, thickness=np.inf)
    stop = 3 if contact == "none" else 4
    for i, (radius, conic, thickness, material) in enumerate(faces, start=1):
        given = {"radius": radius, "conic": conic, "thickness": thickness, "material": material}
        optic.surfaces.add(index=i, **given, is_stop=i == stop)
    optic.surfaces.add(index=len(faces) + 1, radius=retina[0], conic=retina[1])
    optic.set_aperture("EPD", 4.0)
    optic.set_field_type("angle")
    optic.add_field(y=0.0)
    optic.add_wavelength(wavelength / 1e3, is_primary=True)
    return optic


def trace(
    optic: Optic, top: float, start: np.ndarray, direction: np.ndarray, wavelength: float
) -> tuple[np.ndarray, float]:
    """Where a ray (our frame: z up, pole at the origin) meets the retina, and its height y at the stop [mm]."""
    one = [np.array([v]) for v in (start[0], start[1], top - start[2], direction[0], direction[1], -direction[2])]
    rays = RealRays(*one, np.ones(1), np.array([wavelength / 1e3]))
    optic.surfaces.trace(rays)
    at_stop = float(np.ravel(optic.surfaces.y[optic.surfaces.stop_index])[0])
    return np.array([rays.x[0], rays.y[0], top - rays.z[0]]), at_stop


def chief(optic: Optic, top: float, angle: float, wavelength: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Start, direction and hit of the ray at `angle` [deg] in the y-z plane through the middle of the stop."""
    direction = np.array([0.0, np.sin(np.radians(angle)), -np.cos(np.radians(angle))])

    def start(y: float) -> np.ndarray:
        return np.array([0.0, y, TOP])

    # about where a straight line to a pupil 3 mm below the cornea begins
    guess = np.tan(np.radians(angle)) * -(TOP - top + 3.0)
    y = brentq(lambda y: trace(optic, top, start(y), direction, wavelength)[1], guess - 1.5, guess + 1.5, xtol=1e-13)
    return start(y), direction, trace(optic, top, start(y), direction, wavelength)[0]


def seen(optic: Optic, top: float, x: float, y: float, wavelength: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Start, direction and hit of the pinhole's ray towards (x, y) on the plane 20 mm above the pole."""
    pinhole = np.array([0.0, 0.0, PINHOLE])
    direction = np.array([x, y, 20.0]) - pinhole
    direction /= np.linalg.norm(direction)
    start = pinhole + direction * (TOP - PINHOLE) / direction[2]
    return start, direction, trace(optic, top, start, direction, wavelength)[0]


def by_visisipy(wavelength: float, angles: tuple[float, ...]) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Start, direction and hit of a whole Navarro eye's chief rays, all by visisipy."""
    materials = getattr(published, f"NavarroMaterials{wavelength:.0f}")()
    model = visisipy.EyeModel(geometry=visisipy.NavarroGeometry(), materials=materials)
    found, top = [], length("navarro", 0.0)
    for angle in angles:
        table = visisipy.analysis.raytrace(model, coordinates=[(0.0, angle)], wavelengths=[wavelength / 1e3])
        at = table.set_index("surface")[["x", "y", "z"]].to_numpy(float).copy()
        at[:, 2] = top - at[:, 2]
        way = at[1] - at[0]
        found.append((at[0], way / np.linalg.norm(way), at[-1]))
    return found


def rows() -> list[list[object]]:
    """The table."""
    table: list[list[object]] = []
    eyes = [
        *(
            ("navarro", lens, contact, 0.0)
            for lens in ("phakic", "aphakic", "pseudophakic")
            for contact in ("none", "flat")
        ),
        ("le-grand", "phakic", "none", 0.0),
        ("le-grand", "aphakic", "flat", 0.0),
        ("atchison", "aphakic", "flat", -4.0),
    ]
    for eye, lens, contact, refraction in eyes:
        for wavelength in (589.3,) if eye == "le-grand" else (543.0, 632.8, 850.0):
            optic = built(eye, lens, contact, refraction, wavelength)
            top = length(eye, refraction) + (FLAT if contact == "flat" else 0.0)
            traced = [("chief", chief(optic, top, angle, wavelength)) for angle in (-20.0, 20.0)]
            places = itertools.product((0.0,) if eye == "atchison" else (0.0, 1.5, -3.0), (0.0, 0.7, 2.0, -2.5))
            traced += [("pinhole", seen(optic, top, x, y, wavelength)) for x, y in places]
            if (eye, lens, contact) == ("navarro", "phakic", "none") and wavelength != 850.0:
                traced += [("visisipy", one) for one in by_visisipy(wavelength, (-20.0, 20.0))]
            for rays, (start, direction, hit) in traced:
                numbers = [f"{v:.12g}" for v in (*start, *direction, *hit)]
                table.append([eye, lens, contact, refraction, wavelength, rays, *numbers])
    return table


def main() -> None:
    """Write the table to the file that is named."""
    warnings.simplefilter("ignore")
    versions = " and ".join(f"{name} {importlib.metadata.version(name)}" for name in ("optiland", "visisipy"))
    with Path(sys.argv[1]).open("w", newline="") as file:
        file.write(f"# Where rays meet the retina: benchmarks/peer_optics.py with {versions}.\n")
        file.write("# mm; origin at the posterior pole, z towards the camera; o and d are the ray in the air.\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows())


if __name__ == "__main__":
    main()
