"""Frames that are not what the scene says are refused with the reason, or read for what they are."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from photographs import AMBIENT, NOISE, PEAK, READ, WHITE, fundus, photograph, scene_of
from scipy.ndimage import gaussian_filter

from conespot.localize import locate
from conespot.localize.compression import compressed
from conespot.localize.decoding import decoded_amiss
from conespot.localize.doubt import noise_of
from conespot.localize.image import Frame
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.suspicion import WALL, scores
from conespot.localize.outcome import BELOW_BLACK, COMPRESSED, NO_LIGHT, OTHER_LIGHT, OUTSHONE, WRONG_NOISE
from conespot.localize.start.search import NOTHING, TWO_PLACES
from conespot.localize.verdict import VERDICT, WRONG_BEAM, WRONG_TRANSFER, WRONG_WALL
from conespot.scene import InputError, Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.camera import Camera
from conespot.scene.emva import EMVA_PRESETS
from conespot.scene.eye import Eye
from conespot.scene.population import SEMI_AXES_SIGMA_MM
from conespot.scene.sensor import Linear, Recorded, Srgb8
from conespot.scene.srgb import encoded
from conespot.scene.surface import Surface

SIDE = 400
HERE, THERE = (-1.5, -1.5, 3.0), (1.8, 1.6, 3.0)
ALL = slice(0, SIDE)


@pytest.fixture(scope="module")
def soft():
    scene = scene_of(CyclesBeam(), resolution=SIDE)
    return scene, photograph(scene, scene.pose(np.array(HERE)), rays=2)


@pytest.fixture(scope="module")
def clipped(frames):
    scene = frames.make_scene(resolution=SIDE, beam=CyclesBeam())
    return scene, frames.frame(scene, scene.pose(np.array(HERE)))


def around(scene):
    """Rows and columns of a patch and half its size beside."""
    points = scene.camera.project(scene.outline(scene.pose(np.array(HERE)), 0))
    wide = 0.5 * np.max(np.ptp(points, axis=0))
    low, high = (points.min(axis=0) - wide).astype(int), (points.max(axis=0) + wide).astype(int)
    return slice(low[1], high[1]), slice(low[0], high[0])


def off_um(found, tip=HERE):
    return 1e3 * float(np.linalg.norm(found.apex_mm - tip))


@pytest.mark.parametrize("quality", [95, 90, 75])
def test_a_frame_that_went_through_jpeg_is_refused_and_the_same_without_is_not(clipped, quality):
    scene, image = clipped
    pressed = cv2.imdecode(cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_GRAYSCALE)
    assert locate(image, scene, "photometric")
    assert locate(pressed, scene, "photometric").reason == COMPRESSED


@pytest.mark.parametrize("noise", [0.0, 1.0, 4.0])
def test_no_noise_looks_like_a_jpeg(clipped, noise):
    image = clipped[1] + noise * np.random.default_rng(1).standard_normal(clipped[1].shape)
    eight = np.clip(np.round(image), 0, 255).astype(np.uint8)
    assert not compressed(eight, ALL, ALL)
    assert not compressed(eight.astype(np.uint16), ALL, ALL)
    assert not compressed(eight, slice(3, 9), ALL)


@pytest.mark.parametrize("beam", [CyclesBeam(), HardBeam()])
def test_a_blur_that_nobody_told_of_is_fitted_or_refused_where_a_patch_is_clipped(beam):
    """A pixel of blur taken for none puts hard patches 220 um off at a stated 15, soft ones 110 um at a stated 18."""
    scene = scene_of(beam, resolution=SIDE)
    even = photograph(scene, scene.pose(np.array(HERE)), rays=6, noise=False) * (WHITE / 4095.0)
    noise = replace(NOISE, electrons=WHITE / 6.0)
    rng = np.random.default_rng(1)
    noisy = (rng.poisson(image) + READ * rng.standard_normal(image.shape) for image in (even, gaussian_filter(even, 1)))
    sharp, blurred = (np.clip(np.round(e * (6.0 / WHITE * 4095.0)), 0, 4095).astype(np.uint16) for e in noisy)
    found = locate(sharp, scene, "photometric", noise=noise)
    assert found, found.reason
    assert off_um(found) < 20.0
    seen = locate(blurred, scene, "photometric", noise=noise)
    if isinstance(beam, HardBeam):
        assert not seen
        assert seen.reason == WRONG_BEAM
    else:
        assert seen, seen.reason
        assert off_um(seen) < 3e3 * np.sqrt(np.trace(seen.covariance[:3, :3]))


@pytest.mark.parametrize("quality", [75, 90])
def test_a_clipped_patch_that_was_recorded_is_measured_within_its_sigmas(quality):
    """A JPEG darkens white beside an edge: what it left of a rim passed for seen, and tips were 80 um off."""
    scene = scene_of(HardBeam(), resolution=SIDE)
    even = photograph(scene, scene.pose(np.array(HERE)), noise=False) * (6.0 / 4095.0)
    recorder = Recorded(camera=Linear(bits=12), quality=quality, range="limited")
    codes = np.round(recorder.code(np.minimum(even, 1.0))).astype(np.uint8)
    pressed = cv2.imdecode(cv2.imencode(".jpg", codes, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], cv2.IMREAD_GRAYSCALE)
    found = locate(pressed, scene.model_copy(update={"sensor": recorder}), "photometric")
    assert found, found.reason
    assert off_um(found) < min(30.0, 3e3 * np.sqrt(np.trace(found.covariance[:3, :3])))


@pytest.mark.parametrize("beam", [CyclesBeam(), HardBeam()])
def test_two_instruments_are_refused_where_the_scene_has_one(beam):
    scene = scene_of(beam, resolution=SIDE)
    one, other = (photograph(scene, scene.pose(np.array(tip)), rays=2) for tip in (HERE, THERE))
    assert locate(one, scene, "photometric", noise=NOISE)
    assert locate(np.maximum(one, other), scene, "photometric", noise=NOISE).reason == TWO_PLACES


def test_a_patch_that_other_light_far_outshines_is_refused_and_one_beside_a_reflex_is_not():
    """Of a spotlight that the scene's beam does not explain, and a disc in ambient light that it does."""
    scene = scene_of(HardBeam(), resolution=SIDE)
    dim = 0.05 * WHITE / 4095.0 * photograph(scene, scene.pose(np.array(HERE)), noise=False)
    y, x = np.mgrid[:SIDE, :SIDE]
    other = 0.05 * PEAK * np.exp(-(np.square(x - 260.0) + np.square(y - 160.0)) / (2.0 * 14.0**2))
    for times, refused in ((2.0, False), (20.0, True)):
        electrons = dim + times * other
        noisy = np.random.default_rng(0).normal(electrons, np.sqrt(electrons + READ**2))
        image = np.round(noisy / WHITE * 4095.0).clip(0.0, 4095.0).astype(np.uint16)
        found = locate(image, scene, "photometric", noise=NOISE)
        assert found.reason == OUTSHONE if refused else off_um(found) < 10.0


def test_a_beam_or_a_wall_told_wrongly_is_refused_with_the_reason_and_the_right_one_is_not():
    scene = scene_of(HardBeam(), resolution=SIDE)
    image = photograph(scene, scene.pose(np.array(HERE)), fundus(0.2))
    soft = scene.model_copy(update={"beam": CyclesBeam(blend=0.2)})
    long = scene.model_copy(update={"surface": scene.surface.model_copy(update={"semi_axes": (1.0, 1.0, 1.08)})})
    assert locate(image, scene, "cone", noise=NOISE)
    assert locate(image, soft, "cone", noise=NOISE).reason == WRONG_BEAM
    assert locate(image, long, "cone", noise=NOISE).reason == WRONG_WALL


def test_three_spotlights_notice_that_the_retina_has_another_shape_and_keep_the_right_one():
    mean = scene_of(HardBeam(), "triple", resolution=300, eye=Eye(radius=10.311), surface=Surface(population="mean"))
    true = mean.model_copy(update={"surface": Surface(population=91)})
    image = photograph(true, true.pose(np.array((-0.5, 1.7, 4.2))), fundus(0.2), rays=8)
    assert locate(image, true, "cone", noise=NOISE)
    found = locate(image, mean, "cone", noise=NOISE)
    assert not found
    assert found.reason == WRONG_WALL
    free = locate(image, mean, "cone", noise=NOISE, knowns=Knowns(semi_axes_sigma_mm=SEMI_AXES_SIGMA_MM))
    assert free, free.reason


