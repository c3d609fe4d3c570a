"""Recorded frames: the codes of a video recorder, and that a localizer reads the camera's light back from them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from conespot.localize.image import linear_light
from conespot.render.exposure import Exposure
from conespot.render.recording import recorded
from conespot.render.tile import Crop, Tile
from conespot.scene.jpeg import luminance_steps, rounding_error
from conespot.scene.sensor import EMVA_PRESETS, Linear, Recorded, Srgb8


@pytest.mark.parametrize("quality", [10, 50, 75, 90, 95, 100])
def test_steps_are_those_that_the_codec_writes(quality: int) -> None:
    """The quantization table in a file of OpenCV's libjpeg (zigzag) against T.81's, scaled."""
    _, file = cv2.imencode(".jpg", np.zeros((8, 8), np.uint8), [cv2.IMWRITE_JPEG_QUALITY, quality])
    data = file.tobytes()
    at = data.index(b"\xff\xdb") + 5
    order = sorted(((r, c) for r in range(8) for c in range(8)), key=lambda p: (sum(p), p[1 - sum(p) % 2]))
    written = np.zeros((8, 8), int)
    for (row, column), step in zip(order, data[at : at + 64], strict=True):
        written[row, column] = step
    np.testing.assert_array_equal(luminance_steps(quality), written)


def test_the_rounding_error_is_that_of_a_busy_image() -> None:
    busy = np.random.default_rng(3).normal(128.0, 40.0, (512, 512)).clip(0, 255).astype(np.uint8)
    _, file = cv2.imencode(".jpg", busy, [cv2.IMWRITE_JPEG_QUALITY, 80])
    back = cv2.imdecode(file, cv2.IMREAD_GRAYSCALE).astype(float)
    assert np.std(back - busy) == pytest.approx(rounding_error(80), rel=0.05)


@pytest.mark.parametrize("camera", [Srgb8(), Linear(bits=12), EMVA_PRESETS["cmv12000-mono"]])
@pytest.mark.parametrize("range_", ["full", "limited"])
def test_the_camera_s_light_is_read_back_from_the_codes(camera: Srgb8 | Linear, range_: str) -> None:
    """A smooth ramp through quality 100: the light within two codes, and what clips in the camera clips here."""
    recorder = Recorded(camera=camera, quality=100, range=range_)
    ramp = np.linspace(0.0, camera.full_scale, 512)
    values = np.tile(np.rint(ramp), (16, 1)).astype(np.uint8 if camera.full_scale == 255 else np.uint16)
    light, clipped = linear_light(recorded(values, recorder), recorder)
    truth, full = linear_light(values, camera)
    two_codes = 2.0 * 2.4 / 1.055 / recorder.codes  # one code moves white by so much, darker light by less
    assert np.max(np.abs(light - truth)) < two_codes
    assert clipped[full].all()
    assert not clipped[truth < 0.9].any()


def test_limited_range_has_black_at_16_and_white_at_235() -> None:
    recorder = Recorded(camera=Linear(bits=12), range="limited", quality=100)
    codes = recorded(np.repeat(np.array([[0, 4095]], np.uint16), 8, axis=0).repeat(8, axis=1), recorder)
    assert codes[:, :8].mean() == pytest.approx(16.0, abs=0.5)
    assert codes[:, 8:].mean() == pytest.approx(235.0, abs=0.5)
    assert recorder.black_level == 16.0


@pytest.mark.parametrize("chroma", ["4:2:0", "4:4:4"])
def test_colours_keep_their_order_and_chroma_its_resolution_where_it_says_so(chroma: str) -> None:
    image = np.zeros((32, 32, 3), np.uint8)
    image[:, :17, 0], image[:, 17:, 2] = 200, 200
    back = recorded(image, Recorded(camera=Srgb8(colour=True), quality=100, chroma=chroma)).astype(int)
    assert back[16, 4].tolist() == pytest.approx([200, 0, 0], abs=4)
    assert back[16, 28].tolist() == pytest.approx([0, 0, 200], abs=4)
    smeared = int(np.abs(back[16, 15:19] - image[16, 15:19].astype(int)).max())
    assert smeared > 30 if chroma == "4:2:0" else smeared < 10


def test_an_exposed_frame_goes_through_the_recorder_whole_and_stays_metered() -> None:
    background = np.full((64, 64, 1), 0.1, np.float32)
    tile = Tile(Crop(16, 16, 24, 24), np.full((24, 24, 1), 0.5, np.float32))
    camera = Linear(bits=12)
    plain = Exposure(background, camera)
    through = Exposure(background, Recorded(camera=camera, quality=85))
    expected = recorded(plain.frame([tile], 1.0), Recorded(camera=camera, quality=85))
    np.testing.assert_array_equal(through.frame([tile], 1.0), expected)
    with through.shown([tile], 1.0) as shown:
        np.testing.assert_array_equal(shown, expected)
    np.testing.assert_array_equal(through.dark([tile], 1.0), recorded(plain.dark([tile], 1.0), through.sensor))
    metered = Exposure(background * 1e-3, Recorded(camera=EMVA_PRESETS["cmv12000-mono"]))
    assert metered.meters_once
    timed = metered.metered([tile], 1.0)
    assert isinstance(timed, Recorded)
    assert timed.camera.exposure_time != EMVA_PRESETS["cmv12000-mono"].exposure_time
