"""Frames that are looked at, and not kept."""

import numpy as np
import pytest

from conespot.render import Crop, Exposure, Tile
from conespot.scene.sensor import SENSORS, Linear, Srgb8

POWERS = (0.05, 1.0, 0.3)


@pytest.fixture
def background():
    return np.random.default_rng(1).uniform(0.0, 0.2, (60, 50, 1)).astype(np.float32)


@pytest.fixture
def tiles():
    rng = np.random.default_rng(2)
    crops = (Crop(10, 5, 20, 30), Crop(25, 20, 20, 20), Crop(0, 0, 0, 0))
    return [Tile(c, rng.uniform(0.0, 3.0, (c.height, c.width, 1)).astype(np.float32)) for c in crops]


@pytest.mark.parametrize("sensor", [Srgb8(), Linear(bits=12), SENSORS["cmv12000-mono"]], ids=lambda s: s.kind)
def test_a_shown_frame_is_the_frame_to_the_byte(background, tiles, sensor):
    """`shown` at three powers, without tiles between them, against `frame` of another exposure."""
    exposure, other = Exposure(background, sensor), Exposure(background, sensor)
    for power in POWERS:
        for lit in (tiles, tiles[:1], []):
            with exposure.shown(lit, power, seed=3) as image:
                np.testing.assert_array_equal(image, other.frame(lit, power, seed=3))


def test_frames_shown_at_once_do_not_touch_each_other(background, tiles):
    """A frame within a frame, and the dark one, against those alone."""
    exposure = Exposure(background, Srgb8())
    alone = [exposure.frame(tiles, power) for power in POWERS]
    with exposure.shown(tiles, POWERS[0]) as first, exposure.shown(tiles, POWERS[1]) as second:
        np.testing.assert_array_equal(first, alone[0])
        np.testing.assert_array_equal(second, alone[1])
        np.testing.assert_array_equal(exposure.dark(tiles, POWERS[0]), Exposure(background, Srgb8()).frame((), 0.0))
    with exposure.shown(tiles, POWERS[2]) as third:
        np.testing.assert_array_equal(third, alone[2])


def test_what_fails_on_a_frame_leaves_no_light_behind(background, tiles):
    exposure = Exposure(background, Srgb8())
    with pytest.raises(ZeroDivisionError), exposure.shown(tiles, 1.0):
        raise ZeroDivisionError
    with exposure.shown((), 1.0) as image:
        np.testing.assert_array_equal(image, exposure.dark((), 1.0))


def test_a_shown_frame_cannot_be_written_to(background, tiles):
    exposure = Exposure(background, Srgb8())
    with exposure.shown(tiles, 1.0) as image, pytest.raises(ValueError, match="read-only"):
        image[0, 0] = 1
