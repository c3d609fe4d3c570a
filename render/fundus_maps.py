"""Maps of what gives a fundus its colour, over arc coordinates [mm] about the posterior pole (see reflectance.py).

Rows of a map run down (-y), columns right (+x). Low-frequency maps of pigments and blood have coarse texels, vessels
fine ones, and a small tile, repeated everywhere, adds the mosaic that is finer than both.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.render import fundus_photo, fundus_tree
from conespot.render.fundus_anatomy import COARSE, EXTENT, FINE, Map, texel_centres
from conespot.scene import fundus
from conespot.scene.retina import Fundus
from conespot.scene.spectrum import Curve

#: texel and side of the mosaic tile [mm]
GRAIN = 0.0025
TILE = 1.28
#: retinal distance per degree of the visual field [mm]
MM_PER_DEGREE = 0.288


@dataclass(frozen=True)
class FundusMaps:
    """Everything in the closed form of `scene.fundus` that varies over the retina."""

    melanin: Map  #: optical density at 500 nm, coarse `[n, n]`
    blood: Map  #: choroidal blood [um], coarse
    epithelium: Map  #: reflectance in front of the melanin, coarse
    macular: Map  #: macular pigment density at 460 nm, coarse
    disc: Map  #: 1 in the optic disc, 0 outside, coarse
    artery: Map  #: path of arterial blood [um], fine `[m, m]`
    vein: Map  #: path of venous blood [um], fine
    mosaic: Map  #: relative change of melanin and blood, mean 0, tile `[k, k]`

    def reflectance(self, wavelength: float, retina: Fundus, texel: float = FINE) -> Map:
        """Reflectance `[k, k]` at a wavelength [nm] on texels of `texel` [mm]: the closed form, in numpy."""
        n = round(2.0 * EXTENT / texel)
        coarse = {
            name: _resized(getattr(self, name), n) for name in ("melanin", "blood", "epithelium", "macular", "disc")
        }
        tile = _resized(self.mosaic, round(TILE / texel))
        repeats = -(-n // len(tile))
        grain = 1.0 + np.tile(tile, (repeats, repeats))[:n, :n]
        choroid = float(fundus.scatter(wavelength))
        mu = float(fundus.blood_absorption(wavelength, fundus.BLOOD.choroid_saturation))
        absorbed = np.exp(-2.0 * np.log(10.0) * coarse["melanin"] * grain * float(fundus.melanin_template(wavelength)))
        absorbed *= np.exp(-2.0 * mu * coarse["blood"] * grain)
        tissue = coarse["epithelium"] + (1.0 - coarse["epithelium"]) ** 2 * absorbed * choroid
        tissue *= np.power(10.0, -2.0 * coarse["macular"] * float(fundus.macular_template(wavelength)))
        white = float(fundus.disc_reflectance(wavelength))
        surface = tissue + coarse["disc"] * (white - tissue)
        for name, saturation in (("artery", retina.artery_saturation), ("vein", retina.vein_saturation)):
            path = _resized(getattr(self, name), n)
            through = np.exp(-2.0 * float(fundus.blood_absorption(wavelength, saturation)) * path)
            surface *= fundus.BLOOD.bypass + (1.0 - fundus.BLOOD.bypass) * through
        return np.asarray(surface, np.float32)

    def band(self, weight: Curve, retina: Fundus, texel: float = FINE, steps: int = 16) -> Map:
        """Reflectance averaged over a weight (light times response), at `steps` wavelengths of equal weight."""
        fine = np.linspace(weight.low, weight.high, 4001)
        cumulative = np.cumsum(np.maximum(weight(fine), 0.0))
        at = np.interp((np.arange(steps) + 0.5) / steps, cumulative / cumulative[-1], fine)
        total = sum(self.reflectance(float(w), retina, texel).astype(np.float64) for w in at)
        return np.asarray(total / steps, np.float32)


@functools.lru_cache(maxsize=4)
def fundus_maps(retina: Fundus) -> FundusMaps:
    """The maps of a fundus, from the photograph or from its seed."""
    melanin = fundus.MELANIN[retina.pigmentation]
    rng = np.random.default_rng([retina.seed, 0x_F0_9D_05])
    anatomy = fundus_photo.photographed() if retina.source == "photo" else fundus_tree.grown(rng)
    sites = _site_maps(anatomy.disc_centre, melanin)
    tree = (anatomy.artery, anatomy.vein) if retina.vessels else (np.zeros_like(anatomy.artery),) * 2
    return FundusMaps(
        melanin=np.maximum(sites["melanin"] * (1.0 + anatomy.melanin), 0.02).astype(np.float32),
        blood=np.maximum(sites["blood"] * (1.0 + anatomy.blood), 5.0).astype(np.float32),
        epithelium=(sites["epithelium"] * (1.0 + anatomy.epithelium)).astype(np.float32),
        macular=sites["macular"],
        disc=anatomy.disc,
        artery=tree[0],
        vein=tree[1],
        mosaic=retina.detail * _mosaic_tile(np.random.default_rng([retina.seed, 0x_303A1C])),
    )


def _site_maps(disc_centre: tuple[float, float], melanin: float) -> dict[str, Map]:
    """The closed form's parameters between its three measured sites: fovea in the middle, nasal beyond the disc."""
    x, y = texel_centres(COARSE)
    rho = np.hypot(x, y)
    foveal = np.exp(-((rho / 0.75) ** 2))
    towards_disc = np.array(disc_centre) / np.hypot(*disc_centre)
    along = x * towards_disc[0] + y * towards_disc[1]
    nasal = 1.0 / (1.0 + np.exp(-(along - np.hypot(*disc_centre)) / 0.7))
    fovea, perifovea, beyond = (fundus.SITES[name] for name in ("fovea", "perifovea", "nasal"))

    def between(name: str) -> NDArray[np.float64]:
        base = getattr(perifovea, name)
        change = foveal * (getattr(fovea, name) - base) + nasal * (1.0 - foveal) * (getattr(beyond, name) - base)
        return np.asarray(base + change)

    macular = fovea.macular * fundus.macular_profile(rho / MM_PER_DEGREE) * (1.0 - nasal)
    scaled = melanin / perifovea.melanin
    return {
        "melanin": (between("melanin") * scaled).astype(np.float32),
        "blood": between("blood").astype(np.float32),
        "epithelium": between("epithelium").astype(np.float32),
        "macular": macular.astype(np.float32),
    }


def _mosaic_tile(rng: np.random.Generator) -> Map:
    """A tile without seams: pigment epithelium cells (14 um) and the clusters they form (50 um)."""
    n = round(TILE / GRAIN)
    frequency = np.hypot(np.fft.fftfreq(n, GRAIN)[:, None], np.fft.rfftfreq(n, GRAIN)[None, :])  # [1/mm]
    amplitude = sum(
        weight * size * np.exp(-((np.log(np.maximum(frequency, 1e-6) * size) / 0.45) ** 2))
        for size, weight in ((0.014, 1.0), (0.05, 0.5))
    )
    field = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((n, n))) * amplitude, s=(n, n))
    return np.asarray(np.clip((field - field.mean()) / field.std(), -4.0, 4.0), np.float32)


def _resized(values: Map, n: int) -> NDArray[np.float32]:
    if len(values) == n:
        return values.copy()
    how = cv2.INTER_AREA if len(values) > n else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(values, (n, n), interpolation=how), np.float32)
