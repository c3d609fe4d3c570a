import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conespot.localize.published.cone_geometry import Candidates, cone_over_ellipse, fitted_plane, retina_points
from conespot.localize.published.ellipse import Ellipse, fit_ellipse
from conespot.scene import Camera, Eye, load_scene
from conespot.scene.trajectory import Box, Helix

half_angles = st.floats(np.radians(5.0), np.radians(15.0))


@given(st.floats(0, 5000), st.floats(0, 5000), st.sampled_from([12.0, 12.5, 20.0]))
def test_equations_1_to_7_are_the_ray_through_the_pixel_met_by_the_sphere(x, y, radius):
    camera, eye = Camera(), Eye(radius=radius)
    ray = camera.rays([x, y]).directions
    expected = camera.centre + eye.intersect(camera.centre, ray) * ray
    np.testing.assert_allclose(retina_points(camera, eye, [x, y]), expected, rtol=0, atol=1e-10)


@given(st.floats(1, 2499), st.floats(0, 2 * np.pi))
def test_equation_3_with_its_sign_mended_and_equations_4_to_6_give_the_same(distance, angle):
    camera, eye = Camera(), Eye()
    f, d0, r = camera.focal_length, camera.height, eye.radius
    y1 = distance * camera.sensor_width / camera.resolution
    a, b = 1 + f**2 / y1**2, 2 * d0 * f / y1 - 2 * r * f / y1
    x1 = (b + np.sqrt(b**2 - 4 * a * (d0**2 - 2 * d0 * r))) / (2 * a)
    pixel = 2500 + distance * np.array([np.cos(angle), -np.sin(angle)])
    expected = [x1 * np.cos(angle), x1 * np.sin(angle), r - np.sqrt(r**2 - x1**2)]
    np.testing.assert_allclose(retina_points(camera, eye, pixel), expected, rtol=0, atol=1e-8)


def test_the_optical_axis_and_a_sensor_point_with_x_0_are_no_special_cases():
    points = retina_points(Camera(), Eye(), [[2500, 2500], [2500, 1500], [2500, 3500]])
    np.testing.assert_allclose(points[0], 0.0, atol=1e-12)
    assert points[1, 0] == points[2, 0] == 0.0
    assert points[1, 1] == pytest.approx(-points[2, 1])
    assert points[1, 1] > 0.0


def test_known_points_project_and_come_back():
    camera, eye = Camera(), Eye()
    x, y = np.meshgrid(np.linspace(-6, 6, 7), np.linspace(-6, 6, 7))
    wall = np.stack([x, y, eye.height(x, y)], axis=-1)
    np.testing.assert_allclose(retina_points(camera, eye, camera.project(wall)), wall, atol=1e-10)


def test_a_ray_past_the_eye_has_no_point():
    points = retina_points(Camera(), Eye(radius=5.0), [[2500.0, 2500.0], [5.0, 2500.0]])
    assert not np.isnan(points[0]).any()
    assert np.isnan(points[1]).all()


def rays_of(axis, half_angle, count=60):
    u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    u /= np.linalg.norm(u)
    phi = np.arange(count)[:, None] * 2 * np.pi / count
    return np.cos(half_angle) * axis + np.sin(half_angle) * (np.cos(phi) * u + np.sin(phi) * np.cross(axis, u))


@given(half_angles, st.floats(0.02, 0.9), st.floats(0, 2 * np.pi), st.floats(1.0, 8.0), st.floats(0.0, 2 * np.pi))
def test_the_section_of_a_cone_by_a_plane_gives_its_apex_and_axis_back(half_angle, lean, turn, height, around):
    eye, origin = Eye(), np.array([1.0, -2.0, 0.5])
    normal = eye.centre - origin
    normal /= np.linalg.norm(normal)
    u = np.cross(normal, [np.cos(around), np.sin(around), 0.3])
    u /= np.linalg.norm(u)
    v = np.cross(normal, u)
    axis = -np.cos(lean) * normal + np.sin(lean) * (np.cos(turn) * u + np.sin(turn) * v)
    apex = origin + height * normal
    rays = rays_of(axis, half_angle)
    section = apex + (height / -(rays @ normal))[:, None] * rays

    plane = fitted_plane(section, eye)
    assert plane.normal @ normal == pytest.approx(1.0, abs=1e-9)
    ellipse = fit_ellipse(plane.local(section))
    apexes, vertices = cone_over_ellipse(ellipse, half_angle)
    pair = Candidates.of(plane.world(apexes), plane.world(vertices), ellipse.a - ellipse.b)
    best = np.argmin(np.linalg.norm(pair.apexes - apex, axis=1))
    np.testing.assert_allclose(pair.apexes[best], apex, atol=1e-6)
    np.testing.assert_allclose(pair.axes[best], axis, atol=1e-6)
    for other_apex, other_axis in zip(pair.apexes, pair.axes, strict=True):
        seen = section - other_apex
        cosine = seen @ other_axis / np.linalg.norm(seen, axis=1)
        np.testing.assert_allclose(np.arccos(cosine), half_angle, atol=1e-6)


def test_a_ratio_above_one_counts_as_a_circle():
    ellipse = Ellipse(np.zeros(2), 1.0, 1.0 + 1e-9, np.array([1.0, 0.0]))
    apexes, _ = cone_over_ellipse(ellipse, np.radians(9.0))
    np.testing.assert_allclose(apexes, [[0.0, 0.0, 1.0 / np.tan(np.radians(9.0))]] * 2, atol=1e-12)


@pytest.mark.parametrize("trajectory", [Helix(), Box()])
def test_on_the_sphere_the_ellipse_alone_costs_up_to_sixteen_micrometres(trajectory):
    scene = load_scene("paper")
    errors = []
    for tip in trajectory.positions(50, np.random.default_rng(0)):
        outline = scene.outline(scene.pose(tip), 0, 360)
        plane = fitted_plane(outline, scene.eye)
        apexes, _ = cone_over_ellipse(fit_ellipse(plane.local(outline)), scene.beam.half_angle)
        errors.append(np.linalg.norm(plane.world(apexes) - tip, axis=1).min())
    assert 0.004 < np.mean(errors) < 0.006
    assert max(errors) < 0.016
