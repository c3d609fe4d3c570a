import cv2
import numpy as np
import pytest

from conespot.localize.outcome import CUT_BY_BORDER, FEWER_PATCHES, NOTHING_FOUND
from conespot.localize.published import detection
from conespot.localize.published.detection import Mask


def disc(side, *circles):
    y, x = np.mgrid[:side, :side] + 0.5
    inside = [np.hypot(x - cx, y - cy) <= radius for cx, cy, radius in circles]
    return np.any(inside, axis=0).astype(np.uint8)


def outlines(frame, count):
    return detection.outlines(Mask.above(frame, 0), count)


def test_otsu_parts_two_levels_whatever_they_are():
    patch = disc(200, (90.0, 110.0, 40.0))
    for low, high in ((3, 20), (37, 255), (120, 160)):
        mask = detection.otsu_mask(np.where(patch > 0, high, low).astype(np.uint8))
        inside = patch[mask.top :, mask.left :][: mask.bright.shape[0], : mask.bright.shape[1]]
        assert np.count_nonzero(mask.bright != inside) + patch.sum() - inside.sum() < 0.02 * patch.sum()


def test_an_outline_is_centred_on_its_disc_and_half_a_pixel_inside():
    for x, y, radius in ((100.0, 80.0, 60.0), (101.3, 79.6, 47.2)):
        (outline,) = outlines(disc(200, (x, y, radius)), 1)
        circle = cv2.minEnclosingCircle((outline + 0.5).astype(np.float32))
        assert circle[0] == pytest.approx((x, y), abs=0.4)
        distance = np.hypot(*(outline + 0.5 - [x, y]).T)
        assert distance.max() <= radius
        assert radius - distance.mean() == pytest.approx(0.45, abs=0.25)


def test_outlines_are_those_of_the_largest_patches():
    mask = disc(300, (60, 60, 30), (200, 60, 34), (60, 200, 38), (200, 200, 26))
    centres = [o.mean(axis=0) + 0.5 for o in outlines(mask, 3)]
    np.testing.assert_allclose(centres, [(60, 200), (200, 60), (60, 60)], atol=0.6)


def test_specks_are_nothing():
    mask = np.zeros((100, 100), np.uint8)
    mask[50, 50] = mask[20:22, 20:22] = 1
    mask[70, 10:60] = 1
    assert outlines(mask, 1).reason == NOTHING_FOUND
    assert outlines(np.zeros((100, 100), np.uint8), 1).reason == NOTHING_FOUND


def test_a_blob_far_smaller_than_the_others_is_no_spotlight():
    mask = disc(300, (60, 60, 40), (200, 60, 40), (60, 200, 8))
    assert outlines(mask, 3).reason == FEWER_PATCHES
    assert len(outlines(mask, 2)) == 2


@pytest.mark.parametrize("centre", [(0, 50), (99, 50), (50, 0), (50, 99), (18.4, 50)])
def test_a_patch_cut_by_the_border_is_refused(centre):
    assert outlines(disc(100, (*centre, 20)), 1).reason == CUT_BY_BORDER


def test_a_patch_one_pixel_off_the_border_is_whole():
    assert len(outlines(disc(100, (21.0, 50.0, 20.0)), 1)) == 1


def test_a_cut_patch_that_is_not_among_the_largest_does_no_harm():
    assert len(outlines(disc(100, (50, 50, 20), (0, 0, 10)), 1)) == 1
