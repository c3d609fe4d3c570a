import subprocess
import sys

import numpy as np
import pytest

from conespot.localize import LOCALIZERS, Localization, LocalizationFailure, locate
from conespot.localize.outcome import CUT_BY_BORDER, FEWER_PATCHES, NEAR_CIRCLE, NO_INTERSECTION, NOTHING_FOUND, OUTSIDE
from conespot.scene import Eye, InputError
from conespot.scene.sensor import Linear
from conespot.scene.spotlights import Instrument

PUBLISHED = ["paper", "paper-code", "paper-code-float"]
TIP = np.array([-1.5, 1.0, 6.0])


@pytest.fixture(scope="module")
def scene(frames):
    return frames.make_scene()


@pytest.fixture(scope="module")
def image(frames, scene):
    return frames.frame(scene, scene.pose(TIP))


@pytest.mark.parametrize("name", PUBLISHED)
def test_a_localization_is_true_and_has_apex_and_unit_axis(image, scene, name):
    found = locate(image, scene, name)
    assert found
    assert isinstance(found, Localization)
    assert found.apex_mm.shape == found.axis.shape == (3,)
    np.testing.assert_allclose(found.apex_mm, TIP, atol=0.4)
    assert np.linalg.norm(found.axis) == pytest.approx(1.0, abs=1e-12)
    assert found.covariance is None
    assert found.spread_mm is None


def test_the_default_is_the_papers_text(image, scene):
    np.testing.assert_array_equal(locate(image, scene).apex_mm, locate(image, scene, "paper").apex_mm)


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_axis_is_that_of_the_line_from_the_rcm_to_the_apex(image, scene, name):
    found = locate(image, scene, name)
    line = found.apex_mm - scene.instrument.rcm
    np.testing.assert_allclose(found.axis, line / np.linalg.norm(line), atol=1e-12)


def test_every_way_to_write_the_same_picture_gives_the_same_answer(frames, image, scene):
    expected = locate(image, scene, "paper-code").apex_mm
    twelve_bit = frames.make_scene(sensor=Linear(bits=12))
    forms = [
        (np.dstack([image] * 3), scene),
        (image / 255.0, scene),
        ((image / 255.0).astype(np.float32), scene),
        (np.dstack([image / 255.0] * 3), scene),
        (np.asfortranarray(image), scene),
        (image.astype(np.uint16), scene),
        (np.round(image / 255.0 * 4095).astype(np.uint16), twelve_bit),
        (image, twelve_bit),
    ]
    for other, its_scene in forms:
        np.testing.assert_array_equal(locate(other, its_scene, "paper-code").apex_mm, expected)


def test_colours_come_as_red_green_blue(scene, image):
    red = np.zeros((*image.shape, 3), np.uint8)
    red[..., 0] = np.where(image > 120, 255, 0)
    assert locate(red, scene, "paper-code")  # 0.299 x 255 = 76 is above 50
    assert not locate(red[..., ::-1], scene, "paper-code")  # 0.114 x 255 = 29 is not


def test_a_sensor_of_few_bits_is_read_at_its_full_scale(frames, scene, image):
    four_bit = frames.make_scene(sensor=Linear(bits=4))
    few = np.round(image / 255.0 * 15).astype(np.uint8)
    assert locate(few, four_bit, "paper-code")


def test_the_image_is_left_as_it_was(image, scene):
    before = image.copy()
    for name in PUBLISHED:
        locate(image, scene, name)
    np.testing.assert_array_equal(image, before)


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        (np.zeros((1000, 1000, 4), np.uint8), r"shape \(1000, 1000, 4\) is neither"),
        (np.zeros(1000, np.uint8), "is neither"),
        (np.zeros((500, 500), np.uint8), "500 x 500 px do not fit scene.camera.resolution = 1000 px"),
        (np.zeros((1000, 999), np.uint8), "999 x 1000 px do not fit"),
        (np.zeros((0, 0), np.uint8), "do not fit"),
        (np.zeros((1000, 1000), np.int64), "type int64 cannot be read"),
        (np.zeros((1000, 1000), bool), "type bool cannot be read"),
        (np.zeros((1000, 1000), complex), "cannot be read"),
        (np.full((1000, 1000), np.nan), "NaN or infinite"),
        (np.full((1000, 1000, 3), np.inf, np.float32), "NaN or infinite"),
        (None, "cannot be read"),
        ("frame.png", "cannot be read"),
    ],
)
def test_an_image_that_cannot_be_used_is_refused_in_a_sentence(scene, broken, said):
    with pytest.raises(InputError, match=said):
        locate(broken, scene)


def lit_to(white):
    """A frame of whole numbers with a clipped disc of `white`, over a ramp of multiples of 16."""
    y, x = np.mgrid[:1000, :1000]
    ramp = ((x + y) * 16).astype(np.uint16)
    ramp[np.hypot(x - 500, y - 500) < 80] = white
    return ramp


