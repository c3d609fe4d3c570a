"""The edge fit that follows: the same answer as the fit of all levels, from what the last frame left."""

import math

import numpy as np
import pytest
from moving import MovingNeedle

from conespot.localize.doubt import noise_of
from conespot.localize.edge.again import Carried, can_follow, fit_again
from conespot.localize.edge.fit import fit_edge
from conespot.localize.edge.quick import QuickBeam
from conespot.localize.image import Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import light
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.outline import distances
from conespot.localize.model.sight import look, window
from conespot.localize.model.view import edge_width
from conespot.scene import Pose
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.motion import Velocity
from conespot.scene.spotlights import RIGS


@pytest.fixture(scope="module")
def needle():
    return MovingNeedle(300, exposure_s=0.0)


@pytest.fixture(scope="module")
def carried(needle):
    """What a fit of all levels of the first frame leaves."""
    frame = Frame(needle.frame(0.0), needle.scene.sensor)
    start = Estimate(Pose.through(needle.tip(0.0), needle.scene.instrument.rcm), needle.scene)
    fit = fit_edge(frame, start, Knowns().within(needle.scene), noise_of(frame, None))
    return Carried.after(fit, edge_width(fit.estimate))


def again(needle, carried, pixels, tip, scene=None):
    frame, scene = Frame(pixels, needle.scene.sensor), scene or needle.scene
    start = Estimate(Pose.through(tip, scene.instrument.rcm), scene)
    return fit_again(frame, start, Knowns(smear_sigma_mm=0.0).within(scene), carried, noise_of(frame, None))


@pytest.mark.parametrize("theatre", [False, True])
def test_the_quick_light_is_the_models_within_a_thousandth_and_so_are_its_derivatives(theatre):
    needle = MovingNeedle(400, exposure_s=0.0, like_theatre=theatre)
    scene = needle.scene.model_copy(update={"motion": Velocity(velocity=(5.0, 8.0, -3.0), exposure=0.005)})
    pose = Pose.through(needle.tip(0.1), scene.instrument.rcm)
    middle = scene.camera.project(scene.outline(pose, 0)).mean(axis=0).astype(int)
    sight = look(scene, window(middle[1] - 50, middle[0] - 50, 100, 100))
    found = QuickBeam(sight, Estimate(pose, scene))(pose)
    whole = light(sight, pose, scene, Estimate(pose, scene).profile)
    assert np.max(np.abs(found.value - whole.value)) < 1e-3 * np.max(whole.value)
    for own, other in zip(found.rows[:5], whole.jacobian, strict=True):
        assert np.max(np.abs(own - other)) < 1e-2 * np.max(np.abs(other))
    step = 1e-5
    wider = QuickBeam(sight, Estimate(pose, scene))(pose, step)
    np.testing.assert_allclose(
        (wider.value - found.value) / step, found.rows[5], atol=0.01 * np.abs(found.rows[5]).max()
    )


def test_bins_lie_as_far_from_the_quick_outline_as_from_the_exact_one(needle):
    scene = needle.scene
    estimate = Estimate(Pose.through(needle.tip(0.0), scene.instrument.rcm), scene)
    middle = scene.camera.project(scene.outline(estimate.pose, 0)).mean(axis=0).astype(int)
    pixels = window(middle[1] - 20, middle[0] - 20, 40, 40)
    sight = look(scene, pixels)
    exact = distances(pixels, np.zeros(len(pixels), int), estimate)[0]
    found = QuickBeam(sight, estimate)(estimate.pose).offset(scene.beam.half_angle)
    np.testing.assert_allclose(found, exact, atol=1e-6)


def test_it_answers_as_the_fit_of_all_levels_does_within_a_sigma(needle, carried):
    time = 1.0 / needle.rate_hz
    pixels, tip = needle.frame(time), needle.tip(time)
    frame = Frame(pixels, needle.scene.sensor)
    start = Estimate(Pose.through(tip, needle.scene.instrument.rcm), needle.scene)
    whole = fit_edge(frame, start, Knowns().within(needle.scene), noise_of(frame, None))
    for off in ([0.01, -0.005, 0.005], [-0.02, 0.02, 0.03]):
        quick = again(needle, carried, pixels, tip + off)
        sigma = np.sqrt(np.diag(quick.covariance))
        assert np.all(np.abs(quick.estimate.pose.apex - whole.estimate.pose.apex) < sigma[:3])
        assert np.all(np.abs(quick.estimate.pose.apex - tip) < 3.0 * sigma[:3])
        np.testing.assert_allclose(sigma, np.sqrt(np.diag(whole.covariance)), rtol=0.35)
        assert quick.contrast > 1.5


def test_a_motion_that_the_track_tells_is_no_error_and_one_that_nobody_tells_is_sought_as_a_blur(carried):
    needle = MovingNeedle(300, exposure_s=0.01)
    times = np.arange(80) / needle.rate_hz
    speed = [np.linalg.norm(needle.tip(t + 1e-3) - needle.tip(t - 1e-3)) / 2e-3 for t in times]
    time = float(times[int(np.argmax(speed))])
    velocity = (needle.tip(time + 1e-3) - needle.tip(time - 1e-3)) / 2e-3
    pixels, tip = needle.frame(time), needle.tip(time)
    motion = Velocity(velocity=tuple(velocity.tolist()), exposure=0.01)
    told = again(needle, carried, pixels, tip, needle.scene.model_copy(update={"motion": motion}))
    untold = again(needle, carried, pixels, tip, needle.scene.model_copy(update={"motion": None}))
    sought = math.inf if untold is None else untold.carried.blur  # or more than the quick fit settles with
    assert sought > 0.0
    assert abs(told.carried.blur or 0.0) < 0.3 * sought
    sigma = np.sqrt(np.diag(told.covariance)[:3])
    assert np.all(np.abs(told.estimate.pose.apex - tip) < 3.0 * sigma)


def test_where_it_cannot_tell_the_fit_of_all_levels_has_to_look(needle, carried):
    tip = needle.tip(0.0)
    assert again(needle, carried, needle.frame(0.0), tip + [9.0, 0.0, 0.0]) is None  # outside the frame
    dark = again(needle, carried, needle.frame(0.0, dark=True), tip)
    assert dark is None or dark.contrast < 1.05
    assert again(needle, carried, np.full_like(needle.frame(0.0), 4095), tip) is None  # clipped


def test_what_it_does_not_model_is_left_to_the_localizers_own_fit():
    scene, knowns = MovingNeedle(300).scene, Knowns()
    assert can_follow(scene, Knowns(smear_sigma_mm=0.0).within(scene))
    for parts in ({"beam": HardBeam()}, {"spotlights": RIGS["triple"]}):
        assert not can_follow(scene.model_copy(update=parts), knowns)
    assert not can_follow(scene.model_copy(update={"beam": CyclesBeam()}), Knowns(half_angle_sigma_deg=0.1))
