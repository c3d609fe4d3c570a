"""Maps of the fundus, from the photograph and from seeds."""

import functools

import numpy as np
import pytest

from conespot.render.fundus_anatomy import COARSE, EXTENT, Map, texel_centres
from conespot.render.fundus_maps import fundus_maps
from conespot.scene import fundus
from conespot.scene.illumination import LIGHTS
from conespot.scene.retina import Fundus

SOURCES = {"photo": Fundus(), "procedural": Fundus(source="procedural", seed=1)}


@functools.cache
def seen(name: str, wavelength: float) -> Map:
    return fundus_maps(SOURCES[name]).reflectance(wavelength, SOURCES[name], COARSE)


def vessel_mask(name: str, deep: float) -> Map:
    maps = fundus_maps(SOURCES[name])
    n = round(2.0 * EXTENT / COARSE)
    path = (maps.artery + maps.vein).reshape(n, -1, n, len(maps.vein) // n).mean(axis=(1, 3))
    return path > deep


@pytest.mark.parametrize("name", SOURCES)
@pytest.mark.parametrize("wavelength", [550.0, 640.0, 850.0])
def test_the_perifovea_reflects_like_the_closed_form(name, wavelength):
    """Median over the ring 2 to 3 mm from the fovea; against R of the perifovea without macular pigment; 10 %."""
    x, y = texel_centres(COARSE)
    rho = np.hypot(x, y)
    ring = (rho > 2.0) & (rho < 3.0)
    expected = float(fundus.reflectance(wavelength, fundus.SITES["perifovea"]))
    assert np.median(seen(name, wavelength)[ring]) == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("name", SOURCES)
def test_the_fovea_is_dark_in_blue_and_the_disc_bright_everywhere(name):
    """Mean within 0.3 mm of the fovea at 460 nm; against the perifovea: half. Disc at 550 and 850 nm: twice."""
    x, y = texel_centres(COARSE)
    rho = np.hypot(x, y)
    ring = (rho > 2.0) & (rho < 3.0)
    blue = seen(name, 460.0)
    assert blue[rho < 0.3].mean() < 0.5 * np.median(blue[ring])
    disc = fundus_maps(SOURCES[name]).disc > 0.5
    assert 2.0 < disc.sum() * COARSE**2 < 4.0  # mm2, an optic disc
    for wavelength in (550.0, 850.0):
        assert np.percentile(seen(name, wavelength)[disc], 80.0) > 2.0 * np.median(seen(name, wavelength)[ring])


@pytest.mark.parametrize("name", SOURCES)
def test_vessels_show_in_green_and_nearly_vanish_at_850_nm(name):
    """Density of the deep vessels outside the disc; against the rest: over 0.2 at 570 nm, below 0.04 at 850."""
    maps = fundus_maps(SOURCES[name])
    outside = maps.disc < 0.01
    vessels, clear = vessel_mask(name, 60.0) & outside, ~vessel_mask(name, 0.5) & outside
    assert 0.002 < vessels.mean() < 0.05

    def density(wavelength: float) -> float:
        image = seen(name, wavelength)
        return float(-np.log10(np.median(image[vessels]) / np.median(image[clear])))

    assert density(570.0) > 0.2
    assert abs(density(850.0)) < 0.04


@pytest.mark.slow
def test_a_seed_is_an_eye():
    """Two seeds of the procedural fundus; against each other and themselves: different vessels, repeatable."""
    one, two = (fundus_maps(Fundus(source="procedural", seed=k)) for k in (3, 4))
    assert np.mean((one.vein > 10.0) != (two.vein > 10.0)) > 0.005
    again = fundus_maps.__wrapped__(Fundus(source="procedural", seed=3))
    assert np.array_equal(one.vein, again.vein)
    assert np.array_equal(one.melanin, again.melanin)


def test_pigmentation_orders_light_medium_dark():
    """Median reflectance at 650 nm of the presets; against each other: falls by at least 1.5 from each to the next."""
    seen_at = []
    for pigmentation in ("light", "medium", "dark"):
        retina = Fundus(pigmentation=pigmentation)
        seen_at.append(np.median(fundus_maps(retina).reflectance(650.0, retina, 0.04)))
    assert seen_at[0] > 1.5 * seen_at[1] > 2.25 * seen_at[2]


def test_vessels_can_be_left_out():
    """A fundus without vessels; against no blood path anywhere."""
    maps = fundus_maps(Fundus(vessels=False))
    assert maps.artery.max() == 0.0
    assert maps.vein.max() == 0.0


@pytest.mark.slow
def test_band_reflectance_is_the_weighted_mean():
    """Reflectance in an IR LED's band at 16 wavelengths; against 200 of them; within 0.3 %."""
    retina, weight = Fundus(), LIGHTS["ir850"].spectrum
    maps = fundus_maps(retina)
    few, many = (maps.band(weight, retina, 0.08, steps) for steps in (16, 200))
    assert few == pytest.approx(many, rel=3e-3)


def test_the_mosaic_keeps_the_mean_and_its_stated_amplitude():
    """The tile finer than the maps; against mean 0 and the stated deviation."""
    tile = fundus_maps(Fundus(detail=0.06)).mosaic
    assert abs(tile.mean()) < 1e-4
    assert tile.std() == pytest.approx(0.06, rel=0.02)
