"""scene.motion: velocity and tremor as functions of time, the exposure they need, and trajectories that carry time."""

import math

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.signal import welch

from conespot.scene import Scene
from conespot.scene.document import InputError, read_document
from conespot.scene.motion import Tremor, Velocity, extremes, poses_during
from conespot.scene.scene import read_scene

TIP = np.array([0.8, 0.4, 4.0])
EMVA = {"kind": "emva", "exposure_time": 0.008}


def test_a_tremor_is_as_large_and_as_fast_as_it_says_and_lies_within_its_band():
    """200 s: rms to 1 %; speed 2 pi rms sqrt(f^2 + B^2 / 12) to 1 %; a thousandth of Welch's power outside the band."""
    tremor, step = Tremor(rms=0.18, frequency=9.0, bandwidth=4.0), 1e-3
    d = tremor.displacement(np.arange(0.0, 200.0, step), seed=3)
    assert math.sqrt(np.mean(np.sum(d**2, axis=1))) == pytest.approx(0.18, rel=0.01)
    np.testing.assert_allclose(np.std(d, axis=0), 0.18 / math.sqrt(3.0), rtol=0.03)
    speed = np.sqrt(np.mean(np.sum(np.diff(d, axis=0) ** 2, axis=1))) / step
    assert speed == pytest.approx(2.0 * math.pi * 0.18 * math.sqrt(81.0 + 16.0 / 12.0), rel=0.01)
    frequency, power = welch(d, 1.0 / step, nperseg=8192, axis=0)
    outside = (frequency < 6.5) | (frequency > 11.5)
    assert power[outside].sum() < 1e-3 * power.sum()


def test_a_tremor_is_one_function_of_time_for_a_seed_and_its_sway_is_the_way_from_mid_exposure():
    tremor = Tremor()
    sway = tremor.sway(0.3, 0.008, seed=5)
    instants = 0.3 + 0.008 * np.linspace(-0.5, 0.5, len(sway))
    np.testing.assert_allclose(sway, tremor.displacement(instants, 5) - tremor.displacement(0.3, 5), atol=1e-12)
    np.testing.assert_allclose(sway[len(sway) // 2], 0.0, atol=1e-12)
    assert not np.allclose(tremor.sway(0.3, 0.008, seed=6), sway, atol=1e-3)
    assert np.abs(sway).max() < tremor.reach(0.008)


@pytest.mark.parametrize("exposure", [0.008, 1.0])
def test_straight_lines_between_a_sways_instants_follow_the_tremor(exposure):
    """Half-way between two instants against the function itself: within a micrometre, and 30 nm in 8 ms."""
    tremor = Tremor(bandwidth=4.0)
    sway = tremor.sway(0.0, exposure)
    between = exposure * (np.linspace(-0.5, 0.5, 2 * len(sway) - 1)[1::2])
    exact = tremor.displacement(between) - tremor.displacement(0.0)
    assert np.abs((sway[1:] + sway[:-1]) / 2.0 - exact).max() < (3e-5 if exposure < 0.01 else 1e-3)


def test_the_axis_goes_through_the_rcm_at_every_instant_and_the_pose_is_that_of_mid_exposure():
    scene = Scene.model_validate({"sensor": EMVA, "motion": {"kind": "tremor"}})
    rcm = np.array(scene.instrument.rcm)
    pose = scene.pose(TIP, time=0.4, seed=2)
    np.testing.assert_array_equal(pose.axis, Scene().pose(TIP).axis)
    during = poses_during(pose, rcm)
    assert len(during) == len(pose.sway)
    assert np.ptp([one.apex for one in during], axis=0).max() > 0.005
    for one in during:
        assert np.linalg.norm(np.cross(one.axis, rcm - one.apex)) < 1e-12
    furthest = {tuple(one.apex) for one in extremes(pose, rcm)}
    assert len(furthest) < len(during)
    for way in np.random.default_rng(0).normal(size=(100, 3)):
        reached = max(one.apex @ way for one in during) - max(np.array(tip) @ way for tip in furthest)
        assert reached < 1e-3 * np.linalg.norm(way)  # [mm]


@pytest.mark.parametrize(
    ("scene", "sentence"),
    [
        ({"motion": "tremor"}, "the sensor has none; write motion.exposure: 8 ms"),
        ({"motion": "tremor", "sensor": "cmv12000-mono"}, "needs a fixed exposure time, and the sensor meters its own"),
        ({"motion": {"kind": "tremor", "exposure": 0.01}, "sensor": EMVA}, "motion.exposure is for sensors without"),
        ({"motion": {"kind": "velocity"}}, "Field required"),
        ({"motion": {"kind": "tremor", "frequency": 9.0, "bandwidth": 20.0}, "sensor": EMVA}, "at most twice"),
        ({"motion": {"kind": "tremor", "bandwidth": 0.9}, "sensor": EMVA}, "greater than or equal to 1"),
        ({"motion": "tremor", "sensor": EMVA, "interreflection": {}}, "a still point of light: leave motion out"),
        ({"beam": {"kind": "hard", "source_diameter": 0.1}, "interreflection": {}}, "leave beam.source_diameter out"),
        ({"motion": "tremor", "sensor": EMVA, "instrument": {"shaft": {}}}, "leave instrument.shaft out"),
        ({"beam": {"kind": "hard", "source_diameter": -0.1}}, "greater than or equal to 0"),
    ],
)
def test_what_cannot_be_smeared_is_refused_in_a_sentence(scene, sentence):
    with pytest.raises(ValidationError, match=sentence):
        Scene.model_validate(scene)


def test_a_file_names_a_motion_with_its_units_and_none(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text("motion: {kind: velocity, velocity: [10 mm/s, 200 um/s, 0 mm/s], exposure: 8 ms}\n")
    scene = read_scene(read_document(path))
    assert scene.motion == Velocity(velocity=(10.0, 0.2, 0.0), exposure=0.008)
    path.write_text("motion: none\n")
    assert read_scene(read_document(path)).motion is None
    path.write_text("motion: {kind: tremor, rms: 180}\n")
    with pytest.raises(InputError, match=r"scene.yaml:1: motion.rms: .*no unit"):
        read_scene(read_document(path))
