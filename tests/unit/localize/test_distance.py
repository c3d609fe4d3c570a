"""localize.distance: the distance from the wall holds with its sigma, and an alarm says safe only where it may."""

import numpy as np
import pytest

from conespot.localize.distance import Alarm, distance_of, with_distance
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.knowns import Knowns
from conespot.localize.outcome import Distance, Localization, LocalizationFailure
from conespot.scene import InputError, Pose, Scene
from conespot.scene.beam import HardBeam
from conespot.scene.wall import Wall

SCENE = Scene()
POSE = Pose.through([0.9, 0.2, 0.55], SCENE.instrument.rcm)
#: of a pose, and of the eye's radius behind it, which the tip's height follows
MIXED = np.diag([2e-3, 3e-3, 6e-3, 1e-3, 1e-3, 2e-2]) @ np.array(
    [
        [1.0, 0.2, 0.0, 0.1, 0.0, 0.0],
        [0.2, 1.0, 0.1, 0.0, 0.0, 0.1],
        [0.0, 0.1, 1.0, 0.0, 0.2, 0.8],
        [0.1, 0.0, 0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 0.2, 0.0, 1.0, 0.1],
        [0.0, 0.1, 0.8, 0.0, 0.1, 1.0],
    ]
)
JOINT = MIXED @ np.diag([2e-3, 3e-3, 6e-3, 1e-3, 1e-3, 2e-2])
FREE_RADIUS = Knowns(eye_radius_sigma_mm=0.02)


def test_the_sigmas_are_those_of_drawn_poses_and_radii_together():
    from conespot.localize.model.forward import moved

    found = distance_of(Estimate(POSE, SCENE), JOINT, FREE_RADIUS, joint=True)
    drawn = np.random.default_rng(3).multivariate_normal(np.zeros(6), JOINT, 1500)
    distances = []
    for off in drawn:
        eye = SCENE.eye.model_copy(update={"radius": SCENE.eye.radius + off[5]})
        pose = moved(POSE, off[:5])
        distances.append(Wall.about(SCENE.model_copy(update={"eye": eye}), pose.apex, pose.axis).distances)
    along, nearest = np.std(distances, axis=0)
    assert found.sigma_along_mm == pytest.approx(along, rel=0.08)
    assert found.sigma_nearest_mm == pytest.approx(nearest, rel=0.08)


def test_what_nobody_measured_of_the_wall_is_in_the_sigma():
    sure = distance_of(Estimate(POSE, SCENE), JOINT[:5, :5], Knowns(), joint=True)
    unsure = distance_of(Estimate(POSE, SCENE), JOINT[:5, :5], Knowns(relief_sigma_mm=0.05), joint=True)
    assert unsure.nearest_mm == sure.nearest_mm
    assert unsure.sigma_nearest_mm == pytest.approx(np.hypot(sure.sigma_nearest_mm, 0.05))


def test_an_answer_without_a_covariance_knows_its_distance_and_no_sigma():
    found = with_distance(Localization(POSE.apex, POSE.axis), SCENE, Knowns())
    assert found.distance.nearest_mm == pytest.approx(Wall.about(SCENE, POSE.apex, POSE.axis).distances[1])
    assert found.distance.sigma_nearest_mm is None
    failure = LocalizationFailure("nothing")
    assert with_distance(failure, SCENE, Knowns()) is failure


def safe(nearest, sigma, alarm=Alarm(0.1, 1e-3)):  # noqa: B008  frozen
    distance = Distance(nearest, nearest, sigma, sigma)
    return alarm.safe(Localization(POSE.apex, POSE.axis, distance=distance))


def test_safe_is_what_a_one_sided_bound_of_that_chance_leaves_above_the_alarm():
    assert safe(0.1 + 3.10 * 0.01, 0.01)  # 3.09 sigmas leave a thousandth
    assert not safe(0.1 + 3.08 * 0.01, 0.01)
    assert safe(0.1 + 1.65 * 0.01, 0.01, Alarm(0.1, 0.05))


def test_a_refused_frame_and_an_answer_without_a_sigma_are_not_safe():
    alarm = Alarm(0.1)
    assert not alarm.safe(LocalizationFailure("nothing found"))
    assert not alarm.safe(Localization(POSE.apex, POSE.axis))
    assert not safe(5.0, None)


def test_a_source_that_is_no_point_may_pass_for_one_farther_away_and_an_alarm_counts_on_it():
    """A core of 0.1 mm in a cone of 9 deg: by 0.05 mm over its tangent, which a clipped patch in `theatre` showed."""
    wide = SCENE.model_copy(update={"beam": HardBeam(source_diameter=0.1)})
    found = distance_of(Estimate(POSE, wide), JOINT[:5, :5], Knowns(), joint=True)
    assert found.source_mm == pytest.approx(0.05 / np.tan(np.radians(9.0)))
    assert found.beyond(3.0) == pytest.approx(found.nearest_mm - 3.0 * found.sigma_nearest_mm - found.source_mm)
    assert Alarm(0.1).safe(Localization(POSE.apex, POSE.axis, distance=Distance(0.44, 0.44, 0.01, 0.01)))
    assert not Alarm(0.1).safe(Localization(POSE.apex, POSE.axis, distance=Distance(0.44, 0.44, 0.01, 0.01, 0.3157)))


def test_a_chance_that_is_none_is_refused():
    with pytest.raises(InputError, match="between 0 and 0.5"):
        Alarm(0.1, 0.7)
