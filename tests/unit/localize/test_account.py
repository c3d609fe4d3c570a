"""What a localizer saw: the mask and outlines of the published methods, and what an answer predicts of the light."""

import numpy as np
import pytest

from conespot.localize import locate
from conespot.localize.account import account

TIP = np.array([0.4, 1.3, 5.0])


@pytest.fixture(scope="module")
def seen(frames):
    scene = frames.make_scene(resolution=500)
    pose = scene.pose(TIP)
    image = frames.frame(scene, pose)
    outline = scene.camera.project(scene.outline(pose, 0, points=720))
    return scene, image, outline


def off(points, outline):
    """How far points are from an outline [px]."""
    return np.linalg.norm(points[:, None] - outline[None], axis=-1).min(axis=1)


@pytest.mark.parametrize("name", ["paper", "paper-code", "paper-code-float"])
def test_of_a_method_with_a_threshold_mask_outline_and_ellipse_lie_where_the_patch_is(seen, name):
    scene, image, outline = seen
    saw = account(image, scene, name, locate(image, scene, name))
    middle = outline.mean(axis=0)
    column, row = middle.astype(int)
    assert saw.mask.shape == image.shape
    assert saw.mask[row, column]
    assert saw.mask.sum() == pytest.approx(np.pi * np.prod(np.ptp(outline, axis=0)) / 4.0, rel=0.15)
    (found,), (fitted,) = saw.found, saw.fitted
    # the soft edge is cut short by a few pixels, by the outline and by what is fitted to it alike
    assert off(found, outline).max() < 6.0
    assert np.median(off(found, fitted)) < 0.6


def test_of_a_fit_the_outline_is_that_of_its_answer(seen):
    scene, image, outline = seen
    saw = account(image, scene, "cone", locate(image, scene, "cone"))
    assert saw.mask is None
    assert saw.found == ()
    assert off(saw.fitted[0], outline).max() < 0.5


def test_a_right_answer_leaves_little_light_over_and_a_wrong_one_leaves_its_edges(seen):
    scene, image, _ = seen
    answer = locate(image, scene, "cone")
    left = []
    for shift in (0.0, 0.3):
        moved = type(answer)(answer.apex_mm + [shift, 0.0, 0.0], answer.axis)
        (patch,) = account(image, scene, "cone", moved).patches
        assert patch.light.shape == patch.predicted.shape
        left.append(np.sqrt(np.mean((patch.light - patch.predicted) ** 2)))
    assert left[0] < 0.03
    assert left[1] > 3.0 * left[0]


def test_where_nothing_is_found_there_is_a_mask_at_most(frames):
    scene = frames.make_scene(resolution=500)
    dark = np.zeros(scene.camera.shape, np.uint8)
    for name in ("paper-code", "cone"):
        saw = account(dark, scene, name, locate(dark, scene, name))
        assert (saw.found, saw.fitted, saw.patches) == ((), (), ())
