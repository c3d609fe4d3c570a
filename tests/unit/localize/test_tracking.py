"""conespot.Tracker: follows where the motion leads, searches where it does not, and says which."""

import math

import numpy as np
import pytest
from moving import MovingNeedle

from conespot import InputError, Knowns, Tracker, load_scene
from conespot.localize.outcome import Localization
from conespot.localize.tracking.process import PROCESS, Belief, seen_of, transition
from conespot.localize.tracking.smoother import smoothed
from conespot.localize.tracking.tracker import State
from conespot.scene import Pose
from conespot.scene.motion import Tremor

STEP = 1.0 / MovingNeedle.rate_hz


@pytest.fixture(scope="module")
def film():
    """A needle, and six frames of it."""
    needle = MovingNeedle(300)
    return needle, [needle.frame(k * STEP) for k in range(6)]


def off_mm(tracked, needle):
    return float(np.linalg.norm(tracked.outcome.apex_mm - needle.tip(tracked.time_s)))


def test_after_the_first_frame_the_fit_alone_follows_and_a_replay_is_the_same_to_the_bit(film):
    needle, frames = film
    runs = []
    for _ in range(2):
        tracker = Tracker(needle.scene)
        runs.append([tracker.track(frame, k * STEP) for k, frame in enumerate(frames)])
    assert [tracked.state for tracked in runs[0]] == [State.FOUND, *[State.FOLLOWED] * 5]
    for tracked, again in zip(*runs, strict=True):
        assert tracked.outcome.apex_mm.tobytes() == again.outcome.apex_mm.tobytes()
        assert tracked.outcome.covariance.tobytes() == again.outcome.covariance.tobytes()
        sigma = math.sqrt(np.trace(tracked.outcome.covariance[:3, :3]))
        assert off_mm(tracked, needle) < 4.0 * sigma
        assert tracked.outcome.distance is not None
        assert tracked.latency_s > 0.0
    # the motion so far says where the last frame's needle is, as well as it says
    predicted = runs[0][-1].predicted
    spread = math.sqrt(np.trace(predicted.covariance[:3, :3]))
    assert np.linalg.norm(predicted.apex_mm - needle.tip(5 * STEP)) < 4.0 * spread < 2.0


def test_a_frame_without_light_is_refused_and_the_needle_is_found_again_at_once(film):
    needle, frames = film
    tracker = Tracker(needle.scene)
    for k, frame in enumerate(frames[:3]):
        tracker.track(frame, k * STEP)
    dark = needle.frame(0.0, dark=True)
    states = [tracker.track(dark, time) for time in (3 * STEP, 0.2, 0.5)]
    assert [tracked.state for tracked in states] == [State.COASTING, State.LOST, State.LOST]
    assert not any(tracked.outcome for tracked in states)
    assert states[0].predicted is not None
    assert states[2].predicted is None
    back = tracker.track(needle.frame(0.55), 0.55)
    assert back.state is State.FOUND
    assert off_mm(back, needle) < 0.05


def test_a_leap_is_no_motion_and_is_searched_for(film):
    needle, frames = film
    tracker = Tracker(needle.scene)
    for k, frame in enumerate(frames):
        tracker.track(frame, k * STEP)
    later = 1.5
    assert np.linalg.norm(needle.tip(later) - needle.tip(5 * STEP)) > 0.4
    leapt = tracker.track(needle.frame(later), 6 * STEP)
    assert leapt.state is State.FOUND
    assert np.linalg.norm(leapt.outcome.apex_mm - needle.tip(later)) < 0.05


def test_three_spotlights_are_followed_with_their_roll():
    needle = MovingNeedle(300, exposure_s=0.0, rig="triple")
    tracker = Tracker(needle.scene)
    runs = [tracker.track(needle.frame(k * STEP), k * STEP) for k in range(2)]
    assert [tracked.state for tracked in runs] == [State.FOUND, State.FOLLOWED]
    for tracked in runs:
        assert tracked.outcome.roll is not None
        assert off_mm(tracked, needle) < 4.0 * math.sqrt(np.trace(tracked.outcome.covariance[:3, :3]))


def test_the_smoother_halves_what_errs_independently_and_leaves_what_all_frames_share():
    scene, rng, tremor = load_scene("paper"), np.random.default_rng(5), Tremor(rms=0.18)
    times = np.arange(240) * STEP
    slow = np.stack([0.5 * np.sin(times), 0.5 * np.cos(0.8 * times), 4.0 + 0.3 * times], axis=1)
    truth, sigma, shared = slow + tremor.displacement(times, 3), 0.004, np.array([0.01, 0.0, 0.02])
    covariance = np.diag([*[sigma**2] * 3, 1e-6, 1e-6])
    outcomes = []
    for tip in truth + shared + rng.normal(0.0, sigma, truth.shape):
        outcomes.append(Localization(tip, Pose.through(tip, scene.instrument.rcm).axis, covariance))
    found = np.array([answer.apex_mm for answer in smoothed(times.tolist(), outcomes, scene, Knowns())])
    before = np.array([answer.apex_mm for answer in outcomes]) - truth - shared
    after = (found - truth - shared)[12:-12]  # at its ends a track has frames on one side only
    assert np.sqrt(np.mean(after**2)) < 0.5 * np.sqrt(np.mean(before**2))
    np.testing.assert_allclose(np.mean(found - truth, axis=0), shared, atol=3.0 * sigma / math.sqrt(len(times)))


def test_a_belief_states_the_pose_and_covariance_that_a_frame_told_it():
    scene = load_scene("paper")
    pose = Pose.through([1.0, -2.0, 4.0], np.asarray(scene.instrument.rcm) + [0.02, 0.01, 0.0])
    root = np.random.default_rng(1).normal(size=(5, 5)) * 1e-3
    found = Localization(pose.apex, pose.axis, root @ root.T + 1e-9 * np.eye(5))
    belief = Belief.first(*seen_of(found, scene), 0.3)
    np.testing.assert_allclose(belief.pose(scene).apex, pose.apex, atol=1e-4)
    np.testing.assert_allclose(belief.pose(scene).axis, pose.axis, atol=1e-4)
    np.testing.assert_allclose(belief.pose_covariance(scene), found.covariance, rtol=0.05, atol=1e-9)


def test_the_oscillator_keeps_the_tremor_it_states_and_two_steps_are_one():
    change, added = transition(STEP, 0.01)
    first = Belief.first(np.zeros(5), 1e6 * np.eye(5), 0.3).covariance  # nothing is told: it is what it always is
    tremor = slice(2, 8)
    stays = first[tremor, tremor]
    np.testing.assert_allclose(stays[0, 0], PROCESS.tremor_mm**2, rtol=1e-6)
    kept = change[tremor, tremor] @ stays @ change[tremor, tremor].T + added[tremor, tremor]
    np.testing.assert_allclose(kept, stays, rtol=1e-6, atol=1e-6)
    twice, more = transition(2.0 * STEP, 0.01)
    np.testing.assert_allclose(change @ change, twice, atol=1e-9)
    np.testing.assert_allclose(change @ added @ change.T + added, more, rtol=1e-6, atol=1e-9)


def test_what_cannot_be_tracked_is_a_sentence(film):
    needle, frames = film
    with pytest.raises(InputError, match="'paper' has no fit that starts from a pose; take cone or photometric"):
        Tracker(needle.scene, "paper")
    tracker = Tracker(needle.scene)
    tracker.track(frames[0], 1.0)
    with pytest.raises(InputError, match="a frame at 1 s follows one at 1 s; give them in order"):
        tracker.track(frames[0], 1.0)
