"""The camera: where it is, what its pixels see along, and what it does not see."""

import math

import cv2
import numpy as np
import pytest
from calibrations import CALIBRATION
from hypothesis import given
from hypothesis import strategies as st

from conespot.scene import Camera, InputError, load_scene
from conespot.scene.distortion import Distortion
from conespot.scene.identity import identity

CAMERAS = [Camera(), Camera(resolution=64, focal_length=20.0, height=40.0)]
LENS = Distortion(k1=-3.0, k2=80.0, p1=0.02, p2=-0.03, k3=-900.0)
REAL = [
    Camera(resolution=(1920, 1080)),
    Camera(resolution=(1920, 1080), pixel_aspect=1.02, principal_point=(980.0, 530.0)),
    Camera(tilt=math.radians(5.0), azimuth=math.radians(30.0), roll=math.radians(-100.0), look_at=(0.3, -0.2, 0.1)),
    Camera(resolution=(600, 800), focal_length=40.0, distortion=Distortion(k1=-0.2, k2=0.05, p1=1e-3, p2=-2e-3)),
    Camera(resolution=(1920, 1080), distortion=LENS, principal_point=(980.0, 530.0), tilt=0.1, azimuth=2.0, roll=0.3),
]


def opencv(camera):
    """The camera as OpenCV has it: rotation vector, translation, matrix and coefficients."""
    axes = camera.axes * [[1.0], [-1.0], [-1.0]]  # right, down, ahead
    f, (cx, cy) = camera.focal_length_px, camera.principal - 0.5
    matrix = np.array([[f, 0.0, cx], [0.0, f * camera.pixel_aspect, cy], [0.0, 0.0, 1.0]])
    lens = camera.distortion.coefficients if camera.distortion else (0.0,) * 5
    return axes, -axes @ camera.centre, matrix, np.array(lens)


def test_camera_is_table_ii():
    camera = load_scene("paper-code").camera
    assert math.degrees(camera.full_fov) == pytest.approx(6.8673, abs=5e-5)
    assert camera.pixel_pitch * 5000 == pytest.approx(13.2)
    assert camera.pixel_pitch == pytest.approx(2.64e-3)


def test_the_pole_is_the_image_centre_and_y_runs_down():
    camera = Camera(resolution=1000)
    np.testing.assert_allclose(camera.project([0.0, 0.0, 0.0]), [500.0, 500.0])
    x, y = camera.project([1.0, 2.0, 0.0])
    assert x > 500.0 > y


@given(st.sampled_from(CAMERAS), st.floats(-1.0, 2.0), st.floats(-1.0, 2.0), st.floats(0.1, 200.0))
def test_projecting_inverts_rays(camera, across, down, distance):
    """Pixels in the frame and as far again beyond it, points anywhere on their rays: to 1e-9 of the frame."""
    height, width = camera.shape
    pixel = np.array([across * width, down * height])
    ray = camera.rays(pixel)
    assert np.linalg.norm(ray.directions) == pytest.approx(1.0, abs=1e-15)
    found = camera.project(ray.origins + distance * ray.directions)
    np.testing.assert_allclose(found, pixel, rtol=0.0, atol=1e-9 * width)


@given(st.sampled_from(CAMERAS), st.floats(-50, 50), st.floats(-50, 50), st.floats(0, 60))
def test_a_point_beside_or_above_the_pinhole_is_not_seen(camera, x, y, above):
    assert np.all(np.isnan(camera.project([x, y, camera.height + above])))


