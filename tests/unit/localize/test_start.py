"""The start on frames cast pixel by pixel: a bright disc, rims cut by the frame, several patches, no patch."""

import math
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np
import pytest

from conespot.localize.image import Frame, Reference
from conespot.localize.outcome import Localization, LocalizationFailure
from conespot.localize.start.rays import rays_across, support
from conespot.localize.start.rig import poses_on
from conespot.localize.start.rings import Overview, Ring, find_rings
from conespot.localize.start.search import ELSEWHERE, NOTHING, TWO_PLACES, Start, believed, find_start, find_starts
from conespot.scene import Pose
from conespot.scene.beam import CyclesBeam, HardBeam, LinearBeam
from conespot.scene.camera import Camera
from conespot.scene.scene import Scene
from conespot.scene.sensor import Linear
from conespot.scene.spotlights import spotlight_axes

SIDE, RAYS = 600, 2  # pixels a side, and rays a side of each
DISC = (3.4, 0.6)  # [mm]
BEAMS = {"hard": HardBeam(), "soft": CyclesBeam(), "half soft": CyclesBeam(blend=0.3), "linear": LinearBeam()}


def scene_of(beam="hard", spotlights="single"):
    return Scene(beam=BEAMS[beam], spotlights=spotlights, camera=Camera(resolution=SIDE), sensor=Linear(bits=12))


@lru_cache
def wall():
    scene = scene_of()
    at = (np.arange(SIDE * RAYS) + 0.5) / RAYS
    sight = scene.camera.rays(np.stack(np.meshgrid(at, at), axis=-1)).directions
    return scene.surface.intersect(scene.eye, scene.camera.centre, sight)


@lru_cache
def albedo(disc):
    """A mottled retina with a disc of `disc` times its albedo, somewhat taller than wide and with a soft rim."""
    points = wall()
    mottle = cv2.GaussianBlur(np.random.default_rng(3).standard_normal(points.shape[:2]), (0, 0), 4.0 * RAYS)
    reflect = np.exp(0.15 * mottle / mottle.std())
    off = np.hypot((points[..., 0] - DISC[0]) / 0.86, (points[..., 1] - DISC[1]) / 1.02)
    inside = 1.0 / (1.0 + np.exp((off - 1.0) / 0.03))
    for column in (-0.2, 0.15):  # vessels
        inside *= 1.0 - 0.4 * (np.abs(points[..., 0] - DISC[0] - column) < 0.05)
    return reflect * (1.0 + (disc - 1.0) * inside)


def frame(scene, pose, disc=1.0, gain=45.0, seed=0):
    """A 12-bit frame whose patch is lit `gain` times as brightly as its surroundings; no patch without a pose."""
    points = wall()
    up = (scene.eye.radius - points[..., 2]) / scene.eye.radius
    light = np.zeros(points.shape[:2])
    if pose is not None:
        to = points - pose.apex
        d = np.linalg.norm(to, axis=-1)
        profile = sum(scene.beam.intensity(to @ axis / d) for axis in spotlight_axes(pose, scene.spotlights))
        normal = (scene.eye.centre - points) / scene.eye.radius
        light = profile * -np.sum(normal * to, axis=-1) / d**3
        light *= gain / light.max()
    pixels = (albedo(disc) * (up + light)).reshape(SIDE, RAYS, SIDE, RAYS).mean(axis=(1, 3))
    rng = np.random.default_rng(seed)
    # the brightest of both is exposed to 80 % of white
    electrons = pixels * min(200.0, 9000.0 / pixels.max())
    electrons = rng.poisson(electrons) + 15.0 * rng.standard_normal(pixels.shape)
    return np.clip(np.round(electrons / 11250.0 * 4095.0), 0, 4095).astype(np.uint16)


def miss(start, pose):
    assert isinstance(start, Start), start
    return float(np.linalg.norm(start.pose.apex - pose.apex))


def start_in(image, scene, unlit=None):
    return find_start(Frame(image, scene.sensor), scene, None if unlit is None else Reference.of(unlit, scene))


TIPS = ((1.0, 0.5, 4.0), (-4.2, -3.4, 5.5), (-1.5, 3.9, 2.4))


@pytest.mark.parametrize("tip", TIPS)
@pytest.mark.parametrize("beam", BEAMS)
def test_a_disc_as_bright_as_a_patch_does_not_mislead_the_start(beam, tip):
    scene = scene_of(beam)
    pose = scene.pose(np.array(tip))
    assert miss(start_in(frame(scene, pose, disc=20.0), scene), pose) < 0.12


@pytest.mark.parametrize("beam", ["hard", "soft"])
def test_a_patch_that_falls_half_on_the_disc_is_found_whole(beam):
    scene = scene_of(beam)
    tip = np.array([DISC[0] - 0.3, DISC[1] - 0.9, 5.0])
    pose = scene.pose(tip)
    assert miss(start_in(frame(scene, pose, disc=20.0), scene), pose) < 0.2


