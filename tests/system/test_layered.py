"""The Monte Carlo of light in layers against what MCML's manual gives (Wang, Jacques & Zheng 1995), and itself."""

import math

import numpy as np
import pytest

from conespot.render.layered import traced
from conespot.scene.tissue import Layer, deep_layers, sclera

RADII = np.arange(1, 41) * 0.1  # [mm]


def test_a_slab_reflects_and_transmits_what_van_de_hulst_tabulates():
    """Matched slab of mu_a 10, mu_s 90 per cm, g .75, 0.2 mm: R .09739, T .66096, within three standard errors."""
    (slab,) = traced([[Layer(0.2, 9.0, 1.0, 0.75, 1.0)]], RADII, 400_000, seed=1)
    assert slab.reflectance_error < 0.001
    assert slab.reflectance == pytest.approx(0.09739, abs=3.0 * slab.reflectance_error)
    assert slab.transmitted == pytest.approx(0.66096, abs=3.0 * slab.transmitted_error)


def test_a_half_space_of_another_index_reflects_what_giovanelli_found():
    """Half-space of index 1.5, mu_a 10, mu_s 90 per cm, g 0: R .2600, of which .04 is specular."""
    (space,) = traced([[Layer(np.inf, 9.0, 1.0, 0.0, 1.5)]], RADII, 200_000, seed=2, outside=1.0)
    assert space.specular == pytest.approx(0.04)
    assert space.specular + space.reflectance == pytest.approx(0.26, abs=3.0 * space.reflectance_error)


def test_three_layers_reflect_and_transmit_what_mcml_does_ring_by_ring():
    """MCML's three layers of index 1.37: diffuse R .23754, T .09649, and four radial R [1/cm2] at steps of .01 cm."""
    layers = [Layer(1.0, 10.0, 0.1, 0.9), Layer(1.0, 1.0, 0.1, 0.0), Layer(2.0, 1.0, 0.2, 0.7)]
    (found,) = traced([layers], RADII, 400_000, seed=3, outside=1.0)
    # the manual's own figures are a Monte Carlo's of as many photons as ours: two standard errors each
    assert found.reflectance == pytest.approx(0.23754, abs=3.0 * math.sqrt(2.0) * found.reflectance_error)
    assert found.transmitted == pytest.approx(0.09649, abs=3.0 * math.sqrt(2.0) * found.transmitted_error)
    areas = np.pi * 0.01**2 * np.array([1, 3, 5, 7])
    theirs = np.array([30.92, 10.07, 6.119, 4.402])
    assert np.all(np.abs(found.returned[:4] / areas - theirs) < 3.0 * math.sqrt(2.0) * found.returned_error[:4] / areas)


def test_all_energy_is_reflected_transmitted_or_absorbed():
    """The sum of a mismatched stack, to 1e-6."""
    kinds = [deep_layers(850.0, kind) for kind in ("light", "dark")]
    for found in traced(kinds, RADII, 20_000, seed=4, outside=1.0):
        assert found.specular > 0.02
        total = found.specular + found.reflectance + found.transmitted + found.absorbed
        assert total == pytest.approx(1.0, abs=1e-6)


def test_stacks_that_share_photons_find_what_each_finds_alone():
    """The dark eye of three traced together against the dark eye traced alone with other photons."""
    together = traced([deep_layers(850.0, kind) for kind in ("light", "dark")], RADII, 50_000, seed=5)[1]
    (alone,) = traced([deep_layers(850.0, "dark")], RADII, 50_000, seed=6)
    error = math.hypot(together.reflectance_error, alone.reflectance_error)
    assert together.reflectance == pytest.approx(alone.reflectance, abs=3.0 * error)


def test_a_sclera_alone_lets_through_what_was_measured_in_the_blue():
    """Vogel et al. 1991: 6 % at 442 nm, which its absorption was chosen by; more at 804 nm."""
    blue, infrared = (traced([[sclera(at)]], RADII, 50_000, seed=7)[0].transmitted for at in (442.0, 804.0))
    assert blue == pytest.approx(0.06, abs=0.006)
    assert 0.2 < infrared < 0.35