@pytest.mark.parametrize("camera", REAL)
def test_projecting_inverts_rays_of_a_real_camera(camera):
    """To 1e-6 px, all over the frame and a little beyond, at any distance."""
    height, width = camera.shape
    rng = np.random.default_rng(0)
    pixels = rng.uniform([-0.02 * width, -0.02 * height], [1.02 * width, 1.02 * height], (1000, 2))
    rays = camera.rays(pixels)
    np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=1), 1.0, atol=1e-12)
    found = camera.project(rays.origins + rng.uniform(1.0, 200.0, (1000, 1)) * rays.directions)
    np.testing.assert_allclose(found, pixels, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("camera", [*CAMERAS, *REAL])
def test_pixels_are_those_of_opencvs_projectpoints(camera):
    """Points about the posterior pole, to 1e-6 px; OpenCV's pixel centres are whole numbers."""
    points = np.random.default_rng(1).uniform([-4.0, -3.0, 0.0], [4.0, 3.0, 4.0], (500, 3))
    turn, move, matrix, lens = opencv(camera)
    expected = cv2.projectPoints(points, cv2.Rodrigues(turn)[0], move, matrix, lens)[0][:, 0]
    np.testing.assert_allclose(camera.project(points) - 0.5, expected, rtol=0.0, atol=1e-6)


def test_a_stereo_pair_is_opencvs():
    """The right frame from points in the left camera's frame and the pair's R and T, as stereoCalibrate has them."""
    left, right = (
        Camera(resolution=(1920, 1080), distortion=LENS, height=180.0, tilt=math.radians(3.5), azimuth=azimuth)
        for azimuth in (math.pi, 0.0)
    )
    points = np.random.default_rng(2).uniform([-4.0, -3.0, 0.0], [4.0, 3.0, 4.0], (500, 3))
    (turn_l, move_l, _, _), (turn_r, move_r, matrix, lens) = opencv(left), opencv(right)
    turn = turn_r @ turn_l.T
    move = move_r - turn @ move_l
    assert np.linalg.norm(move) == pytest.approx(2.0 * 180.0 * math.sin(math.radians(3.5)))  # the stereo base
    expected = cv2.projectPoints(points @ turn_l.T + move_l, cv2.Rodrigues(turn)[0], move, matrix, lens)[0][:, 0]
    np.testing.assert_allclose(right.project(points) - 0.5, expected, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(left.project([0.0, 0.0, 0.0]), right.project([0.0, 0.0, 0.0]), atol=1e-9)
    assert left.project([0.0, 0.0, 1.0])[0] > right.project([0.0, 0.0, 1.0])[0]  # what is nearer moves inwards


def test_the_camera_stands_where_tilt_and_azimuth_say_and_roll_takes_its_right_side_down():
    camera = Camera(height=100.0, tilt=math.radians(30.0), azimuth=math.radians(90.0), look_at=(1.0, 2.0, 0.5))
    np.testing.assert_allclose(camera.centre, [1.0, 2.0 + 50.0, 0.5 + 100.0 * math.cos(math.radians(30.0))])
    np.testing.assert_allclose(camera.project([1.0, 2.0, 0.5]), [2500.0, 2500.0])
    rolled = Camera(roll=math.radians(90.0))
    x, y = rolled.project([1.0, 0.0, 0.0])  # +x, to the right in the eye
    assert x == pytest.approx(2500.0)
    assert y < 2500.0


def test_a_square_has_one_address_however_it_is_written():
    assert Camera(resolution=[1000, 1000]) == Camera(resolution="1000x1000") == Camera(resolution=1000)
    assert Camera(resolution="1920x1080").shape == (1080, 1920)
    assert identity(Camera(resolution=(1920, 1080))) != identity(Camera(resolution=1920))


def test_what_a_lens_that_folds_outside_the_frame_would_bring_back_is_not_seen():
    camera = Camera(focal_length=100.0, distortion=Distortion(k1=-1.0))
    assert camera.distortion.reach == pytest.approx(math.sqrt(1.0 / 3.0), abs=2e-3)
    along = np.linspace(0.0, 110.0, 200)
    pixels = camera.project(np.stack([along, 0.0 * along, 0.0 * along], axis=-1))[:, 0]
    seen = pixels[np.isfinite(pixels)]
    assert np.all(np.diff(seen) > 0.0)
    assert np.isnan(pixels[-1])


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("resolution: [1920, 1080, 3]", "camera.resolution: give pixels a side, or"),
        ("resolution: [1920, 8]", "from 16 to 20000, got [1920, 8]"),
        ("resolution: 8", "greater than or equal to 16, got 8"),
        ("resolution: wide", "got 'wide'"),
        ("principal_point: [3 mm, 4 mm]", "expected a number of pixels such as '9 px'"),
        ("distortion: [0.1]", "give k1, k2, p1, p2 and perhaps k3"),
        ("distortion: {k4: 1}", "unknown key 'k4'"),
        ("distortion: {k1: .nan}", "must be finite"),
        ("distortion: {k1: -120}", "fold the image within the frame"),
        ("tilt: 95 deg", "less than or equal to 60"),
        ("look_at: [200 mm, 0 mm, 0 mm]", "no ray of it meets the retina"),
        ("{height: 30 mm, tilt: 50 deg}", "must put the camera above the eye"),
        ("calibration: nowhere.yml", "nowhere.yml: cannot be read: No such file"),
        ("{calibration: cal.yml, resolution: 500}", "resolution would also come from calibration"),
    ],
)
def test_a_camera_that_cannot_be_is_refused_in_one_sentence(tmp_path, written, said):
    path = tmp_path / "mine.yaml"
    (tmp_path / "cal.yml").write_text(CALIBRATION)
    path.write_text(f"preset: paper-code\ncamera: {written if written[0] == '{' else f'{{{written}}}'}\n")
    with pytest.raises(InputError) as error:
        load_scene(path)
    assert said in str(error.value)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("camera", [*CAMERAS, *REAL])
def test_rays_change_from_pixel_to_pixel_as_their_derivatives_say(camera):
    """Central differences over 0.02 px, whose own error is rounding: 1e-12 of a ray, 1e-7 of the derivative."""
    height, width = camera.shape
    pixels = np.random.default_rng(0).uniform([0, 0], [width, height], (50, 2))
    rays = camera.rays(pixels)
    for axis, name in ((0, "x"), (1, "y")):
        step = 0.01 * np.eye(2)[axis]
        more, less = camera.rays(pixels + step), camera.rays(pixels - step)
        for part in ("origins", "directions"):
            change, ahead, behind = getattr(rays, f"{part}_by_{name}"), getattr(more, part), getattr(less, part)
            slack = 1e-13 + 1e-7 * np.abs(change).max()
            np.testing.assert_allclose(ahead - behind, 0.02 * change, rtol=0.0, atol=slack)


def test_rays_are_asked_for_in_any_shape():
    pixels = np.random.default_rng(0).uniform(0, 5000, (4, 7, 2))
    many = Camera().rays(pixels)
    assert many.directions.shape == many.directions_by_x.shape == (4, 7, 3)
    np.testing.assert_array_equal(many.directions[3, 5], Camera().rays(pixels[3, 5]).directions)