@pytest.mark.parametrize(
    ("bits", "white", "said"),
    [
        (12, 65520, "values up to 65520 do not fit scene.sensor, whose white is 4095"),
        (16, 65520, "all values are multiples of 16, so that white is 65520 .* write scene.sensor.bits: 12"),
        (16, 65535, None),
    ],
)
def test_values_that_are_not_the_sensors_are_refused_and_never_cut_off(frames, bits, white, said):
    scene = frames.make_scene(sensor=Linear(bits=bits))
    if said is None:
        assert locate(lit_to(white), scene, "paper") is not None
        return
    with pytest.raises(InputError, match=said):
        locate(lit_to(white), scene, "paper")


@pytest.mark.parametrize("name", ["paper", "photometric"])
def test_light_above_white_counts_as_white(frames, name):
    scene = frames.make_scene(sensor=Linear(bits=12))
    light = frames.frame(scene, scene.pose(TIP)).astype(float) / 4095.0
    light /= 0.5 * light.max()
    bright, clipped = (np.where(light > 1.0, white, light) for white in (700.0, 1.0))
    found, clipped = locate(bright, scene, name), locate(clipped, scene, name)
    assert found
    np.testing.assert_array_equal(found.apex_mm, clipped.apex_mm)


@pytest.mark.parametrize("name", PUBLISHED)
def test_no_published_method_answers_with_a_tip_outside_the_eye(scene, name):
    """A patch so wide that its cone would begin above the eye."""
    y, x = np.mgrid[:1000, :1000]
    wide = np.where(np.hypot((x - 500) / 420, (y - 500) / 390) < 1.0, 200, 0).astype(np.uint8)
    assert locate(wide, scene, name).reason == OUTSIDE


@pytest.mark.parametrize(
    ("name", "hint"), [("papr", "did you mean 'paper'"), ("xyz", "known: paper, "), (3, "known: ")]
)
def test_an_unknown_localizer_is_refused_with_the_nearest(image, scene, name, hint):
    with pytest.raises(InputError, match=f"unknown localizer '{name}'; {hint}"):
        locate(image, scene, name)


def test_only_an_oracle_is_told_the_truth_and_it_needs_it(image, scene):
    pose = scene.pose(TIP)
    with pytest.raises(InputError, match="give it as oracle="):
        locate(image, scene, "paper-code-oracle")
    for name in LOCALIZERS:
        if not name.endswith("-oracle"):
            with pytest.raises(InputError, match="must not see the true pose"):
                locate(image, scene, name, oracle=pose)


def test_nothing_is_found_in_an_empty_frame(scene):
    for name in PUBLISHED:
        for grey in (0, 37, 255):
            found = locate(np.full((1000, 1000), grey, np.uint8), scene, name)
            assert not found
            assert isinstance(found, LocalizationFailure)
            assert found.reason in (NOTHING_FOUND, CUT_BY_BORDER)
    assert locate(np.zeros((1000, 1000), np.uint8), scene, "paper-code").reason == NOTHING_FOUND


def test_one_patch_does_not_do_for_three_spotlights(frames, image):
    for name in PUBLISHED:
        assert locate(image, frames.make_scene(rig="triple"), name).reason == FEWER_PATCHES


def test_a_patch_that_leaves_the_frame_is_refused(frames, scene):
    tip = np.array([-3.6, 0.0, 6.0])
    for name in PUBLISHED:
        assert locate(frames.frame(scene, scene.pose(tip)), scene, name).reason == CUT_BY_BORDER
    outside = frames.frame(scene, scene.pose(np.array([-5.5, 0.0, 6.0])))
    assert locate(outside, scene, "paper-code").reason == NOTHING_FOUND


def test_a_patch_beside_the_eye_is_refused(frames, image):
    small = frames.make_scene(eye=Eye(radius=1.0))
    for name in PUBLISHED:
        assert locate(image, small, name).reason == NO_INTERSECTION


def test_a_round_patch_does_not_tell_where_one_cone_leans(frames):
    upright = frames.make_scene(instrument=Instrument(rcm=(0.0, 0.0, 22.0)))
    round_patch = frames.frame(upright, upright.pose(np.array([0.0, 0.0, 5.0])))
    for name in ("paper", "paper-code-float"):
        assert locate(round_patch, upright, name).reason == NEAR_CIRCLE


def test_it_works_where_mitsuba_is_not():
    code = (
        "import sys; sys.modules['mitsuba'] = sys.modules['drjit'] = None; "
        "import conespot.localize; assert 'conespot.render' not in sys.modules"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert set(LOCALIZERS) >= {*PUBLISHED, "paper-code-oracle"}
