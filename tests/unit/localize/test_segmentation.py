"""Masks and outlines are, to the byte, those of filters run over the whole frame, whatever frames came before."""

import threading
from fractions import Fraction

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from conespot.localize.outcome import LocalizationFailure
from conespot.localize.published.detection import Mask, coded_mask, contrast, otsu_mask, otsu_threshold, outlines
from conespot.localize.published.settings import PUBLISHED
from conespot.scene import load_scene


def whole_otsu(grey):
    """The paper's text on all of a frame `[H, W]`: 0 and 1."""
    return cv2.threshold(smoothed(grey), 0, 1, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[1]


def smoothed(grey):
    return cv2.medianBlur(cv2.GaussianBlur(grey, (9, 9), 0), 5)


def between_classes(values, bright):
    """Otsu's variance between `values` that are bright and that are not, times the square of their number: exact."""
    dark, light = (values[bright == k].astype(int) for k in (0, 1))
    return Fraction(int(dark.sum() * light.size - light.sum() * dark.size) ** 2, dark.size * light.size)


def whole_coded(grey):
    """The authors' code on all of a frame `[H, W]`: 0 and 1."""
    return cv2.threshold(cv2.medianBlur(grey, 9), 50, 1, cv2.THRESH_BINARY)[1]


def whole_outlines(mask, count):
    """The `count` largest outlines in all of a mask `[H, W]`, or None."""
    found, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    blobs = sorted(((cv2.contourArea(c), c[:, 0]) for c in found if len(c) >= 6), key=lambda blob: -blob[0])
    largest = [c for area, c in blobs[:count] if area > 0.0 and area >= 0.1 * blobs[0][0]]
    last = np.array(mask.shape[::-1]) - 1
    cut = any(c.min() == 0 or np.any(c == last) for c in largest)
    return None if cut or len(largest) < count else largest


def agree(grey):
    for ours, theirs in ((otsu_mask, whole_otsu), (coded_mask, whole_coded)):
        mask, expected = ours(grey), theirs(grey)
        frame = np.zeros_like(expected)
        height, width = mask.bright.shape
        frame[mask.top : mask.top + height, mask.left : mask.left + width] = mask.bright
        if ours is otsu_mask and np.any(frame != expected):
            smooth = smoothed(grey)  # a last bit decided
            assert between_classes(smooth, frame) == between_classes(smooth, expected)
            continue
        np.testing.assert_array_equal(frame, expected)
        for count in (1, 3):
            found, right = outlines(mask, count), whole_outlines(expected, count)
            if right is None:
                assert isinstance(found, LocalizationFailure)
                continue
            assert len(found) == len(right)
            for a, b in zip(found, right, strict=True):
                np.testing.assert_array_equal(a, b)


SIDE = 240
Y, X = np.mgrid[:SIDE, :SIDE]
RNG = np.random.default_rng(5)


def disc(x, y, radius, *, soft=3.0):
    return 1.0 / (1.0 + np.exp(np.clip((np.hypot(X - x, Y - y) - radius) / soft, -50.0, 50.0)))


def frame(light):
    return np.clip(np.round(light), 0, 255).astype(np.uint8)


GROUND = 30.0 + 10.0 * np.sin(X / 17.0) * np.cos(Y / 23.0)
SPECK = np.zeros((SIDE, SIDE))
SPECK[100, 130] = 255.0
SALT = np.where(RNG.random((SIDE, SIDE)) < 0.05, 255.0, 0.0)
FRAMES = {
    "dark": np.zeros((SIDE, SIDE)),
    "at the threshold": np.full((SIDE, SIDE), 50.0),
    "over the threshold": np.full((SIDE, SIDE), 51.0),
    "white": np.full((SIDE, SIDE), 255.0),
    "one patch": GROUND + 200.0 * disc(90, 130, 40),
    "the patch elsewhere": GROUND + 200.0 * disc(150, 60, 40),
    "three patches": GROUND + 200.0 * (disc(60, 60, 25) + disc(170, 70, 25) + disc(110, 170, 24)),
    "patches that touch": GROUND + 200.0 * (disc(100, 60, 25) + disc(149, 70, 25)),
    "no ground": 255.0 * disc(90, 130, 40, soft=0.1),
    "patch over the left border": GROUND + 200.0 * disc(5, 120, 30),
    "patch in the corner": GROUND + 200.0 * disc(SIDE, SIDE, 30),
    "bright rim": np.where((X < 3) | (X >= SIDE - 3) | (Y < 3) | (Y >= SIDE - 3), 255.0, 0.0),
    "one column": np.where(X == 0, 255.0, 0.0),
    "a pixel": SPECK,
    "three pixels by three": cv2.dilate(SPECK, np.ones((3, 3))),
    "salt": SALT,
    "salt on a patch": np.maximum(GROUND + 200.0 * disc(90, 130, 40), SALT),
    "pepper on a patch": (GROUND + 200.0 * disc(90, 130, 40)) * (SALT == 0.0),
    "noise": RNG.uniform(0, 255, (SIDE, SIDE)),
    "noise at the threshold": RNG.normal(50, 4, (SIDE, SIDE)),
    "noise on a patch": GROUND + 200.0 * disc(90, 130, 40) + RNG.normal(0, 6, (SIDE, SIDE)),
    "gradient": X * 255.0 / SIDE,
    "slope from dark to the threshold": 20.0 + (X + Y) * 40.0 / SIDE,
    "checkered": 255.0 * ((X + Y) % 2),
    "rings": 255.0 * (np.hypot(X - 120, Y - 120) % 40 < 12),
    "bright ground": 255.0 - GROUND - 100.0 * disc(90, 130, 40),
}


@pytest.mark.parametrize("name", FRAMES)
def test_a_frame_is_segmented_as_a_whole(name):
    agree(frame(FRAMES[name]))


def test_a_frame_is_segmented_the_same_after_any_other():
    frames = {name: frame(light) for name, light in FRAMES.items()}
    for before in frames.values():
        for now in (frames["one patch"], frames["patch in the corner"], frames["noise"], frames["dark"]):
            for grey in (before, before, now, now):
                agree(grey)


def test_a_frame_that_changes_in_place_is_seen_anew():
    grey = frame(FRAMES["one patch"])
    for _ in range(3):
        agree(grey)
    grey[20:60, 150:190] = 255
    agree(grey)
    grey[20:60, 150:190] = 0
    agree(grey)


def test_threads_do_not_see_each_others_frames():
    failures = []

    def work(name):
        try:
            for power in (1.0, 0.9, 0.8, 0.7):
                agree(frame(power * FRAMES[name]))
        except AssertionError as error:
            failures.append(error)

    threads = [threading.Thread(target=work, args=(name,)) for name in ("one patch", "three patches", "salt")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures


@st.composite
def sequences(draw):
    """Frames of one size: a ground, noisy or not, under patches that move from one frame to the next."""
    height, width = draw(st.integers(1, 150)), draw(st.integers(1, 150))
    rng = np.random.default_rng(draw(st.integers(0, 2**16)))
    ground = rng.normal(draw(st.integers(0, 120)), draw(st.sampled_from([0, 1, 5, 40])), (height, width))
    y, x = np.mgrid[:height, :width]
    frames = []
    for _ in range(draw(st.integers(1, 4))):
        light = ground.copy()
        for _ in range(draw(st.integers(0, 3))):
            cx, cy, radius = draw(st.integers(0, width)), draw(st.integers(0, height)), draw(st.integers(0, 40))
            light += draw(st.integers(-60, 255)) * (np.hypot(x - cx, y - cy) <= radius)
        frames.append(frame(light + rng.normal(0, draw(st.sampled_from([0, 0, 0, 3])), light.shape)))
    return frames


@settings(max_examples=150, deadline=None)
@given(sequences())
def test_any_sequence_of_frames_is_segmented_as_whole_frames(frames):
    for grey in frames:
        agree(grey)


@settings(max_examples=300, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 255), st.integers(1, 400)), min_size=1, max_size=12))
@example([(97, 1), (111, 18), (125, 1)])
def test_otsus_threshold_is_opencvs_on_every_histogram_but_where_two_part_it_equally_well(levels):
    pixels = np.concatenate([np.full(count, level, np.uint8) for level, count in levels])
    ours = otsu_threshold(np.bincount(pixels, minlength=256))
    theirs, _ = cv2.threshold(pixels[None], 0, 1, cv2.THRESH_OTSU)
    assert ours == theirs or between_classes(pixels, pixels > ours) == between_classes(pixels, pixels > theirs)


