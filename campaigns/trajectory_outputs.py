"""Answers as files of the field: TUM trajectories, and MCAP recordings with messages of ROS 2 (docs/formats.md)."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.campaigns.answer_row import Answer
from conespot.campaigns.ros_messages import definition
from conespot.localize.frames.stamp import NANO, nanoseconds
from conespot.localize.orientation import METRES, camera_rotation, needle_rotation, pose_covariance, quaternion
from conespot.localize.outcome import Localization
from conespot.scene import InputError, Scene
from conespot.scene.atomic import can_hold, write_atomically

if TYPE_CHECKING:
    from mcap_ros2.writer import Writer

EYE, CAMERA, NEEDLE = "eye", "camera_optical_frame", "needle_tip"
POSE, IMAGE, INFO = "/needle/pose", "/camera/image/compressed", "/camera/camera_info"

Array = NDArray[np.float64]


def _time(answer: Answer, option: str) -> float:
    if answer.frame.time_s is None:
        raise InputError(
            f"{answer.frame.name}: has no time stamp, which {option} needs; give --rate, as '--rate 60 Hz'"
        )
    return answer.frame.time_s


class TumOutput:
    """A line a localized frame: `time x y z qx qy qz qw` [s, m]; a frame that was refused has none."""

    def __init__(self, path: Path) -> None:
        can_hold(path, "--tum")
        self._path, self._lines = path, ["# time_s x_m y_m z_m qx qy qz qw"]

    def add(self, answer: Answer) -> None:
        """Take one. Raises InputError for a frame without a time stamp."""
        time, found = _time(answer, "--tum"), answer.outcome
        if isinstance(found, Localization):
            values = (time, *(METRES * found.apex_mm).tolist(), *quaternion(needle_rotation(found)))
            self._lines.append(" ".join(repr(float(value)) for value in values))

    def close(self) -> None:
        """Write the file."""
        write_atomically(self._path, "".join(f"{line}\n" for line in self._lines).encode(), "--tum")


class McapOutput:
    """Poses, transforms, camera and images as ROS 2 records them. Raises InputError without the extra `ros`."""

    def __init__(self, path: Path, scene: Scene) -> None:
        can_hold(path, "--mcap")
        try:
            from mcap_ros2.writer import Writer
        except ImportError:
            raise InputError("--mcap needs mcap-ros2-support: pip install 'conespot[ros]'") from None
        self._path, self._scene, self._data = path, scene, io.BytesIO()
        self._writer: Writer = Writer(self._data)
        self._schemas = {name: self._writer.register_msgdef(name, definition(name)) for name in _DATATYPES}
        self._count = 0

    def add(self, answer: Answer) -> None:
        """Take one. Raises InputError for a frame without a time stamp."""
        if answer.dropped:
            return
        stamp = nanoseconds(_time(answer, "--mcap"))
        if not 0 <= stamp < 2**31 * NANO:
            raise InputError(f"{answer.frame.name}: its time stamp is none that ROS can hold")
        if not self._count:
            camera = self._scene.camera
            seen = _transform(stamp, CAMERA, camera.centre, camera_rotation(camera))
            self._write("/tf_static", "tf2_msgs/msg/TFMessage", stamp, {"transforms": [seen]})
        self._count += 1
        self._write(INFO, "sensor_msgs/msg/CameraInfo", stamp, _camera_info(self._scene, stamp))
        image = answer.frame.image
        if image.dtype in (np.uint8, np.uint16):
            ready, png = cv2.imencode(".png", np.ascontiguousarray(image[..., ::-1] if image.ndim == 3 else image))
            assert ready
            shown = {"header": _header(stamp, CAMERA), "format": "png", "data": png.tobytes()}
            self._write(IMAGE, "sensor_msgs/msg/CompressedImage", stamp, shown)
        found = answer.outcome
        if not isinstance(found, Localization):
            return
        moved = _transform(stamp, NEEDLE, found.apex_mm, needle_rotation(found))
        self._write("/tf", "tf2_msgs/msg/TFMessage", stamp, {"transforms": [moved]})
        covariance = pose_covariance(found)
        if covariance is not None:
            here = moved["transform"]
            pose = {"position": here["translation"], "orientation": here["rotation"]}
            stated = {"pose": pose, "covariance": covariance.ravel().tolist()}
            self._write(POSE, "geometry_msgs/msg/PoseWithCovarianceStamped", stamp,
                        {"header": _header(stamp, EYE), "pose": stated})  # fmt: skip

    def close(self) -> None:
        """Write the file."""
        self._writer.finish()  # type: ignore[no-untyped-call]  # the library's
        write_atomically(self._path, self._data.getbuffer(), "--mcap")

    def _write(self, topic: str, datatype: str, stamp: int, message: Mapping[str, object]) -> None:
        self._writer.write_message(topic, self._schemas[datatype], message, log_time=stamp, sequence=self._count)


_DATATYPES = (
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "tf2_msgs/msg/TFMessage",
    "sensor_msgs/msg/CameraInfo",
    "sensor_msgs/msg/CompressedImage",
)


class _Transform(TypedDict):
    translation: dict[str, float]
    rotation: dict[str, float]


class _Stamped(TypedDict):
    header: dict[str, object]
    child_frame_id: str
    transform: _Transform


def _header(stamp: int, frame: str) -> dict[str, object]:
    return {"stamp": {"sec": stamp // NANO, "nanosec": stamp % NANO}, "frame_id": frame}


def _transform(stamp: int, child: str, origin_mm: Array, rotation: Array) -> _Stamped:
    """A frame in the eye's."""
    return {
        "header": _header(stamp, EYE),
        "child_frame_id": child,
        "transform": {
            "translation": dict(zip("xyz", (METRES * origin_mm).tolist(), strict=True)),
            "rotation": dict(zip("xyzw", quaternion(rotation), strict=True)),
        },
    }


def _camera_info(scene: Scene, stamp: int) -> dict[str, object]:
    """The camera as OpenCV and ROS count it: pixel centres in whole numbers."""
    camera = scene.camera
    fx, (cx, cy) = camera.focal_length_px, (camera.principal - 0.5).tolist()
    fy = fx * camera.pixel_aspect
    rows, columns = camera.shape
    return {
        "header": _header(stamp, CAMERA),
        "height": rows,
        "width": columns,
        "distortion_model": "plumb_bob",
        "d": list(camera.distortion.coefficients) if camera.distortion else [0.0] * 5,
        "k": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        "r": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        "p": [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        "binning_x": 0,
        "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }
