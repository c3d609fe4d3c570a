"""One bump: its closed forms, its slope, and where it ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from conespot.scene import Eye
from conespot.scene.bump import Bump
from conespot.scene.surface import SURFACES, Surface, bump_grid

PROFILES = ("cosine", "cap", "gaussian")


def bump(profile, **more):
    return Bump(x=0.0, y=0.0, profile=profile, **more)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_bump_is_as_high_as_it_says_and_falls_all_the_way(profile):
    rho = np.linspace(0.0, bump(profile).reach, 500)
    height, slope = bump(profile).at(rho)
    assert (height[0], slope[0]) == (0.1, 0.0)
    assert abs(height[-1]) < 1e-8
    assert np.all(np.diff(height) <= 0.0)


@pytest.mark.parametrize("profile", PROFILES)
def test_the_slope_is_the_derivative_of_the_height(profile):
    rho, h = np.linspace(0.01, 0.24, 100), 1e-6
    one = bump(profile)
    central = (one.at(rho + h)[0] - one.at(rho - h)[0]) / (2.0 * h)
    np.testing.assert_allclose(one.at(rho)[1], central, atol=1e-8)


def test_the_profiles_are_their_closed_forms():
    rho = np.array([0.0, 0.05, 0.125, 0.2])
    np.testing.assert_allclose(bump("cosine").at(rho)[0], 0.05 * (1.0 + np.cos(2.0 * np.pi * rho / 0.5)), atol=1e-15)
    np.testing.assert_allclose(bump("gaussian").at(rho)[0], 0.1 * np.exp(-18.0 * (rho / 0.5) ** 2), atol=1e-15)
    sphere = (0.25**2 + 0.1**2) / 0.2  # the radius of the sphere whose cap is 0.1 high over a circle of 0.25
    np.testing.assert_allclose(bump("cap").at(rho)[0], np.sqrt(sphere**2 - rho**2) - (sphere - 0.1), atol=1e-15)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_bump_of_no_height_raises_nothing(profile):
    height, slope = bump(profile, height=0.0).at(np.linspace(0.0, 0.2, 9))
    assert not height.any()
    assert not slope.any()


def test_a_cap_is_no_more_than_half_a_sphere():
    with pytest.raises(ValueError, match="at most half its diameter"):
        bump("cap", height=0.26)
    half = bump("cap", height=0.25).at(np.array([0.15]))
    assert float(half[0][0]) == pytest.approx(0.2)


@pytest.mark.parametrize("profile", PROFILES)
def test_the_retina_rises_by_the_bump_and_nowhere_else(profile):
    eye, surface = Eye(radius=12.5), Surface(bumps=(bump(profile),))
    for rho in (0.0, 0.1, 0.2):
        angle = rho / 12.5
        risen = surface.displacement(eye, [math.sin(angle), 0.0, -math.cos(angle)])
        assert float(risen) == pytest.approx(float(bump(profile).at(np.array([rho]))[0][0]), abs=1e-12)
    assert float(surface.displacement(eye, [math.sin(0.05), 0.0, -math.cos(0.05)])) == 0.0


def test_the_papers_bumps_reach_across_its_area_and_the_literal_ones_fill_its_cells():
    for name, x, y in (("bumps", 5.0, 5.0), ("bumps-literal", 10.0 / 3.0, 4.0)):
        bumps = SURFACES[name].bumps
        assert len({(b.x, b.y) for b in bumps}) == 15
        assert (max(b.x for b in bumps), max(b.y for b in bumps)) == pytest.approx((x, y))
        assert {(b.diameter, b.height) for b in bumps} == {(0.5, 0.1)}
    assert {b.profile for b in bump_grid().bumps} == {"gaussian"}
