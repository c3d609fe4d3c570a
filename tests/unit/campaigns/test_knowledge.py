"""campaigns.knowledge: what localizers are told, never the pose; and what sharing frames between knowledge means."""

import math

import numpy as np
import pytest

from conespot.campaigns.knowledge import Knowledge
from conespot.campaigns.plan import frame_seed, make_plan, told
from conespot.campaigns.schema import base, read_campaign, resolved
from conespot.localize import Knowns
from conespot.scene import InputError, Scene
from conespot.scene.beam import CyclesBeam
from conespot.scene.document import dump

SWEPT = """\
scene: paper
poses: 3
sweep:
  knowledge:
    - {rcm_sigma: free}
    - {rcm_sigma: 0.01 mm, rcm_error: 0.01 mm}
    - {reference: 2}
  scene.power.value: [0.5 W, 1 W]
"""


@pytest.mark.parametrize(
    ("said", "known"),
    [
        ({"blur_sigma": "10 um"}, Knowns(blur_sigma_mm=0.01)),
        ({"blur_sigma": "free", "core_sigma": "0 mm"}, Knowns(blur_sigma_mm=None, core_sigma_mm=0.0)),
        ({"softness_sigma": 0.1, "deep_amount_sigma": "free"}, Knowns(softness_sigma=0.1, deep_amount_sigma=None)),
    ],
)
def test_what_spreads_the_light_may_be_free_fixed_or_known_to_a_sigma(said, known):
    knowledge = Knowledge.model_validate(said)
    assert knowledge.knowns == known
    assert Knowledge.model_validate(knowledge.model_dump(mode="json")) == knowledge


@pytest.fixture
def campaign(tmp_path):
    def write(text):
        (tmp_path / "c.yaml").write_text(text)
        return read_campaign(str(tmp_path / "c.yaml"))

    return write


def test_a_beam_and_a_wall_may_be_told_in_place_of_the_true_ones():
    wrong = Knowledge(beam={"kind": "cycles", "blend": 0.1}, surface={"semi_axes": [1.0, 1.0, 1.05]})
    told = wrong.told(Scene(), np.random.default_rng(1))
    assert told.beam == CyclesBeam(blend=0.1)
    assert told.surface.semi_axes == (1.0, 1.0, 1.05)
    assert told.camera == Scene().camera


def test_by_default_localizers_are_told_the_true_scene_and_an_rcm_known_to_a_twentieth_of_a_millimetre():
    scene = Scene()
    assert Knowledge().told(scene, np.random.default_rng(1)) == scene
    assert Knowledge().knowns.rcm_sigma_mm == Knowns().rcm_sigma_mm == 0.05
    assert Knowledge().knowns.free == ()


def test_errors_are_drawn_with_the_stated_standard_deviation():
    """A thousand draws of the RCM and the half angle, against their sigmas: within 10 %."""
    scene = Scene()
    wrong = Knowledge(rcm_error=0.01, half_angle_error=math.radians(0.02), camera_height_error=0.3)
    seen = [wrong.told(scene, np.random.default_rng(i)) for i in range(1000)]
    rcm = np.array([s.instrument.rcm for s in seen]) - scene.instrument.rcm
    assert np.std(rcm, axis=0) == pytest.approx([0.01] * 3, rel=0.1)
    assert np.std([s.beam.half_angle for s in seen]) == pytest.approx(math.radians(0.02), rel=0.1)
    assert np.std([s.camera.height for s in seen]) == pytest.approx(0.3, rel=0.1)
    assert all(s.eye == scene.eye and s.spotlights == scene.spotlights for s in seen)


def test_one_quantitys_error_leaves_the_draws_of_another_alone():
    scene = Scene()
    alone = Knowledge(eye_radius_error=0.1).told(scene, np.random.default_rng(3))
    both = Knowledge(eye_radius_error=0.1, rcm_error=0.1).told(scene, np.random.default_rng(3))
    assert alone.eye == both.eye


def test_cases_that_differ_in_knowledge_look_at_the_same_images(campaign):
    """Six cases, two frames a pose: equal seeds of the sensor's noise, and one rendering of each pose."""
    plan = make_plan(campaign(SWEPT))
    assert (len(plan.cases), plan.frames, plan.tiles, plan.rows) == (6, 6, 3, 18)
    unit = next(plan.units())
    group = plan.groups[unit.group]
    seeds = [frame_seed(unit, case) for case in group.cases]
    assert len(set(seeds)) == 2
    assert seeds == sorted(seeds, key=seeds.index), "cases of one frame follow each other"
    assert [c.frame for c in group.cases] == [c for c in dict.fromkeys(x.frame for x in group.cases) for _ in range(3)]


def test_what_is_told_at_a_pose_is_the_same_in_every_run(campaign):
    plans = [make_plan(campaign(SWEPT)) for _ in range(2)]
    scenes = [[told(unit, plan.cases[2]) for unit in plan.units()] for plan in plans]
    assert scenes[0] == scenes[1]
    assert len({s.instrument.rcm for s in scenes[0]}) == 3, "the error is drawn for every pose"


def test_knowledge_is_written_out_so_that_it_reads_back(campaign, tmp_path):
    text = "scene: paper\nknowledge: {rcm_sigma: free, half_angle_sigma: 0.02 deg, surface: bumps, sequence: 5}\n"
    document = campaign(text)
    again = campaign(dump(resolved(document, {})))
    written = [base(d).knowledge.model_dump(mode="json") for d in (document, again)]
    assert written[0] == written[1]
    assert base(again).knowledge.rcm_sigma is None


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ("{rcm_sigma: 0.01}", "no unit"),
        ("{rcm_sigma: -1 mm}", "greater than or equal to 0"),
        ("{reference: 1, sequence: 5}", "either reference or sequence"),
        ("{sequence: 1}", "at least 2"),
        ("{surface: bumpy}", "did you mean 'bumps'"),
        ("{pose: 3}", "unknown key 'pose'"),
    ],
)
def test_wrong_knowledge_is_named_with_its_line(campaign, given, complaint):
    with pytest.raises(InputError, match=r"c\.yaml:2") as error:
        base(campaign(f"scene: paper\nknowledge: {given}\n"))
    assert complaint in str(error.value)
