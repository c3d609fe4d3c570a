"""An overlay: a panel for whatever was seen, the same bytes from the same arrays."""

import cv2
import numpy as np
import pytest

from conespot.results.overlay import Mark, Overlay, Residual
from conespot.results.overlay_picture import draw_overlay

ANGLE = np.linspace(0.0, 2.0 * np.pi, 50)
CIRCLE = 40.0 + 12.0 * np.column_stack([np.cos(ANGLE), np.sin(ANGLE)])
IMAGE = np.full((100, 80), 40, np.uint8)


def drawn(tmp_path, overlay, name="o"):
    path = draw_overlay(overlay, "title", "caption", tmp_path / f"{name}.png")
    return path.read_bytes(), cv2.imread(str(path))


def test_there_is_a_panel_for_everything_that_was_seen(tmp_path):
    mask = IMAGE > 50
    residual = Residual(30, 30, 2, np.random.default_rng(1).normal(size=(10, 10)))
    overlays = [
        Overlay(IMAGE, 255, {"true": [CIRCLE]}),
        Overlay(IMAGE, 255, {"true": [CIRCLE], "fitted": [CIRCLE + 1]}, mask, [residual]),
    ]
    widths = [drawn(tmp_path, overlay)[1].shape[1] for overlay in overlays]
    assert widths == [pytest.approx(n * widths[0] / 2, rel=0.01) for n in (2, 4)]


def test_a_frame_in_which_nothing_was_seen_stands_alone_and_a_point_above_all_lines(tmp_path):
    def coloured(overlay, colour):
        return (np.abs(drawn(tmp_path, overlay)[1].astype(int) - colour) < 12).all(axis=-1)

    def panels(overlay):
        areas = cv2.connectedComponentsWithStats(coloured(overlay, [40, 40, 40]).astype(np.uint8))[2][1:, 4]
        return int(np.count_nonzero(areas > 5000))

    white, lines = 255, {"fitted": [CIRCLE, np.full((9, 2), 40.0) + np.linspace(-9, 9, 9)[:, None]]}
    tip = Mark("tip", np.array([[40.0, 40.0]]), "failed", "point")
    assert panels(Overlay(IMAGE, white)) == 1
    assert panels(Overlay(IMAGE, white, {"fitted": [CIRCLE]})) >= 2
    red = [0x11, 0x33, 0xCC]
    assert coloured(Overlay(IMAGE, white, lines, marks=[tip, Mark("needle", CIRCLE[:9], "single")]), red).sum() > 30


def test_a_line_is_drawn_in_its_colour_and_only_where_there_is_one(tmp_path):
    def orange(image):  # "found"
        return int(np.sum((np.abs(image.astype(int) - [0x00, 0x9F, 0xE6]) < 12).all(axis=-1)))

    assert orange(drawn(tmp_path, Overlay(IMAGE, 255, {"found": [CIRCLE]}))[1]) > 200
    assert orange(drawn(tmp_path, Overlay(IMAGE, 255, {"fitted": [CIRCLE], "true": [CIRCLE - 45.0]}))[1]) == 0


@pytest.mark.parametrize("image", [np.zeros((100, 80, 3), np.uint16), np.zeros((3, 2), float)])
def test_a_frame_in_which_nothing_was_seen_can_be_drawn_the_same_each_time(tmp_path, image):
    first, second = (drawn(tmp_path, Overlay(image, 1.0, {"found": [CIRCLE[:0]]}), name)[0] for name in "ab")
    assert first == second