@pytest.mark.parametrize("bright", [1, 2, 40])
def test_a_few_pixels_of_millions_are_a_class_as_far_as_opencv_counts_them(bright):
    grey = np.full((3000, 3000), 7, np.uint8)
    grey[1000, 1000 : 1000 + bright] = 200
    counts = np.bincount(grey.ravel(), minlength=256)
    assert otsu_threshold(counts) == cv2.threshold(grey, 0, 1, cv2.THRESH_OTSU)[0]


def test_contrast_is_that_of_every_so_many_rows_and_columns_of_the_whole_frame():
    rng, scene = np.random.default_rng(9), load_scene("paper-code")
    for height, width in ((700, 1100), (40, 1300), (260, 90)):
        grey = rng.integers(0, 256, (height, width)).astype(np.uint8)
        top, left = int(rng.integers(0, height // 2)), int(rng.integers(0, width // 2))
        mask = Mask(rng.integers(0, 2, (height // 3, width // 3)).astype(np.uint8), left, top, (height, width))
        lit = np.zeros(grey.shape, bool)
        lit[top : top + height // 3, left : left + width // 3] = mask.bright == 1
        step = max(1, max(grey.shape) // PUBLISHED.contrast_px)
        around = grey[::step, ::step][~lit[::step, ::step]].mean()
        inside, ground = scene.sensor.decode(np.array([grey[lit].mean(), around]) / 255.0)
        assert contrast(grey, mask, scene) == pytest.approx(inside / ground, rel=1e-12)
