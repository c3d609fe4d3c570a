"""The scene's geometry against the paper's numbers and closed forms written here."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from conespot.scene import Eye, Pose, Scene, load_scene
from conespot.scene.beam import CyclesBeam, HardBeam, LinearBeam, TabulatedBeam
from conespot.scene.power import Power
from conespot.scene.spotlights import RIGS, spotlight_axes
from conespot.scene.surface import Bump, Surface, bump_grid
from conespot.scene.trajectory import Box, Grid, Helix, Line, Random, Shell, Spiral

RNG = np.random.default_rng(0)
BEAMS = [
    HardBeam(half_angle=math.radians(5.0)),
    HardBeam(),
    CyclesBeam(),
    CyclesBeam(blend=0.3),
    LinearBeam(),
    TabulatedBeam(angles=(0.0, 0.1, 0.12), intensities=(1.0, 0.6, 0.0)),
]


@given(st.floats(-4, 4), st.floats(-4, 4), st.floats(2, 10), st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1))
def test_a_ray_from_inside_meets_the_sphere_ahead_on_its_radius(x, y, z, dx, dy, dz):
    eye, direction = Eye(radius=12.5), np.array([dx, dy, dz])
    if np.linalg.norm(direction) < 1e-3:
        return
    origin = np.array([x, y, z])
    t = eye.intersect(origin, direction)
    assert t > 0
    assert np.linalg.norm(origin + t * direction - eye.centre) == pytest.approx(12.5, abs=1e-9)


def test_a_ray_that_misses_is_nan():
    assert np.isnan(Eye().intersect([0.0, 20.0, 100.0], [0.0, 0.0, -1.0]))


def test_the_needle_axis_passes_through_the_rcm():
    pose = Pose.through([0.0, 2.0, 2.0], [6.0, 0.0, 22.0])
    np.testing.assert_allclose(np.cross([6.0, -2.0, 20.0], pose.axis), 0.0, atol=1e-12)
    assert pose.axis[2] < 0
    assert pose.tilt == pytest.approx(math.atan2(math.hypot(6, 2), 20))
    assert pose.azimuth == pytest.approx(math.atan2(-2, 6))


@given(st.floats(-4, 4), st.floats(-4, 4), st.floats(1, 8), st.floats(-3, 3))
def test_the_pose_rotation_takes_down_to_the_axis(x, y, z, roll):
    pose = Pose.through([x, y, z], [6.0, 0.0, 22.0])
    turned = Pose(pose.apex, pose.axis, roll).rotation()
    np.testing.assert_allclose(turned @ [0, 0, -1], pose.axis, atol=1e-12)
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)


def test_three_spotlights_point_as_in_table_iii():
    pose = Pose(np.array([0.0, 0.0, 5.0]), np.array([0.0, 0.0, -1.0]))
    axes = spotlight_axes(pose, RIGS["triple"])
    # needle straight down: Ry(y) Rx(x) (0, 0, -1) written out
    for axis, (x, y) in zip(axes, [(-10, -6), (0, 11), (9, -6)], strict=True):
        x, y = math.radians(x), math.radians(y)
        expected = [-math.sin(y) * math.cos(x), math.sin(x), -math.cos(y) * math.cos(x)]
        np.testing.assert_allclose(axis, expected, atol=1e-12)
    np.testing.assert_allclose(spotlight_axes(pose, RIGS["single"])[0], pose.axis)


@pytest.mark.parametrize("beam", BEAMS, ids=lambda b: b.kind)
def test_flux_factor_is_the_profile_integrated_over_solid_angle(beam):
    def ring(t):
        return 2.0 * math.pi * float(beam.intensity(math.cos(t))) * math.sin(t)

    numeric = quad(ring, 0.0, beam.half_angle * (1.0 - 1e-12), limit=400)[0]
    assert beam.flux_factor == pytest.approx(numeric, rel=1e-6)


@pytest.mark.parametrize("beam", BEAMS, ids=lambda b: b.kind)
def test_a_beam_is_one_on_its_axis_and_dark_outside(beam):
    assert beam.intensity(1.0) == pytest.approx(1.0)
    assert beam.intensity(math.cos(beam.half_angle + 1e-6)) == 0.0
    angles = np.linspace(0.0, beam.half_angle, 100)
    assert np.all(np.diff(beam.intensity(np.cos(angles))) <= 1e-12)


def test_one_blender_watt_is_three_milliwatts_in_the_soft_cone():
    power, beam = Power(value=1.0, convention="isotropic"), CyclesBeam(blend=1.0)
    assert power.axial_intensity(beam) == pytest.approx(0.0796, abs=1e-4)
    assert power.flux(beam) == pytest.approx(0.5 * (1 - math.cos(math.radians(9))) * 0.5)
    assert power.flux(beam) == pytest.approx(3.1e-3, rel=0.01)
    assert Power(value=1.0, convention="flux").flux(beam) == pytest.approx(1.0)


def test_helix_is_as_coded():
    points = Helix().positions(100, RNG)
    np.testing.assert_allclose(points[0], [0, 2, 2])
    np.testing.assert_allclose(points[-1], [2 * math.sin(7 * math.pi), 2 * math.cos(7 * math.pi), 2 + 7 * math.pi / 4])
    phi = np.linspace(0, 7 * math.pi, 100)
    np.testing.assert_allclose(points, np.stack([2 * np.sin(phi), 2 * np.cos(phi), 2 + phi / 4], 1))


def test_box_is_25_steps_a_side_each_with_its_first_corner():
    points = Box().positions(100, RNG)
    corners = np.array([(-2.5, -2.5, 3), (2.5, -2.5, 4), (2.5, 2.5, 5), (-2.5, 2.5, 6)])
    np.testing.assert_allclose(points[::25], corners)
    np.testing.assert_allclose(points[1] - points[0], (corners[1] - corners[0]) / 25)
    np.testing.assert_allclose(points[99], corners[3] + (corners[0] - corners[3]) * 24 / 25)


def test_box_with_fewer_poses_visits_a_subset_of_the_papers():
    np.testing.assert_allclose(Box().positions(25, RNG), Box().positions(100, RNG)[::4], atol=1e-12)


@pytest.mark.parametrize("trajectory", [Box(), Helix(), Spiral(), Line(), Grid(), Random()], ids=lambda t: t.kind)
@pytest.mark.parametrize("poses", [1, 2, 7, 100])
def test_every_trajectory_gives_as_many_poses_as_asked(trajectory, poses):
    points = trajectory.positions(poses, np.random.default_rng(1))
    assert points.shape == (poses, 3)
    scene = load_scene("paper-code")
    assert all(scene.depth(p) > 0 for p in points)
    np.testing.assert_array_equal(points, trajectory.positions(poses, np.random.default_rng(1)))


def test_grid_fills_its_volume_evenly():
    points = Grid().positions(64, RNG)
    assert len(np.unique(points, axis=0)) == 64
    np.testing.assert_allclose(points.mean(axis=0), [0.0, 0.0, 4.5])


def test_a_bump_is_a_raised_cosine_along_the_arc():
    eye, surface = Eye(radius=12.5), Surface(bumps=(Bump(x=0.0, y=0.0),))
    for arc, height in [(0.0, 0.1), (0.125, 0.05), (0.25, 0.0), (1.0, 0.0)]:
        angle = arc / 12.5
        assert surface.displacement(eye, [math.sin(angle), 0.0, -math.cos(angle)]) == pytest.approx(height, abs=1e-9)
    np.testing.assert_allclose(surface.points(eye, [0.0, 0.0, -1.0]), [0.0, 0.0, 0.1], atol=1e-9)


def test_normals_are_the_numerical_ones():
    """Against central differences of the surface's own points, on and off bumps."""
    eye, surface = Eye(radius=12.5), bump_grid()
    rng = np.random.default_rng(3)
    bump = surface.bumps[4]
    xy = np.concatenate([rng.uniform(-5, 5, (50, 2)), [bump.x, bump.y] + rng.uniform(-0.17, 0.17, (50, 2))])

    def point(xy):
        on_wall = np.column_stack([xy, eye.height(xy[:, 0], xy[:, 1])]) - eye.centre
        return surface.points(eye, on_wall / 12.5)

    h = 1e-5
    du = point(xy + [h, 0]) - point(xy - [h, 0])
    dv = point(xy + [0, h]) - point(xy - [0, h])
    numeric = np.cross(du, dv)
    numeric /= np.linalg.norm(numeric, axis=1, keepdims=True)
    on_wall = np.column_stack([xy, eye.height(xy[:, 0], xy[:, 1])]) - eye.centre
    np.testing.assert_allclose(surface.normals(eye, on_wall / 12.5), numeric, atol=2e-5)
    tilted = np.abs(numeric - surface.normals(eye, on_wall / 12.5)).max()
    assert tilted < 1e-4
    assert (np.abs(numeric + on_wall / 12.5).max(axis=1) > 0.1).any(), "some normals must be tilted by a bump"


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(2, 8), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_a_ray_meets_the_bumped_surface_on_it(x, y, z, dx, dy):
    eye, surface = Eye(radius=12.5), bump_grid()
    direction = np.array([dx, dy, -1.0]) / math.sqrt(dx * dx + dy * dy + 1.0)
    point = surface.intersect(eye, [x, y, z], direction)
    np.testing.assert_allclose(np.cross(point - [x, y, z], direction), 0.0, atol=1e-9)
    outward = point - eye.centre
    distance = np.linalg.norm(outward)
    assert distance == pytest.approx(12.5 - float(surface.displacement(eye, outward / distance)), abs=1e-6)


