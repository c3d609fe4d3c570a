"""A camera's calibration as OpenCV writes it: `cv2.FileStorage` in YAML, JSON or XML, with the usual names.

OpenCV's pixel coordinates are whole numbers at pixel centres; ours are at i + 0.5.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from conespot.scene.distortion import COEFFICIENTS, LARGEST
from conespot.scene.quantity import parse_quantity
from conespot.scene.resolution import FEWEST, MOST
from conespot.scene.text_file import read_text

if TYPE_CHECKING:
    from cv2 import FileNode, FileStorage

_MAX_BYTES = 1_000_000
_MOST_VALUES = 64
_MATRIX = ("camera_matrix", "Camera_Matrix", "cameraMatrix", "CameraMatrix", "K", "M1", "M")
_DISTORTION = (
    "distortion_coefficients",
    "Distortion_Coefficients",
    "distortion_coeffs",
    "dist_coeffs",
    "dist_coeff",
    "distCoeffs",
    "D",
    "D1",
)
_WIDTH = ("image_width", "image_Width", "imageWidth", "width")
_HEIGHT = ("image_height", "image_Height", "imageHeight", "height")
_SIZE = ("image_size", "imageSize", "size", "resolution")
#: words for the model of `Distortion`, where a file names one
_MODELS = {"plumb_bob", "brown_conrady", "opencv", "pinhole", "radtan", "standard"}


def calibrated(data: Any, folder: Path) -> Any:
    """A camera's keys with what the `calibration` file that they name holds, in a `folder`, where they name one.

    Raises ValueError for a bad file, and for a key that would come from both.
    """
    if not (isinstance(data, dict) and "calibration" in data):
        return data
    if not isinstance(data["calibration"], str):
        raise ValueError(f"calibration: name a file of OpenCV's, got {data['calibration']!r}")
    found = intrinsics(folder / data["calibration"], parse_quantity(data.get("sensor_width", 36.0), "length"))
    given = [key for key in found if key in data]
    if given:
        raise ValueError(f"{', '.join(given)} would also come from calibration; give only one of the two")
    return {**{key: value for key, value in data.items() if key != "calibration"}, **found}


def intrinsics(path: Path, sensor_width: float) -> dict[str, Any]:
    """The keys of a `Camera` that a calibration file stands for, its focal length for a `sensor_width` [mm].

    Raises ValueError for a file that cannot be read, lacks what is needed, or is of a lens that `Distortion` is not:
    rational, thin prism, tilted or fisheye.
    """
    import cv2

    text = read_text(path, _MAX_BYTES, "calibration file")
    level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # OpenCV would complain on stderr too
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        columns, rows = _size(storage, path)
        matrix = _matrix(storage, path)
        distortion = _coefficients(storage, path)
    except (cv2.error, SystemError):  # its Python binding lets malformed text out as a SystemError
        # what OpenCV says of it is the name of one of its own variables or functions
        raise ValueError(
            f"{path}: is no calibration as cv2.FileStorage writes it; it must be YAML that begins with %YAML:1.0, JSON"
            " or XML, complete and well-formed"
        ) from None
    finally:
        cv2.utils.logging.setLogLevel(level)
    found: dict[str, Any] = {
        "resolution": [columns, rows],
        "focal_length": f"{float(matrix[0, 0]) * sensor_width / columns!r} mm",
        "pixel_aspect": float(matrix[1, 1] / matrix[0, 0]),
        "principal_point": [float(matrix[0, 2]) + 0.5, float(matrix[1, 2]) + 0.5],
        "distortion": None,
    }
    if any(distortion):
        found["distortion"] = dict(zip(COEFFICIENTS, distortion, strict=False))
    return found


def _node(storage: FileStorage, names: tuple[str, ...]) -> tuple[str, FileNode] | None:
    for name in names:
        node = storage.getNode(name)
        if not (node.empty() or node.isNone()):
            return name, node
    return None


def _numbers(name: str, node: FileNode, path: Path) -> NDArray[np.float64]:
    """The values of a matrix, a list or one number."""
    values: Any = None
    if node.isMap():
        # OpenCV itself would make room for as many rows and columns as a file claims; version 5 may write sizes instead
        sides = _listed(node.getNode("sizes")) or [node.getNode("rows").real(), node.getNode("cols").real()]
        if node.getNode("dt").empty():  # rows, cols and data alone, as ROS writes them
            values = _listed(node.getNode("data"))
        elif 0.0 < math.prod(sides) <= _MOST_VALUES:
            values = node.mat()
    else:
        values = _listed(node)
    array = np.array([] if values is None else values, float)
    if not array.size or not np.all(np.isfinite(array)) or np.any(np.abs(array) > LARGEST):
        raise ValueError(f"{path}: {name} holds no usable numbers")
    return array


def _listed(node: FileNode) -> list[float]:
    if node.isInt() or node.isReal():
        return [node.real()]
    return [node.at(i).real() for i in range(min(node.size(), _MOST_VALUES))] if node.isSeq() else []


def _size(storage: FileStorage, path: Path) -> tuple[int, int]:
    """Width and height of the calibrated frames [px]."""
    width, height, size = _node(storage, _WIDTH), _node(storage, _HEIGHT), _node(storage, _SIZE)
    if width and height:
        sides = [*_numbers(*width, path).ravel(), *_numbers(*height, path).ravel()]
    elif size:
        sides = list(_numbers(*size, path).ravel())
    else:
        raise ValueError(f"{path}: image_width and image_height are missing; a calibration holds for one frame size")
    if len(sides) != 2 or any(side != round(side) for side in sides):
        raise ValueError(f"{path}: the frame's size must be two whole numbers, got {', '.join(map(str, sides))}")
    if not all(FEWEST <= side <= MOST for side in sides):
        raise ValueError(
            f"{path}: frames of {sides[0]:g} x {sides[1]:g} pixels cannot be; a side has from {FEWEST} to {MOST}"
        )
    return int(sides[0]), int(sides[1])


def _matrix(storage: FileStorage, path: Path) -> NDArray[np.float64]:
    """The camera matrix `[3, 3]` [px]."""
    found = _node(storage, _MATRIX)
    if found is None:
        raise ValueError(f"{path}: camera_matrix is missing")
    values = _numbers(*found, path)
    if values.size != 9:
        raise ValueError(f"{path}: {found[0]} must be 3 x 3, got {values.size} values")
    matrix = values.reshape(3, 3)
    fx, fy = matrix[0, 0], matrix[1, 1]
    if not (fx > 0.0 and fy > 0.0):
        raise ValueError(f"{path}: {found[0]} must have positive focal lengths, got {fx:g} and {fy:g} px")
    if abs(matrix[0, 1]) > 1e-9 * fx or np.any(matrix[1:, 0]) or matrix[2, 1] or not math.isclose(matrix[2, 2], 1.0):
        raise ValueError(
            f"{path}: {found[0]} is skewed or not of the form [fx 0 cx; 0 fy cy; 0 0 1], which is not read"
        )
    return matrix


def _coefficients(storage: FileStorage, path: Path) -> list[float]:
    """k1, k2, p1, p2 and perhaps k3."""
    for name in ("fisheye_model", "fisheye"):
        node = storage.getNode(name)
        if not node.empty() and not (node.isInt() and int(node.real()) == 0):
            raise ValueError(f"{path}: {name}: a fisheye lens is not one of k1, k2, p1, p2, k3; it cannot be described")
    model = _node(storage, ("distortion_model", "camera_model", "model"))
    if model and model[1].isString() and model[1].string().lower() not in _MODELS:
        raise ValueError(f"{path}: {model[0]} {model[1].string()!r} is not one of k1, k2, p1, p2, k3; calibrate it so")
    found = _node(storage, _DISTORTION)
    if found is None:
        raise ValueError(f"{path}: distortion_coefficients are missing; write five zeros for a lens without distortion")
    values = [float(value) for value in _numbers(*found, path).ravel()]
    if len(values) < 4 or any(values[5:]):
        kinds = {8: "rational", 12: "thin prism", 14: "tilted"}
        raise ValueError(
            f"{path}: {found[0]} has {len(values)} values ({kinds.get(len(values), 'another model')}); only k1, k2, p1,"
            " p2 and k3 can be described: calibrate without CALIB_RATIONAL_MODEL, CALIB_THIN_PRISM_MODEL and"
            " CALIB_TILTED_MODEL"
        )
    return values[:5]