def test_a_wall_that_no_shape_of_the_population_explains_is_doubted_no_less():
    names = ["retina_width", "retina_height", "retina_length"]
    information = np.diag([1.0, 1e4, 1e4, 1e4])
    for off_mm, doubted in ((0.01, False), (0.5, True), (5.0, True)):
        gradient = information @ np.array([0.0, off_mm, 0.0, 0.0])
        found = scores(names, gradient, information, information, 1)[WALL]
        assert (found > VERDICT.suspicious_wall) == doubted


def test_a_sensor_of_few_bits_is_white_where_they_end_and_rounds_by_their_steps(soft):
    scene, image = soft
    four = scene.model_copy(update={"sensor": Linear(bits=5)})
    with pytest.raises(InputError, match="whose white is 31"):
        locate((image >> 4).astype(np.uint8), four)
    found = locate(np.round(image / 4095 * 31).astype(np.uint8), four, "photometric")
    assert off_um(found) < 6e3 * np.sqrt(np.trace(found.covariance[:3, :3]))
    eight = np.round(image / 4095 * 255).astype(np.uint8)
    assert [noise_of(Frame(each, scene.sensor), None).levels for each in (image, eight)] == [4095, 255]


@pytest.mark.parametrize("name", ["paper", "paper-code", "paper-code-float"])
def test_no_published_method_answers_on_a_frame_without_light(frames, name):
    scene = frames.make_scene(resolution=SIDE)
    dark = np.full((SIDE, SIDE), 47, np.uint8)
    cv2.ellipse(dark, (180, 140), (30, 26), 0.0, 0.0, 360.0, 55, -1)
    assert locate(dark, scene, name).reason == NO_LIGHT


def test_linear_values_that_are_told_to_have_gamma_are_refused_for_it():
    """Soft patches are not always: docs/localizers.md."""
    scene = scene_of(HardBeam(), resolution=SIDE)
    image = np.round(photograph(scene, scene.pose(np.array(HERE)), rays=6) / 4095.0 * 255.0).astype(np.uint8)
    found, told = (locate(image, scene.model_copy(update={"sensor": s}), "photometric") for s in (Linear(), Srgb8()))
    assert found, found.reason
    assert not told
    assert told.reason == WRONG_TRANSFER


@pytest.mark.parametrize("bits", [8, 12])
@pytest.mark.parametrize("beam", [CyclesBeam(), HardBeam()])
def test_noise_tells_values_with_gamma_that_are_told_to_be_linear_and_no_texture_passes_for_them(beam, bits):
    """Gamma puts hard patches 8 um off and soft ones 55, in no residual of a fit."""
    scene = scene_of(beam, resolution=SIDE)
    full, noise = 2**bits - 1, replace(NOISE, levels=2**bits - 1)
    told = scene.model_copy(update={"sensor": Linear(bits=bits)})
    for texture in (None, fundus(0.2)):
        light = photograph(scene, scene.pose(np.array(HERE)), texture, rays=4) / 4095.0
        linear, curved = (
            np.round(x * full).astype(np.uint8 if bits == 8 else np.uint16) for x in (light, encoded(light))
        )
        assert decoded_amiss(Frame(linear, told.sensor), noise, *around(scene)) is None
        assert decoded_amiss(Frame(curved, told.sensor), noise, *around(scene)) == WRONG_NOISE
        assert decoded_amiss(Frame(curved, Srgb8()), noise, *around(scene)) is None
    assert locate(linear, told, "photometric", noise=noise)
    found = locate(curved, told, "photometric", noise=noise)
    assert not found
    assert found.reason in (WRONG_NOISE, WRONG_TRANSFER)


