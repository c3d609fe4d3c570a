"""The table of spread as sums of Gaussians, and what a file may say of it."""

import numpy as np
import pytest
from pydantic import ValidationError

from conespot.scene import Eye, Scene
from conespot.scene.eye import Globe
from conespot.scene.identity import identity
from conespot.scene.retina import Fundus, Glint, Spread
from conespot.scene.spread import spread_kernel, spread_table


@pytest.mark.parametrize("pigmentation", ["light", "medium", "dark"])
def test_the_gaussians_have_the_table_s_shares(pigmentation):
    """Every ring that holds 2 % of the light or more to 1.5 % of itself, which is the table's own noise."""
    table = spread_table(pigmentation)
    for i, scattering in enumerate(table.scattering):
        for j, wavelength in enumerate(table.wavelengths):
            kernel = spread_kernel(wavelength, pigmentation, scattering)
            ours = np.diff(kernel.enclosed(table.radii), prepend=0.0)
            theirs = np.diff(table.enclosed[i, j], prepend=0.0)
            held = theirs > 0.02
            assert np.sum(held) >= 5
            np.testing.assert_allclose(ours[held], theirs[held], rtol=0.015)


def test_light_spreads_further_in_the_infrared_in_light_eyes_and_where_less_is_scattered():
    def median(wavelength, pigmentation="medium", scattering=1.0):
        radii = np.linspace(0.0, 2.0, 4001)
        return radii[np.argmax(spread_kernel(wavelength, pigmentation, scattering).enclosed(radii) >= 0.5)]

    assert median(550.0) < median(660.0) < median(850.0) < median(940.0)
    assert median(850.0, "dark") < median(850.0) < median(850.0, "light")
    assert median(850.0, scattering=2.0) < median(850.0) < median(850.0, scattering=0.5)
    assert median(850.0, scattering=1.0) == pytest.approx(0.226, abs=0.01)  # the table's


def test_a_density_is_the_derivative_of_its_shares():
    kernel, radius = spread_kernel(800.0, "medium", 1.5), np.linspace(0.05, 2.0, 40)
    step = 1e-5
    ring = (kernel.enclosed(radius + step) - kernel.enclosed(radius - step)) / (4.0 * np.pi * radius * step)
    np.testing.assert_allclose(kernel(radius), ring, rtol=1e-5)


def test_coefficients_outside_the_table_are_refused():
    with pytest.raises(ValueError, match="scattering 3 is not within"):
        spread_kernel(850.0, "medium", 3.0)
    with pytest.raises(ValidationError, match="less than or equal to 2"):
        Spread(scattering=3.0)


def test_spread_goes_with_no_other_effect_that_moves_light_in_the_eye():
    with pytest.raises(ValidationError, match="glint and spread"):
        Fundus(glint=Glint(), spread=Spread())
    with pytest.raises(ValidationError, match=r"interreflection and retina\.spread"):
        Scene(retina=Fundus(spread=Spread()), interreflection=Globe())


def test_a_retina_without_spread_has_the_address_it_always_had():
    plain = {"eye": identity(Eye()), "retina": Fundus()}
    assert identity(plain["retina"]) == identity(Fundus(spread=None)) != identity(Fundus(spread=Spread()))
