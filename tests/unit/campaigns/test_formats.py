"""TUM and MCAP out and in: read by others to 1e-9 mm, in metres, with the roll's rule and its variance."""

import math

import numpy as np
import pytest

from conespot.campaigns.answer_row import Answer
from conespot.campaigns.trajectory_outputs import INFO, POSE, McapOutput, TumOutput
from conespot.localize.frames.reader import GivenFrame, read_frames
from conespot.localize.orientation import FREE_ROLL, camera_rotation, needle_rotation, pose_covariance, quaternion
from conespot.localize.outcome import Localization, LocalizationFailure
from conespot.scene import InputError, Pose, Scene
from conespot.scene.camera import Camera
from conespot.scene.pose import tangents

SCENE = Scene(camera=Camera(resolution=(40, 30), tilt=0.1, azimuth=0.3))


@pytest.fixture(scope="module")
def answers():
    """Five frames 8.3 ms apart, the third refused."""
    rng = np.random.default_rng(4)
    found = []
    for number in range(5):
        pose = Pose.through([*rng.uniform(-3.0, 3.0, 2), rng.uniform(2.0, 6.0)], SCENE.instrument.rcm)
        root = rng.normal(size=(5, 5)) * 1e-3
        outcome = Localization(pose.apex, pose.axis, root @ root.T)
        image = rng.integers(0, 256, (30, 40), np.uint8)
        frame = GivenFrame(f"f{number}.png", number / 120.0, image)
        found.append(Answer(frame, LocalizationFailure("too dim") if number == 2 else outcome))
    return found


def written(output, answers):
    for answer in answers:
        output.add(answer)
    output.close()


def test_evo_reads_a_tum_trajectory_to_1e_9_mm(answers, tmp_path):
    from evo.tools import file_interface

    written(TumOutput(tmp_path / "a.tum"), answers)
    read = file_interface.read_tum_trajectory_file(tmp_path / "a.tum")
    assert read.check()[0]
    localized = [answer for answer in answers if answer.outcome]
    tips = np.array([answer.outcome.apex_mm for answer in localized])
    np.testing.assert_allclose(read.positions_xyz * 1e3, tips, atol=1e-9)
    np.testing.assert_array_equal(read.timestamps, [answer.frame.time_s for answer in localized])
    for matrix, answer in zip(read.poses_se3, localized, strict=True):
        np.testing.assert_allclose(matrix[:3, 2], answer.outcome.axis, atol=1e-12)


def test_a_reader_of_somebody_else_finds_poses_camera_and_covariance_in_an_mcap(answers, tmp_path):
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    path = tmp_path / "a.mcap"
    written(McapOutput(path, SCENE), answers)
    store = get_typestore(Stores.ROS2_HUMBLE)
    poses, infos, static = [], [], []
    with Reader(path) as reader:
        for connection, _, raw in reader.messages():
            message = store.deserialize_cdr(raw, connection.msgtype)
            {POSE: poses, INFO: infos, "/tf_static": static}.get(connection.topic, []).append(message)
    localized = [answer for answer in answers if answer.outcome]
    assert len(poses) == len(localized) == 4
    assert len(infos) == 5
    for message, answer in zip(poses, localized, strict=True):
        found, pose = answer.outcome, message.pose.pose
        tip = 1e3 * np.array([pose.position.x, pose.position.y, pose.position.z])
        np.testing.assert_allclose(tip, found.apex_mm, atol=1e-9)
        assert message.header.frame_id == "eye"
        covariance = message.pose.covariance.reshape(6, 6)
        np.testing.assert_allclose(covariance, pose_covariance(found), rtol=1e-12)
        np.testing.assert_allclose(covariance[:3, :3] * 1e6, found.covariance[:3, :3], rtol=1e-12)
        assert found.axis @ covariance[3:, 3:] @ found.axis == pytest.approx(FREE_ROLL)
    k = infos[0].k.reshape(3, 3)
    camera = static[0].transforms[0].transform
    back = np.array([camera.rotation.x, camera.rotation.y, camera.rotation.z, camera.rotation.w])
    np.testing.assert_allclose(back, quaternion(camera_rotation(SCENE.camera)))
    # a point of the eye, through transform and camera matrix as ROS has them, is where our camera sees it
    point = np.array([1.0, -2.0, 3.0])
    origin = 1e3 * np.array([camera.translation.x, camera.translation.y, camera.translation.z])
    seen = k @ (camera_rotation(SCENE.camera).T @ (point - origin))
    np.testing.assert_allclose(seen[:2] / seen[2] + 0.5, SCENE.camera.project(point), atol=1e-9)


def test_a_recording_is_an_input_with_the_same_pixels_and_times(answers, tmp_path):
    path = tmp_path / "a.mcap"
    written(McapOutput(path, SCENE), answers)
    read = list(read_frames([path], SCENE))
    assert [frame.time_s for frame in read] == pytest.approx([answer.frame.time_s for answer in answers], abs=1e-9)
    for frame, answer in zip(read, answers, strict=True):
        np.testing.assert_array_equal(frame.image, answer.frame.image)


@pytest.mark.parametrize("damage", ["", "cut", "other"])
def test_what_is_no_recording_is_a_sentence(answers, tmp_path, damage):
    path = tmp_path / "a.mcap"
    written(McapOutput(path, SCENE), answers)
    data = path.read_bytes()
    path.write_bytes({"": b"", "cut": data[: len(data) // 2], "other": b"RIFF" + data}[damage])
    with pytest.raises(InputError, match=r"a\.mcap: cannot be read as MCAP"):
        list(read_frames([path], SCENE))


def test_a_frame_without_a_time_stamp_has_no_place_on_a_trajectory(answers, tmp_path):
    for output in (TumOutput(tmp_path / "a.tum"), McapOutput(tmp_path / "a.mcap", SCENE)):
        with pytest.raises(InputError, match="has no time stamp, which --(tum|mcap) needs; give --rate"):
            output.add(Answer(GivenFrame("f.png", None, answers[0].frame.image), answers[0].outcome))


def test_rotations_move_the_axis_as_the_covariance_says_and_x_lies_in_the_vertical_plane():
    pose = Pose.through([1.0, 2.0, 4.0], SCENE.instrument.rcm)
    found = Localization(pose.apex, pose.axis, np.diag([0.0, 0.0, 0.0, 1.0, 0.0]))
    rotation = needle_rotation(found)
    np.testing.assert_allclose(rotation[:, 2], pose.axis, atol=1e-15)
    np.testing.assert_allclose(rotation[:, 0], tangents(pose.axis)[0], atol=1e-15)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    # all that varies is a turn of the axis along U: what a rotation vector w makes of an axis is w x axis
    values, vectors = np.linalg.eigh(pose_covariance(found)[3:, 3:] - FREE_ROLL * np.outer(pose.axis, pose.axis))
    moved = np.cross(vectors[:, 2], pose.axis)
    np.testing.assert_allclose(np.abs(moved @ tangents(pose.axis)[0]) * math.sqrt(values[2]), 1.0)
