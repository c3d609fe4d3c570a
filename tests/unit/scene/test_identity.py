"""scene.identity: what names a description, and what does not."""

import math

import pytest
from pydantic import Field

from conespot.scene import Scene, load_scene
from conespot.scene.beam import Beam, CyclesBeam, HardBeam, LinearBeam
from conespot.scene.eye import Eye, Globe
from conespot.scene.identity import digest, essence, identity
from conespot.scene.model import Model
from conespot.scene.surface import Bump, Surface, bump_grid


class GlossyEye(Eye):
    """The eye with a key that is new."""

    gloss: float = Field(0.0, ge=0.0)


class NewScene(Scene):
    eye: GlossyEye = GlossyEye()
    haze: Globe | None = None


def test_a_new_key_with_a_default_names_nothing_anew():
    """Scenes with a key more in themselves and in their eye against those without, at the default and away from it."""
    for update in ({}, {"eye": {"radius": 11.0}}, {"beam": {"kind": "hard"}}):
        assert identity(NewScene.model_validate(update)) == identity(Scene.model_validate(update))
    assert identity(NewScene(eye=GlossyEye(gloss=0.5))) != identity(Scene())
    assert identity(NewScene(haze=Globe())) != identity(Scene())


def test_what_is_written_out_and_what_is_left_out_are_the_same():
    assert identity(Scene()) == identity(Scene.model_validate(Scene().model_dump()))
    assert identity(load_scene("paper")) == identity(load_scene("paper").model_copy(update={"eye": Eye(radius=12.0)}))
    # 9 deg as a file has it is another float than as the code has it
    assert identity(CyclesBeam(half_angle=math.nextafter(math.radians(9.0), 0.0))) == identity(CyclesBeam())


def test_two_kinds_with_nothing_but_defaults_are_two():
    kinds = [HardBeam(), CyclesBeam(), LinearBeam()]
    assert len({identity(Scene(beam=beam)) for beam in kinds}) == 3
    assert essence(Scene(beam=HardBeam())) == {"beam": {"kind": "hard"}}


def test_a_default_further_out_that_is_not_the_kinds_own_is_kept_apart_from_it():
    class Tall(Model):
        eye: Eye = Eye(radius=11.0)
        beam: Beam = HardBeam()

    assert essence(Tall()) == {}
    assert essence(Tall(eye=Eye())) == {"eye": {}}


@pytest.mark.parametrize(
    ("a", "b"),
    [
        (Surface(), Surface(bumps=(Bump(x=0.0, y=0.0),))),
        (Surface(bumps=(Bump(x=0.0, y=0.0),)), Surface(bumps=(Bump(x=0.0, y=0.0), Bump(x=0.0, y=0.0)))),
        (bump_grid(), Surface(bumps=bump_grid().bumps[1:])),
        (Scene(), Scene(interreflection=Globe())),
    ],
)
def test_whatever_differs_has_another_name(a, b):
    assert identity(a) != identity(b)


def test_a_version_that_is_raised_names_everything_anew(monkeypatch):
    before, data = identity(Scene()), digest({"x": 1})
    monkeypatch.setattr("conespot.scene.identity.SCHEMA", 99)
    assert identity(Scene()) != before
    assert digest({"x": 1}) == data
