"""scene.wall: the distances of a tip from the wall, and how they change."""

import numpy as np
import pytest
from scipy.optimize import minimize

from conespot.scene import Scene
from conespot.scene.pose import Pose, tangents
from conespot.scene.surface import Bump
from conespot.scene.wall import Wall

SHAPES = {
    "sphere": {},
    "ellipsoid": {"semi_axes": (1.05, 0.97, 1.1)},
    "bumps": {"bumps": tuple(Bump(x=x, y=0.3, height=0.1, profile="gaussian") for x in (-1.0, 0.4, 1.3))},
}
TIP = np.array([0.9, 0.2, 0.55])


def scene(shape, radius=12.0):
    return Scene.model_validate({"eye": {"radius": radius}, "surface": SHAPES[shape]})


def wall(shape="sphere", apex=TIP, axis=None, radius=12.0):
    made = scene(shape, radius)
    return Wall.about(made, apex, Pose.through(apex, made.instrument.rcm).axis if axis is None else axis)


@pytest.mark.parametrize("shape", SHAPES)
def test_the_nearest_point_is_as_near_as_any_that_an_optimizer_finds_from_many_starts(shape):
    made = scene(shape)

    def away(angles):
        x, y = angles
        direction = np.array([np.sin(x), np.sin(y), -1.0])
        direction /= np.linalg.norm(direction)
        return float(np.linalg.norm(made.surface.points(made.eye, direction) - TIP))

    starts = [(x, y) for x in (-0.05, 0.07, 0.2) for y in (-0.1, 0.01, 0.12)]
    best = min(minimize(away, at, method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-11}).fun for at in starts)
    assert wall(shape).distances[1] == pytest.approx(best, abs=1e-9)


def test_on_a_sphere_both_are_closed_forms():
    found = wall()
    centre = np.array([0.0, 0.0, 12.0])
    assert found.distances[1] == pytest.approx(12.0 - np.linalg.norm(TIP - centre), abs=1e-12)
    assert np.linalg.norm(TIP + found.distances[0] * found.axis - centre) == pytest.approx(12.0, abs=1e-9)


def test_a_tip_behind_the_wall_is_at_a_negative_distance():
    behind = wall(apex=np.array([0.0, 0.0, -0.2]))
    assert behind.distances[1] == pytest.approx(-0.2)
    assert behind.distances[0] < 0.0


def test_in_the_middle_of_an_eye_all_of_the_wall_is_as_near():
    assert wall(apex=np.array([0.0, 0.0, 12.0])).distances[1] == pytest.approx(12.0)


@pytest.mark.parametrize("shape", SHAPES)
def test_changes_with_the_pose_are_those_of_finite_differences(shape):
    here, step = wall(shape), 1e-5
    numeric = np.zeros((2, 5))
    for k in range(3):
        off = step * np.eye(3)[k]
        more, less = (wall(shape, TIP + s * off, here.axis).distances for s in (1.0, -1.0))
        numeric[:, k] = (more - less) / (2.0 * step)
    for k, tangent in enumerate(tangents(here.axis)):
        turned = [here.axis + s * step * tangent for s in (1.0, -1.0)]
        more, less = (wall(shape, TIP, axis / np.linalg.norm(axis)).distances for axis in turned)
        numeric[:, 3 + k] = (more - less) / (2.0 * step)
    np.testing.assert_allclose(here.by_pose(5), numeric, atol=2e-6)


@pytest.mark.parametrize("shape", SHAPES)
def test_changes_with_the_wall_are_those_of_another_wall(shape):
    here, step = wall(shape), 1e-4
    more, less = (wall(shape, TIP, here.axis, 12.0 + s * step).distances for s in (1.0, -1.0))
    changed = here.by_wall(scene(shape, 12.0 + step))
    np.testing.assert_allclose(changed / step, (more - less) / (2.0 * step), rtol=2e-3)


def test_a_raised_wall_is_nearer_by_as_much_and_along_a_slanting_axis_by_more():
    along, nearest = wall().by_relief()
    assert nearest == 1.0
    assert along > 1.0
