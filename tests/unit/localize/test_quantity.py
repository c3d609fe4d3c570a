"""What may be free beside the pose: one table that fits, priors, calibration and bounds go by."""

from dataclasses import fields

import pytest

from conespot.localize import Knowns
from conespot.localize.model.quantity import QUANTITIES
from conespot.scene.beam import HardBeam
from conespot.scene.document import InputError
from conespot.scene.motion import Tremor
from conespot.scene.retina import Fundus, Spread
from conespot.scene.scene import Scene


def test_every_quantity_has_its_sigma_and_every_sigma_but_the_rcms_and_the_reliefs_its_quantity():
    assert {each.known for each in QUANTITIES} == {field.name for field in fields(Knowns)} - {
        "rcm_sigma_mm",
        "relief_sigma_mm",
    }
    for each in QUANTITIES:
        assert Knowns(**{each.known: None}).sigma(each) is None
        assert Knowns(**{each.known: 0.5}).sigma(each) == (0.5 * each.per_unit) ** each.power
        assert each in Knowns(**{each.known: 0.5}).free
        assert each not in Knowns(**{each.known: 0.0}).free


@pytest.mark.parametrize("each", QUANTITIES, ids=lambda each: each.name)
def test_what_is_written_is_read(each):
    scene = Scene(retina=Fundus(spread=Spread()), motion=Tremor(exposure=0.008))
    new = each.value(scene) + (-0.01 if each.changes == "beam" else 0.01)
    assert each.value(each.write(scene, new)) == pytest.approx(new, abs=1e-12)
    assert each.value(scene) != new


def test_a_scene_without_such_a_quantity_says_what_to_describe():
    (softness,) = (each for each in QUANTITIES if each.name == "softness")
    with pytest.raises(InputError, match="no softness; describe its beam as a cycles beam"):
        softness.value(Scene(beam=HardBeam()))
