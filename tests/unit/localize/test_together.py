"""A stereo pair's frames of one instant, cast ray by ray with scene's geometry only."""

import math
from functools import lru_cache

import numpy as np
import pytest
from photographs import NOISE, photograph

from conespot.localize import Knowns, Localization, locate
from conespot.localize.model.prior import rcm_miss
from conespot.localize.together import CONTRADICT, locate_together
from conespot.scene import Camera, InputError, Pose, Scene
from conespot.scene.beam import HardBeam
from conespot.scene.sensor import Linear

PAIR = {
    name: Camera(resolution=500, height=180.0, focal_length=490.0, tilt=math.radians(3.7), azimuth=azimuth)
    for name, azimuth in (("left", math.pi), ("right", 0.0))
}
SCENE = Scene(beam=HardBeam(), cameras=PAIR, camera=PAIR["left"], sensor=Linear(bits=12))
TIPS = [np.array([math.cos(t), math.sin(t), 3.5 + 0.2 * t]) for t in range(5)]


@lru_cache
def instant(number):
    pose = SCENE.pose(TIPS[number])
    return {name: photograph(SCENE.through(name), pose, seed=10 * number + i) for i, name in enumerate(PAIR)}


def chi2(found, tip):
    off = found.apex_mm - tip
    return float(off @ np.linalg.solve(found.covariance[:3, :3], off))


def test_an_rcm_told_to_both_cameras_counts_once():
    """Held exactly it must stay on the axis, yet add nothing where the frames alone say more than it does."""
    tied = [locate_together(instant(0), SCENE, noise=NOISE, knowns=Knowns(rcm_sigma_mm=s)) for s in (0.0, 0.3, None)]
    assert np.linalg.norm(rcm_miss(Pose(tied[0].apex_mm, tied[0].axis), SCENE)) < 1e-5
    np.testing.assert_allclose(tied[1].covariance, tied[2].covariance, rtol=2e-2)


def test_joint_answers_lie_within_their_own_sigmas_and_nearer_than_one_cameras():
    both = [locate_together(instant(i), SCENE, noise=NOISE) for i in range(len(TIPS))]
    left = [locate(instant(i)["left"], SCENE.through("left"), "photometric", noise=NOISE) for i in range(len(TIPS))]
    assert sum(chi2(found, tip) for found, tip in zip(both, TIPS, strict=True)) < 37.7  # 99.9 % of chi2 of 15 degrees
    miss = [
        np.sqrt(np.mean([np.sum((f.apex_mm - t) ** 2) for f, t in zip(many, TIPS, strict=True)]))
        for many in (both, left)
    ]
    assert miss[0] < miss[1]


def test_cameras_of_which_one_has_moved_are_refused():
    moved = SCENE.model_copy(
        update={"cameras": PAIR | {"right": PAIR["right"].model_copy(update={"look_at": (0.01, 0.0, 0.0)})}}
    )
    assert locate_together(instant(0), moved, noise=NOISE).reason == CONTRADICT


def test_a_camera_that_sees_nothing_takes_no_part():
    dark = instant(0) | {"right": np.zeros_like(instant(0)["right"])}
    found = locate_together(dark, SCENE, noise=NOISE)
    assert isinstance(found, Localization)
    np.testing.assert_array_equal(
        found.apex_mm, locate(dark["left"], SCENE.through("left"), "photometric", noise=NOISE).apex_mm
    )


@pytest.mark.parametrize(
    ("images", "more", "said"),
    [
        (["left", "top"], {}, "no camera 'top'; its cameras: left, right"),
        (["left"], {"localizer": "paper"}, "states no covariance"),
        (["left"], {"knowns": Knowns(half_angle_sigma_deg=0.1)}, "half_angle would be another one for each camera"),
    ],
)
def test_what_cannot_be_located_together_is_refused_in_a_sentence(images, more, said):
    with pytest.raises(InputError, match=said):
        locate_together({name: instant(0)["left"] for name in images}, SCENE, **more)
