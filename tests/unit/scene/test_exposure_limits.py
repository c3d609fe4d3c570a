"""Retinal exposure against hand calculations."""

import math

import pytest

from conespot.scene import Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.exposure_limits import (
    PHOTOCHEMICAL_DOSE,
    PHOTOCHEMICAL_LIMIT,
    disc_irradiance,
    exposure,
    hazard_fractions,
    peak_irradiance,
    scene_exposure,
)
from conespot.scene.illumination import LIGHTS, Ambient, FlatBand
from conespot.scene.pose import Pose
from conespot.scene.power import Power
from conespot.scene.spotlights import RIGS


def test_ten_milliwatts_of_white_led():
    """10 mW of LED-B3, 20 deg, 10 mm away; against 24.0 mW/cm2, A-weighted 4.19, ICNIRP's 2.2 J/cm2 after 8.8 min."""
    found = exposure(disc_irradiance(10e-3, math.radians(20.0), 10.0), LIGHTS["led-b3"].spectrum)
    assert found.irradiance / 10.0 == pytest.approx(24.0, abs=0.05)
    assert found.photochemical / 10.0 == pytest.approx(4.19, abs=0.005)
    assert found.seconds_to_dose / 60.0 == pytest.approx(8.76, abs=0.03)
    assert "2.2 J/cm2 A-weighted after 8.7" in found.sentence
    assert "half of it after 4.3" in found.sentence


def test_the_dose_of_icnirp_and_the_limit_of_the_2007_edition_agree():
    """2.2 J/cm2 over 10^4 s against 220 uW/cm2, which the 2007 edition has before it is halved."""
    limit, dose = 2.0 * PHOTOCHEMICAL_LIMIT, PHOTOCHEMICAL_DOSE
    assert limit * 1e4 == pytest.approx(dose, rel=0.01)


@pytest.mark.parametrize(
    ("name", "a", "r"), [("led-b3", 0.174, 1.0), ("halogen", 0.039, 0.60), ("ir850", 0.0, 0.49), ("ir940", 0.0, 0.33)]
)
def test_hazard_fractions_of_the_lights(name, a, r):
    """A- and R-weighted fraction of power; against the values stated with the weights; to their last digit."""
    photochemical, thermal = hazard_fractions(LIGHTS[name].spectrum)
    assert photochemical == pytest.approx(a, abs=0.0006)
    assert thermal == pytest.approx(r, abs=0.006)


@pytest.mark.parametrize("convention", ["isotropic", "flux"])
@pytest.mark.parametrize("beam", [HardBeam(), CyclesBeam()])
def test_peak_irradiance_straight_down(convention, beam):
    """A vertical cone 5 mm above the pole; against I0 / d^2; both conventions, within 0.1 %."""
    power = Power(value=0.25, convention=convention)
    scene = Scene(beam=beam, power=power)
    expected = power.axial_intensity(beam) / 0.005**2
    assert peak_irradiance(scene, Pose.through([0.0, 0.0, 5.0], (0.0, 0.0, 22.0)), 0.25) == pytest.approx(
        expected, rel=1e-3
    )


def test_overlapping_spotlights_add_up():
    """Three equal spotlights on top of each other; against three times one."""
    pose = Pose.through([0.0, 0.0, 5.0], (6.0, 0.0, 22.0))
    one, three = (peak_irradiance(Scene(spotlights=RIGS["single"] * n), pose, 1.0) for n in (1, 3))
    assert three == pytest.approx(3.0 * one)


def test_infrared_has_no_photochemical_hazard_and_says_its_label():
    """IR 850 exposure; against no time to the dose, the thermal fraction, and the label in its sentence."""
    scene = Scene(illumination=LIGHTS["ir850"], ambient=Ambient(irradiance=0.0))
    found = scene_exposure(scene, [scene.pose([0.0, 0.0, z]) for z in (3.0, 6.0)], 1.0)
    assert found.photochemical == 0.0
    assert math.isinf(found.seconds_to_dose)
    assert found.thermal == pytest.approx(0.49 * found.irradiance, rel=0.01)
    assert found.irradiance == pytest.approx(peak_irradiance(scene, scene.pose([0.0, 0.0, 3.0]), 1.0))
    assert "no A-weighted light (limits: ISO 15004-2, 2007 edition; dose: ICNIRP 2013, aphakic" in found.sentence
    assert "research estimate, not a safety assessment" in found.sentence


def test_the_microscope_s_light_is_added_with_its_own_hazard():
    """850 nm from the needle and 100 W/m2 of a white LED from above; against their sum, and the LED's A-weight."""
    infrared, white = LIGHTS["ir850"], LIGHTS["led-b3"]
    dark = Scene(illumination=infrared, ambient=Ambient(irradiance=0.0, illumination=white))
    lit = Scene(illumination=infrared, ambient=Ambient(irradiance=100.0, illumination=white))
    pose = dark.pose([0.0, 0.0, 3.0])
    alone, added = scene_exposure(dark, [pose], 0.01), scene_exposure(lit, [pose], 0.01)
    assert added.irradiance == pytest.approx(alone.irradiance + 100.0)
    assert added.photochemical == pytest.approx(100.0 * hazard_fractions(white.spectrum)[0])


def test_the_paper_s_white_light_exceeds_group_1_at_full_power():
    """1 W of Blender's in the paper's cone, 3 mm high, as a flat white band; its A-weighted ratio is far above 1."""
    scene = Scene(illumination=FlatBand())
    assert scene_exposure(scene, [scene.pose([0.0, 0.0, 3.0])], 1.0).photochemical_ratio > 10.0
