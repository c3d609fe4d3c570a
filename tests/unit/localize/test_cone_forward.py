"""The image model against rays cast many times a pixel."""

import numpy as np
import pytest

from conespot.localize import Knowns
from conespot.localize.model.estimate import Estimate
from conespot.localize.model.forward import light, moved
from conespot.localize.model.irradiance import Irradiance
from conespot.localize.model.prior import prior_rows
from conespot.localize.model.profile import Profile
from conespot.localize.model.quantity import quantity
from conespot.localize.model.sight import look, window
from conespot.localize.model.solve import inverse
from conespot.scene.beam import CyclesBeam, HardBeam, LinearBeam, TabulatedBeam
from conespot.scene.camera import Camera
from conespot.scene.pose import Pose, tangents
from conespot.scene.scene import Scene

BEAMS = [
    (HardBeam(), 0.04),
    (CyclesBeam(), 2e-4),
    (CyclesBeam(blend=0.1), 2e-3),
    (LinearBeam(), 2e-4),
    (TabulatedBeam(angles=(0.0, 0.1, 0.157), intensities=(1.0, 0.7, 0.2)), 1e-2),
]


def patch(scene, pose):
    points = scene.camera.project(scene.outline(pose, 0))
    low = np.floor(points.min(axis=0)).astype(int) - 4
    high = np.ceil(points.max(axis=0)).astype(int) + 4
    return low, high - low


def cast(scene, pose, low, size, k=16):
    """Mean irradiance per pixel from k x k rays, with scene's own geometry only."""
    x = low[0] + (np.arange(size[0] * k) + 0.5) / k
    y = low[1] + (np.arange(size[1] * k) + 0.5) / k
    rays = scene.camera.rays(np.stack(np.meshgrid(x, y), axis=-1)).directions
    points = scene.surface.intersect(scene.eye, scene.camera.centre, rays)
    outward = points - scene.eye.centre
    normals = scene.surface.normals(scene.eye, outward / np.linalg.norm(outward, axis=-1, keepdims=True))
    to = points - pose.apex
    d = np.linalg.norm(to, axis=-1)
    value = scene.beam.intensity(to @ pose.axis / d) * -np.sum(normals * to, axis=-1) / d**3
    return value.reshape(size[1], k, size[0], k).mean(axis=(1, 3)).ravel()


@pytest.mark.parametrize(("beam", "tolerance"), BEAMS, ids=lambda b: getattr(b, "kind", ""))
def test_a_pixels_mean_is_what_many_rays_average_to(beam, tolerance):
    scene = Scene(beam=beam, camera=Camera(resolution=1000))
    pose = scene.pose(np.array([1.0, 0.5, 4.0]))
    low, size = patch(scene, pose)
    expected = cast(scene, pose, low, size)
    sight = look(scene, window(low[1], low[0], size[1], size[0]))
    found = light(sight, pose, scene, Profile.of(beam)).value
    assert np.max(np.abs(found - expected)) / expected.max() < tolerance


def test_bumps_change_the_light_as_rays_say():
    scene = Scene(beam=CyclesBeam(), camera=Camera(resolution=400), surface="bumps")
    pose = scene.pose(np.array([0.3, 0.1, 4.0]))
    low, size = patch(scene, pose)
    sight = look(scene, window(low[1], low[0], size[1], size[0]))
    found = light(sight, pose, scene, Profile.of(scene.beam)).value
    expected = cast(scene, pose, low, size, k=6)
    assert np.max(np.abs(found - expected)) / expected.max() < 0.03


@pytest.mark.parametrize(("beam", "_"), BEAMS, ids=lambda b: getattr(b, "kind", ""))
def test_the_jacobian_is_the_derivative(beam, _):
    scene = Scene(beam=beam, camera=Camera(resolution=500))
    pose = scene.pose(np.array([1.0, 0.5, 4.0]))
    low, size = patch(scene, pose)
    sight = look(scene, window(low[1], low[0], size[1], size[0]))
    profile = Profile.of(beam)
    rows = light(sight, pose, scene, profile).jacobian
    for i in range(5):
        step = np.zeros(5)
        step[i] = 1e-5
        sides = [light(sight, moved(pose, s * step), scene, profile).value for s in (1.0, -1.0)]
        numeric = (sides[0] - sides[1]) / 2e-5
        assert np.max(np.abs(rows[i] - numeric)) < 0.03 * np.max(np.abs(numeric))


@pytest.mark.parametrize("name", ["half_angle", "eye_radius", "camera_height", "camera_tilt_x"])
def test_a_hard_edge_tells_no_more_of_beam_and_camera_than_its_light_does(name):
    """What a pose can nearly imitate leaves little, of which a slightly wrong derivative would make much."""
    scene = Scene(camera=Camera(resolution=500, tilt=0.05, azimuth=0.3))
    pose = scene.pose(np.array([1.0, 0.5, 4.0]))
    knowns = Knowns(**{quantity(name).known: 1.0})
    low, size = patch(scene, pose)
    pixels = window(low[1], low[0], size[1], size[0])
    here = Estimate(pose, scene)
    shed = Irradiance(look(scene, pixels), pixels, 1, here, knowns, np.ones(len(pixels), bool))
    value, rows = shed(here)[0]
    _, prior = prior_rows(here, scene, knowns)

    def sigma(jacobian):
        """Of the quantity, where every pixel's light is known to a hundredth of the brightest."""
        whitened = np.concatenate([jacobian / (0.01 * value.max()), prior.T], axis=1)
        return np.sqrt(inverse(whitened @ whitened.T)[5, 5])

    numeric = np.empty_like(rows)
    for i, step in enumerate(np.diag([1e-5] * 3 + [1e-6] * 2 + [quantity(name).step] * (len(rows) - 5))):
        sides = [shed(here.moved(sign * step, knowns.free))[0][0] for sign in (1.0, -1.0)]
        numeric[i] = (sides[0] - sides[1]) / (2.0 * step[i])
    assert sigma(rows) == pytest.approx(sigma(numeric), rel=0.03)


def test_a_binned_pixel_is_the_mean_of_its_pixels():
    scene = Scene(beam=CyclesBeam(), camera=Camera(resolution=4000))
    pose = scene.pose(np.array([0.0, 0.5, 4.0]))
    profile = Profile.of(scene.beam)
    fine = light(look(scene, window(1900, 1900, 40, 40)), pose, scene, profile).value.reshape(10, 4, 10, 4)
    coarse = light(look(scene, window(1900, 1900, 10, 10, 4), 4.0), pose, scene, profile).value.reshape(10, 10)
    np.testing.assert_allclose(coarse, fine.mean(axis=(1, 3)), atol=2e-3 * coarse.max())


def test_the_tangents_are_the_columns_a_localizations_covariance_is_stated_in():
    axis = np.array([0.2, -0.3, -0.9])
    axis /= np.linalg.norm(axis)
    np.testing.assert_allclose(np.stack(tangents(axis), axis=1), Pose(np.zeros(3), axis).rotation()[:, :2])


def test_a_step_moves_the_axis_along_the_tangents_and_the_roll():
    scene = Scene()
    pose = scene.pose(np.array([1.0, 0.5, 4.0]))
    u, v = tangents(pose.axis)
    after = moved(pose, np.array([0.0, 0.0, 0.0, 1e-5, 2e-5]))
    np.testing.assert_allclose(after.axis - pose.axis, 1e-5 * u + 2e-5 * v, atol=1e-9)
    rolled = moved(pose, np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.3]))
    np.testing.assert_allclose(rolled.axis, pose.axis, atol=1e-12)
    assert abs(rolled.roll) == pytest.approx(0.3)
