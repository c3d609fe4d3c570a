"""The closed form of the fundus' reflectance against published values."""

import csv
from pathlib import Path

import numpy as np
import pytest

from conespot.scene import fundus

TABLE = Path(__file__).parents[2] / "data" / "fundus_reflectance_delori1989.csv"
PERIFOVEA_PERCENT = {
    400: 1.89, 450: 1.61, 500: 1.77, 560: 2.03, 600: 3.88, 650: 6.81, 700: 9.12, 800: 11.96, 850: 12.5, 940: 12.7,
}  # fmt: skip
#: optical densities (artery, vein): Delori's vessels as quoted with the model
VESSELS = {570: (0.44, 0.45), 600: (0.08, 0.22), 660: (0.01, 0.05), 850: (0.025, 0.030)}


def measured(site: str) -> tuple[np.ndarray, np.ndarray]:
    rows = list(csv.DictReader(line for line in TABLE.read_text().splitlines() if not line.startswith("#")))
    wavelength = np.array([float(row["wavelength_nm"]) for row in rows])
    return wavelength, np.array([float(row[f"{site}_pct"]) for row in rows]) / 100.0


@pytest.mark.parametrize(("wavelength", "percent"), PERIFOVEA_PERCENT.items())
def test_perifovea_matches_the_tabulated_closed_form(wavelength, percent):
    """Reflectance of the perifovea in the retinal plane; against ten stated values [%]; within 1 %."""
    assert 100.0 * fundus.reflectance(wavelength, fundus.SITES["perifovea"]) == pytest.approx(percent, rel=0.01)


@pytest.mark.parametrize("site", fundus.SITES)
def test_sites_follow_delori_and_pflibsen(site):
    """Reflectance through a 28 year old phakic lens; against the 20 measured wavelengths of Table I; rms within 6 %."""
    wavelength, truth = measured(site)
    cornea = fundus.reflectance(wavelength, fundus.SITES[site]) * 10.0 ** (-2.0 * fundus.lens_density(wavelength))
    error = cornea / truth - 1.0
    assert np.sqrt(np.mean(error**2)) < 0.06
    assert np.max(np.abs(error)) < 0.15


@pytest.mark.parametrize("wavelength", VESSELS)
def test_vessels_have_the_stated_optical_density(wavelength):
    """Density of an 80 um artery and a 110 um vein; against the stated values; within 10 % or half their last digit."""
    artery, vein = VESSELS[wavelength]
    for stated, saturation, depth in (
        (artery, fundus.BLOOD.artery_saturation, fundus.BLOOD.artery_depth),
        (vein, fundus.BLOOD.vein_saturation, fundus.BLOOD.vein_depth),
    ):
        ours = float(fundus.vessel_density(wavelength, saturation, depth))
        assert ours == pytest.approx(stated, rel=0.1, abs=0.0005)


def test_vessel_depth_inverts_the_transmission():
    """Depth from transmission at 560 nm; against the depth that made it; to rounding."""
    depth = np.array([0.0, 5.0, 40.0, 110.0])
    through = fundus.vessel_transmission(560.0, 0.6, depth)
    assert np.allclose(fundus.vessel_depth(through, 560.0, 0.6), depth, atol=1e-6)
    assert np.isinf(fundus.vessel_depth(0.3, 560.0, 0.6))


def test_vessels_nearly_vanish_in_the_infrared():
    """Density of artery and vein at 850 nm; against that at 570 nm; at most a tenth."""
    for saturation, depth in ((0.97, 80.0), (0.60, 110.0)):
        green, infrared = fundus.vessel_density(np.array([570.0, 850.0]), saturation, depth)
        assert infrared < 0.1 * green


def test_disc_is_brighter_than_retina():
    """Disc in the visible; against all three sites; at least three times as bright in green."""
    disc = fundus.disc_reflectance(550.0)
    assert all(disc > 3.0 * fundus.reflectance(550.0, site) for site in fundus.SITES.values())


def test_water_counts_beyond_900_nm():
    """Transmission of 24 mm of vitreous; against 0.34 at 970 nm and next to nothing lost at 800 nm and below."""
    assert fundus.water_transmission(970.0) == pytest.approx(0.34, rel=0.01)
    assert fundus.water_transmission(800.0) > 0.95
    assert fundus.water_transmission(550.0) > 0.998
