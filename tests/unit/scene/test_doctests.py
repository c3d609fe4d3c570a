"""The examples in the docstrings of the closed forms say what the code does."""

import doctest
import importlib
import pkgutil

import pytest

import conespot.scene

MODULES = [module.name for module in pkgutil.iter_modules(conespot.scene.__path__)]
CLOSED_FORMS = {
    "beam", "camera", "emva", "exposure_limits", "eye", "fundus", "illumination", "noise", "pose", "power", "quantity",
    "sensor", "spectrum", "spotlights", "srgb", "surface", "trajectory",
}  # fmt: skip


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_hold(name):
    result = doctest.testmod(importlib.import_module(f"conespot.scene.{name}"))
    assert result.failed == 0
    assert result.attempted > 0 or name not in CLOSED_FORMS, "a closed form without an example"
