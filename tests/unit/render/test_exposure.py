"""Frames that are looked at, and not kept."""

import numpy as np
import pytest

from conespot.render import Crop, Exposure, Tile
from conespot.render.exposure import encode
from conespot.scene import srgb
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


def test_looking_values_up_gives_what_working_them_out_gives():
    """Radiances from 2^-20 of white to white, and those around every step between values; to the byte."""
    levels = (np.arange(255) + 0.5) / 255.0
    steps = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4).astype(np.float32)
    around = (steps.view(np.uint32)[:, None] + np.arange(-200, 200).astype(np.uint32)).view(np.float32)
    spread = np.random.default_rng(1).uniform(-20.0, 1.0, 1_000_000)
    radiance = np.concatenate([around.ravel(), np.exp2(spread).astype(np.float32), np.float32([0.0, 1.0, 2.0, -1.0])])
    plain = np.floor(srgb.encoded(np.clip(radiance, 0.0, 1.0)) * 255 + 0.5).astype(np.uint8)
    np.testing.assert_array_equal(encode(radiance, Srgb8()), plain)