def test_the_outline_is_the_cones_edge_on_the_surface():
    scene = Scene()
    pose = scene.pose(np.array([1.0, 2.0, 4.0]))
    outline = scene.outline(pose, 0)
    rays = (outline - pose.apex) / np.linalg.norm(outline - pose.apex, axis=1, keepdims=True)
    np.testing.assert_allclose(rays @ pose.axis, math.cos(scene.beam.half_angle), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(outline - scene.eye.centre, axis=1), scene.eye.radius, atol=1e-9)


def test_a_tip_outside_the_eye_is_refused():
    with pytest.raises(ValueError, match="outside the eye"):
        Scene().pose(np.array([0.0, 0.0, -0.1]))
    with pytest.raises(ValueError, match="outside the eye"):
        Scene(surface=Surface(bumps=(Bump(x=0.0, y=0.0),))).pose(np.array([0.0, 0.0, 0.05]))


def test_tips_of_a_shell_lie_evenly_between_two_distances_from_the_wall_and_over_its_area():
    tips = Shell(radius=12.0, nearest=0.05, farthest=1.0, reach=2.0).positions(4000, np.random.default_rng(1))
    offset = tips - [0.0, 0.0, 12.0]
    out = np.linalg.norm(offset, axis=1)
    assert 11.0 <= out.min() < out.max() <= 11.95
    assert np.mean(12.0 - out) == pytest.approx(0.525, abs=0.02)
    arc = 12.0 * np.arccos(-offset[:, 2] / out)
    assert arc.max() <= 2.0 + 1e-9
    assert np.mean(arc < np.sqrt(2.0)) == pytest.approx(0.5, abs=0.03)  # half the radius squared, half the area