@pytest.mark.parametrize("gain", [8.0, 1000.0])
def test_the_power_need_not_be_known(gain):
    scene = scene_of("soft")
    pose = scene.pose(np.array(TIPS[0]))
    assert miss(start_in(frame(scene, pose, gain=gain), scene), pose) < 0.12


def test_a_clipped_patch_is_read_by_its_rim():
    scene = scene_of("soft")
    pose = scene.pose(np.array(TIPS[0]))
    image = np.minimum(frame(scene, pose).astype(int) * 6, 4095).astype(np.uint16)
    assert np.count_nonzero(image == 4095) > 500
    assert miss(start_in(image, scene), pose) < 0.15


def test_a_patch_cut_by_the_frame_is_found_by_what_is_visible():
    scene = scene_of()
    pose = scene.pose(np.array([-3.9, 0.0, 6.0]))
    edge = scene.camera.project(scene.outline(pose, 0))
    assert edge[:, 0].min() < -5.0
    assert miss(start_in(frame(scene, pose), scene), pose) < 0.3


@pytest.mark.parametrize("roll", [0.0, 0.5, -0.9])
@pytest.mark.parametrize("beam", ["hard", "soft"])
def test_a_rig_is_found_with_its_roll_beside_a_disc(beam, roll):
    scene = scene_of(beam, "triple")
    bare = scene.pose(np.array([-0.5, 0.4, 4.0]))
    pose = Pose(bare.apex, bare.axis, roll)
    start = start_in(frame(scene, pose, disc=20.0), scene)
    assert miss(start, pose) < 0.1
    assert abs(math.remainder(start.pose.roll - roll, 2.0 * math.pi)) < 0.02


def test_a_rig_of_which_one_patch_is_missing_is_not_found():
    scene = scene_of("hard", "triple")
    pose = scene.pose(np.array(TIPS[0]))
    two = scene.model_copy(update={"spotlights": scene.spotlights[:2]})
    assert start_in(frame(two, pose), scene).reason == NOTHING


def test_a_rig_whose_patches_merge_is_found():
    scene = scene_of("soft", "triple")
    scene = scene.model_copy(update={"beam": CyclesBeam(half_angle=math.radians(12.0))})
    pose = scene.pose(np.array([1.0, 0.5, 4.0]))
    assert miss(start_in(frame(scene, pose), scene), pose) < 0.15


def test_a_reference_without_spotlights_takes_the_disc_away():
    scene = scene_of("half soft")
    pose = scene.pose(np.array(TIPS[0]))
    unlit = frame(scene, None, disc=20.0, seed=1)
    assert miss(start_in(frame(scene, pose, disc=20.0), scene, unlit), pose) < 0.12


@pytest.mark.parametrize("beam", BEAMS)
def test_a_clipped_patch_is_found_with_a_reference_as_without(beam):
    scene = scene_of(beam)
    pose = scene.pose(np.array(TIPS[0]))
    clipped, unlit = (np.minimum(frame(scene, at, seed=seed) * 8.0, 4095.0) for seed, at in enumerate((pose, None)))
    image = clipped.astype(np.uint16)
    assert np.count_nonzero(image == 4095) > 1000
    for reference in (None, unlit.astype(np.uint16)):
        assert miss(start_in(image, scene, reference), pose) < 0.12


