"""Calibration files of OpenCV's: what is read, and what is refused rather than cut to fit."""

import cv2
import numpy as np
import pytest
from calibrations import CALIBRATION

from conespot.scene import InputError, load_scene
from conespot.scene.document import dump


def camera_of(folder, text, name="cal.yml", more=""):
    (folder / name).write_text(text)
    (folder / "mine.yaml").write_text(f"preset: paper-code\ncamera: {{calibration: {name}{more}}}\n")
    return load_scene(folder / "mine.yaml").camera


def test_a_calibration_stands_for_the_cameras_inner_keys_and_pixel_centres_move_by_half(tmp_path):
    camera = camera_of(tmp_path, CALIBRATION, more=", tilt: 5 deg, height: 180 mm")
    assert camera.shape == (1080, 1920)
    assert camera.focal_length_px == pytest.approx(16000.0, rel=1e-12)
    assert camera.focal_length_px * camera.pixel_aspect == pytest.approx(16160.0, rel=1e-12)
    assert camera.principal_point == (980.0, 529.75)
    assert camera.distortion.coefficients == (-3.0, 80.0, 0.02, -0.03, -900.0)
    assert camera.height == 180.0
    assert "calibration" not in dump(camera)  # a run says what the file held


@pytest.mark.parametrize("name", ["cal.yml", "cal.json", "cal.xml"])
def test_what_cv2_writes_projects_as_cv2_does(tmp_path, name):
    """A file of this OpenCV, in each of its formats: projectPoints straight from above, to 1e-6 px."""
    matrix = np.array([[16000.0, 0.0, 970.0], [0.0, 15900.0, 555.5], [0.0, 0.0, 1.0]])
    lens = np.array([[-3.0, 80.0, 0.02, -0.03]])
    storage = cv2.FileStorage(str(tmp_path / name), cv2.FILE_STORAGE_WRITE)
    storage.write("imageSize", np.array([1920.0, 1080.0]))
    storage.write("cameraMatrix", matrix)
    storage.write("distCoeffs", lens)
    storage.release()
    camera = camera_of(tmp_path, (tmp_path / name).read_text(), name)
    points = np.random.default_rng(1).uniform([-4.0, -3.0, 0.0], [4.0, 3.0, 4.0], (100, 3))
    ahead = points * [1.0, -1.0, -1.0] + [0.0, 0.0, camera.height]
    expected = cv2.projectPoints(ahead, np.zeros(3), np.zeros(3), matrix, lens)[0][:, 0]
    np.testing.assert_allclose(camera.project(points) - 0.5, expected, rtol=0.0, atol=1e-6)


def test_names_and_forms_of_other_programs_are_read(tmp_path):
    text = """%YAML:1.0
---
image_width: 640
image_height: 480
distortion_model: plumb_bob
K: {rows: 3, cols: 3, data: [9000., 0., 320., 0., 9000., 240., 0., 0., 1.]}
D: [0., 0., 0., 0., 0., 0., 0., 0.]
"""
    camera = camera_of(tmp_path, text)
    assert camera.distortion is None  # eight coefficients, but all zero
    assert camera.principal_point == (320.5, 240.5)


def coefficients(values):
    return CALIBRATION.replace("cols: 5", f"cols: {len(values)}").replace(
        "-3.0, 80., 0.02, -0.03, -900.", ", ".join(map(str, values))
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (coefficients([0.1, 0.2, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0]), "8 values (rational)"),
        (coefficients([0.1] * 12), "12 values (thin prism)"),
        (coefficients([0.1] * 14), "14 values (tilted)"),
        (coefficients([0.1, 0.2]), "2 values"),
        (coefficients([0.1, 0.2, 0.0, 0.0]) + "fisheye_model: 1\n", "fisheye"),
        (coefficients([0.1, 0.2, 0.0, 0.0]) + "distortion_model: equidistant\n", "'equidistant' is not one of"),
        (coefficients([-120.0, 0.0, 0.0, 0.0]), "fold the image within the frame"),
        (CALIBRATION.replace("[ 16000., 0.,", "[ 16000., 3.,"), "skewed"),
        (CALIBRATION.replace("[ 16000.,", "[ -16000.,"), "positive focal lengths"),
        (CALIBRATION.replace("[ 16000., 0.,", "[ 16000.,"), "is no calibration as cv2.FileStorage writes it"),
        (CALIBRATION.replace("rows: 3", "rows: 300000000"), "no usable numbers"),
        (CALIBRATION.replace("camera_matrix", "matrix_of_camera"), "camera_matrix is missing"),
        (CALIBRATION.replace("distortion_coefficients", "lens"), "distortion_coefficients are missing"),
        (CALIBRATION.replace("image_height: 1080", ""), "image_width and image_height are missing"),
        (CALIBRATION.replace("1080", "1080.5"), "two whole numbers"),
        (CALIBRATION.replace("image_width: 1920", "image_width: 0"), "frames of 0 x 1080 pixels cannot be"),
        ("", "is no calibration as cv2.FileStorage writes it"),
        ("not yaml: [", "is no calibration as cv2.FileStorage writes it"),
    ],
)
def test_what_cannot_be_described_is_refused_and_never_cut(tmp_path, capfd, text, said):
    with pytest.raises(InputError) as error:
        camera_of(tmp_path, text)
    assert said in str(error.value)
    assert "mine.yaml:2: camera: " in str(error.value)
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")
