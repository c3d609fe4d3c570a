"""Eyes of a population, as surfaces name them."""

import numpy as np
import pytest
from pydantic import ValidationError

from conespot.scene.document import merge
from conespot.scene.population import SEMI_AXES_SIGMA_MM, drawn_semi_axes, mean_semi_axes
from conespot.scene.surface import Surface

EYES = np.array([drawn_semi_axes(number) for number in range(1000)])


def test_eyes_scatter_about_the_mean_one_as_much_as_is_said():
    assert EYES.mean(axis=0) == pytest.approx(mean_semi_axes(), abs=5.0 * SEMI_AXES_SIGMA_MM / np.sqrt(1000))
    assert EYES.std(axis=0).max() == pytest.approx(SEMI_AXES_SIGMA_MM, rel=0.1)


def test_most_eyes_are_oblate_as_atchison_found():
    assert 0.8 < np.mean(EYES[:, 2] < EYES[:, 0]) < 1.0


def test_a_surface_takes_an_eye_by_its_number_or_the_mean_one():
    shape = np.array(Surface.model_validate({"population": 7}).semi_axes)
    assert shape * mean_semi_axes()[2] == pytest.approx(drawn_semi_axes(7))
    assert Surface.model_validate({"population": "mean"}).semi_axes[2] == 1.0


def test_an_eye_of_the_population_replaces_the_semi_axes_it_is_laid_on():
    assert merge({"semi_axes": [1, 1, 1]}, {"population": 3}) == {"population": 3}


@pytest.mark.parametrize("eye", [-1, 1.5, "median", True, None])
def test_what_is_no_eye_of_the_population_is_refused_in_a_sentence(eye):
    with pytest.raises(ValidationError, match="the number of an eye"):
        Surface.model_validate({"population": eye})