def test_colours_and_floats_are_searched_too():
    scene = scene_of()
    pose = scene.pose(np.array(TIPS[0]))
    grey = frame(scene, pose, disc=20.0)
    colour = np.stack([grey, grey // 2, grey // 4], axis=2)
    assert miss(start_in(colour, scene), pose) < 0.12
    assert miss(start_in((grey / 4095.0).astype(np.float32), scene), pose) < 0.12


@pytest.mark.parametrize("beam", ["hard", "soft"])
@pytest.mark.parametrize("grey", [0, 80, 4095])
def test_an_even_frame_has_no_start(beam, grey):
    noise = np.random.default_rng(0).normal(grey, 6.0, (SIDE, SIDE))
    assert start_in(np.clip(noise, 0, 4095).astype(np.uint16), scene_of(beam)).reason == NOTHING


@pytest.mark.parametrize("beam", ["hard", "soft"])
@pytest.mark.parametrize("disc", [1.0, 20.0])
def test_a_retina_without_a_patch_has_no_start_whatever_its_disc(beam, disc):
    scene = scene_of(beam)
    assert start_in(frame(scene, None, disc=disc), scene).reason == NOTHING


def test_what_the_retinas_own_mottle_shows_is_no_light():
    pose = scene_of().pose(np.array(TIPS[0]))
    assert Start(pose, 0.5, 0.7, 1.0).stands_out
    assert not Start(pose, 0.5, 0.4, 1.0).stands_out
    assert not Start(pose, 0.2, 0.7, 1.0).stands_out
    assert not Start(pose, 0.5, 0.7, 0.15).stands_out


def test_the_best_start_comes_first_and_no_two_are_the_same():
    scene = scene_of("half soft")
    pose = scene.pose(np.array([DISC[0] - 0.9, DISC[1] - 1.2, 5.0]))
    starts = list(find_starts(Frame(frame(scene, pose, disc=20.0), scene.sensor), scene))
    assert all(a.evidence >= b.evidence for a, b in pairwise(starts))
    for k, start in enumerate(starts):
        assert all(np.linalg.norm(start.pose.apex - other.pose.apex) > 0.1 for other in starts[:k])


def test_rings_are_centred_on_round_light_and_as_large():
    image = np.full((SIDE, SIDE), 40, np.uint16)
    cv2.circle(image, (400, 250), 40, 2000, -1)
    overview = Overview.of(Frame(image, scene_of().sensor), None)
    ring = find_rings(overview, scene_of(), 1)[0]
    np.testing.assert_allclose(ring.centre, (400.5, 250.5), atol=2.0)
    assert ring.radius == pytest.approx(40.0, rel=0.1)
    assert ring.votes > 0.7
    hidden = find_rings(overview, scene_of(), 1, [ring.curve()])[0]
    assert hidden.votes < 0.7 * ring.votes


def test_a_ring_has_one_pose_for_one_spotlight_and_the_cone_meets_the_wall_in_it():
    scene = scene_of()
    ring = Ring(np.array([350.0, 260.0]), 45.0, 1.0)
    (pose,) = poses_on([ring], scene)
    outline = scene.camera.project(scene.outline(pose, 0))
    np.testing.assert_allclose(outline.mean(axis=0), ring.centre, atol=4.0)
    assert np.linalg.norm(outline - outline.mean(axis=0), axis=1).mean() == pytest.approx(45.0, rel=0.06)


def test_the_true_pose_explains_more_than_any_beside_it():
    scene = scene_of("soft")
    pose = scene.pose(np.array(TIPS[0]))
    overview = Overview.of(Frame(frame(scene, pose), scene.sensor), None)
    here = support(rays_across(overview, scene, pose))
    for step in np.vstack([np.eye(3), -np.eye(3)]) * 0.25:
        there = support(rays_across(overview, scene, scene.pose(pose.apex + step)))
        assert there[0] < here[0]
        assert there[2] < here[2]


def located(pose):
    return Localization(pose.apex, pose.axis)


def test_a_fit_that_leaves_the_light_it_started_from_is_refused():
    scene = scene_of()
    pose = scene.pose(np.array(TIPS[0]))
    away = scene.pose(np.array(TIPS[0]) + [0.0, 0.3, 0.0])
    start = Start(pose, 0.8, 0.9, 3.0)
    assert believed([start], scene, lambda _: located(pose))
    assert believed([start], scene, lambda _: located(away)) == LocalizationFailure(ELSEWHERE)


def test_the_next_start_counts_only_where_none_is_convincing():
    scene = scene_of()
    poses = [scene.pose(np.array(tip)) for tip in TIPS[:2]]
    refused = LocalizationFailure("reason")

    def second_only(start):
        return located(start.pose) if start.pose is poses[1] else refused

    assert believed([Start(poses[0], 0.8, 0.9, 3.0), Start(poses[1], 0.7, 0.9, 2.9)], scene, second_only) == refused
    found = believed([Start(poses[0], 0.4, 0.9, 3.0), Start(poses[1], 0.4, 0.9, 2.9)], scene, second_only)
    assert isinstance(found, Localization)
    np.testing.assert_array_equal(found.apex_mm, poses[1].apex)
    assert believed([], scene, second_only) == LocalizationFailure(NOTHING)


def test_two_believed_answers_that_differ_are_none():
    scene = scene_of()
    starts = [Start(scene.pose(np.array(tip)), 0.4, 0.9, 1.0) for tip in TIPS[:2]]
    assert believed(starts, scene, lambda start: located(start.pose)) == LocalizationFailure(TWO_PLACES)


@pytest.mark.parametrize(
    ("times", "more", "rig", "expected"),
    [
        (6.0, 0.0, "triple", True), (2.0, 0.0, "triple", False), (0.2, 0.0, "triple", False),
        (1.0, -0.3, "triple", True), (1.0, -0.05, "triple", False), (1.0, 0.3, "triple", False),
        (6.0, -0.3, "single", False),
    ],
)  # fmt: skip
def test_a_rig_in_its_neighbours_places_far_less_sure_or_likely_is_no_second_answer(times, more, rig, expected):
    """By the `times` that the tip is less sure, and by how much `more` likely its bins are."""
    scene = scene_of(spotlights=rig)
    here = scene.pose(np.array(TIPS[0]))
    turned = Pose(here.apex + [0.15, 0.0, 0.0], here.axis, here.roll + 2.1)
    starts = [Start(pose, 0.7, 0.9, worth) for pose, worth in ((here, 1.2), (turned, 1.0))]

    def answer(start):
        size, second = 5 if rig == "single" else 6, start is starts[1]
        covariance = (0.01 * (times if second else 1.0)) ** 2 * np.eye(size)
        found = Localization(start.pose.apex, start.pose.axis, covariance, roll=start.pose.roll)
        return replace(found, likelihood=1.7 + more * second)

    outcome = believed(starts, scene, answer)
    if not expected:
        assert outcome == LocalizationFailure(TWO_PLACES)
        return
    assert np.array_equal(outcome.apex_mm, here.apex)