@pytest.mark.parametrize("change", ["read noise twice as large", "smoothed", "median", "bilateral", "compressed"])
def test_no_smoothing_and_no_read_noise_looks_like_gamma(change):
    scene = scene_of(CyclesBeam(), resolution=SIDE)
    image = photograph(scene, scene.pose(np.array(HERE)), rays=2)
    match change:
        case "read noise twice as large":
            extra = np.sqrt(3.0) * READ / WHITE * 4095.0 * np.random.default_rng(2).standard_normal(image.shape)
            seen = np.clip(np.round(image + extra), 0, 4095)
        case "smoothed":
            seen = gaussian_filter(image.astype(float), 1.0)
        case "median":
            seen = cv2.medianBlur(image, 3)
        case "bilateral":
            seen = cv2.bilateralFilter(image.astype(np.float32), 5, 100.0, 2.0)
        case _:
            eight = np.round(image / 4095.0 * 255.0).astype(np.uint8)
            seen = cv2.imdecode(cv2.imencode(".jpg", eight)[1], cv2.IMREAD_GRAYSCALE) * (4095.0 / 255.0)
    assert decoded_amiss(Frame(seen.astype(np.uint16), scene.sensor), NOISE, *around(scene)) is None


def test_a_frame_darker_than_black_is_refused_and_says_where_black_is_told():
    """A pedestal that was taken off already, and a full range told as the limited one."""
    scene = scene_of(HardBeam(), resolution=SIDE)
    light = photograph(scene, scene.pose(np.array(HERE)), rays=4, noise=False) / 4095.0 * WHITE
    rng = np.random.default_rng(1)
    electrons = rng.poisson(np.maximum(light - AMBIENT, 0.0)) + READ * rng.standard_normal(light.shape)
    dark = electrons / WHITE * 4095.0
    camera = EMVA_PRESETS["cmv12000-mono"]
    right, without = (np.clip(np.round(dark + black), 0, 4095).astype(np.uint16) for black in (camera.black_level, 0.0))
    recorder = Recorded(camera=Linear())
    codes = np.round(recorder.code(np.clip(dark / 4095.0, 0.0, 1.0))).astype(np.uint8)
    for image, sensor, amiss in (
        (right, camera, None),
        (without, camera, BELOW_BLACK),
        (codes, recorder, None),
        (codes, recorder.model_copy(update={"range": "limited"}), BELOW_BLACK),
    ):
        assert decoded_amiss(Frame(image, sensor), sensor.noise, *around(scene)) == amiss
    told = scene.model_copy(update={"sensor": camera})
    assert locate(without, told, "photometric").reason == BELOW_BLACK


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("localizer", ["cone", "photometric"])
def test_a_patch_on_black_without_noise_and_a_black_reference_are_an_outcome_and_no_warning(localizer):
    scene = Scene(camera=Camera(resolution=200), sensor=Srgb8())
    y, x = np.mgrid[:200, :200]
    image = np.where(np.hypot(x - 90, y - 110) < 30, 127, 0).astype(np.uint8)
    for reference in (None, np.zeros_like(image)):
        found = locate(image, scene, localizer, reference=reference)
        assert found or found.reason


@pytest.mark.parametrize("localizer", ["cone", pytest.param("photometric", marks=pytest.mark.slow)])
def test_a_soft_patch_told_as_a_hard_one_is_said_to_be_no_hard_one(localizer):
    tip = (0.6, -0.4, 3.0)
    told, world = (scene_of(beam, resolution=SIDE) for beam in (HardBeam(), CyclesBeam()))
    image = photograph(world, world.pose(np.array(tip)), rays=2)
    assert locate(image, told, localizer).reason == OTHER_LIGHT
    noise = np.random.default_rng(1).integers(0, 9, (SIDE, SIDE), np.uint16)
    assert locate(noise, told, localizer).reason == NOTHING
