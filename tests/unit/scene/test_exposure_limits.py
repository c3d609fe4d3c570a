"""Retinal exposure against hand calculations."""

import math

import pytest

from conespot.scene import Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.exposure_limits import disc_irradiance, exposure, hazard_fractions, peak_irradiance, scene_exposure
from conespot.scene.illumination import LIGHTS, FlatBand
from conespot.scene.pose import Pose
from conespot.scene.power import Power
from conespot.scene.spotlights import RIGS


def test_ten_milliwatts_of_white_led():
    """10 mW of LED-B3 in a 20 deg cone at 10 mm; against 24.0 mW/cm2, A-weighted 4.19, 10 J/cm2 after 39.8 min."""
    found = exposure(disc_irradiance(10e-3, math.radians(20.0), 10.0), LIGHTS["led-b3"].spectrum)
    assert found.irradiance / 10.0 == pytest.approx(24.0, abs=0.05)
    assert found.photochemical / 10.0 == pytest.approx(4.19, abs=0.005)
    assert found.seconds_to_guide / 60.0 == pytest.approx(39.8, abs=0.05)


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
    """IR 850 exposure; against no time to 10 J/cm2, the thermal fraction, and the label in its sentence."""
    scene = Scene(illumination=LIGHTS["ir850"])
    found = scene_exposure(scene, [scene.pose([0.0, 0.0, z]) for z in (3.0, 6.0)], 1.0)
    assert found.photochemical == 0.0
    assert math.isinf(found.seconds_to_guide)
    assert found.thermal == pytest.approx(0.49 * found.irradiance, rel=0.01)
    assert found.irradiance == pytest.approx(peak_irradiance(scene, scene.pose([0.0, 0.0, 3.0]), 1.0))
    assert "2007 edition, research estimate, not a safety assessment" in found.sentence


def test_the_paper_s_white_light_exceeds_group_1_at_full_power():
    """1 W of Blender's in the paper's cone, 3 mm high, as a flat white band; its A-weighted ratio is far above 1."""
    scene = Scene(illumination=FlatBand())
    assert scene_exposure(scene, [scene.pose([0.0, 0.0, 3.0])], 1.0).photochemical_ratio > 10.0
