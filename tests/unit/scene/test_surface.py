"""Sphere, ellipsoid, bumps and height map as one surface: closed forms, exact normals, rays that end on it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from conespot.scene import Camera, Eye, InputError, Scene, load_scene
from conespot.scene.document import read_document
from conespot.scene.height_map import ReliefMap
from conespot.scene.identity import identity
from conespot.scene.scene import read_scene
from conespot.scene.surface import SURFACES as KNOWN
from conespot.scene.surface import Bump, Surface, bump_grid, surface_name

EYE = Eye(radius=12.5)
RNG = np.random.default_rng(7)
DRUSEN = ReliefMap(
    kind="csv", file="drusen.csv", width=8.0, x=0.3, y=-0.2, points=RNG.uniform(-10, 60, (30, 41)).tolist()
)
LONG = (1.03, 0.97, 1.1)
SURFACES = {
    "ellipsoid": Surface(semi_axes=LONG),
    "flat ellipsoid": Surface(semi_axes=(1.1, 1.0, 0.9)),
    "bumps": bump_grid(),
    "literal bumps": KNOWN["bumps-literal"],
    "height map": Surface(height_map=DRUSEN),
    "all": Surface(semi_axes=LONG, bumps=bump_grid().bumps, height_map=DRUSEN),
}


def directions(count=400, reach=0.5):
    d = np.column_stack([RNG.uniform(-reach, reach, (count, 2)), -np.ones(count)])
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def test_an_ellipsoid_has_its_semi_axes_and_touches_the_pole():
    surface, axes = SURFACES["ellipsoid"], 12.5 * np.array(LONG)
    points = surface.points(EYE, np.concatenate([directions(), -directions(), [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]]))
    np.testing.assert_allclose(np.sum(((points - [0.0, 0.0, axes[2]]) / axes) ** 2, axis=1), 1.0, atol=1e-13)
    np.testing.assert_allclose(points[-2:], [[0.0, 0.0, 0.0], [0.0, 0.0, 2.0 * axes[2]]], atol=1e-12)


@pytest.mark.parametrize("name", SURFACES)
def test_normals_are_across_the_surface_and_point_inside(name):
    """Against central differences of the surface's own points along two tangents."""
    surface, d = SURFACES[name], directions()
    u = np.cross(d, [0.0, 1.0, 0.0])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    h = 1e-5

    def along(t):
        sides = [surface.points(EYE, (s := d + k * h * t) / np.linalg.norm(s, axis=1, keepdims=True)) for k in (1, -1)]
        return (sides[0] - sides[1]) / (2.0 * h)

    normals = surface.normals(EYE, d)
    tangents = [along(u), along(np.cross(d, u))]
    for tangent in tangents:
        assert np.abs(np.sum(normals * tangent, axis=1)).max() < 2e-5 * 12.5
    assert np.all(np.sum(normals * d, axis=1) < 0.0)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    name=st.sampled_from(list(SURFACES)),
    x=st.floats(-5, 5), y=st.floats(-5, 5), z=st.floats(1.5, 9), dx=st.floats(-2, 2), dy=st.floats(-2, 2),
)  # fmt: skip
def test_a_ray_ends_on_the_surface_to_a_picometre(name, x, y, z, dx, dy):
    surface, origin = SURFACES[name], np.array([x, y, z])
    assume(Scene(eye=EYE, surface=surface).depth(origin) > 0.0)
    direction = np.array([dx, dy, -1.0]) / math.sqrt(dx * dx + dy * dy + 1.0)
    point = surface.intersect(EYE, origin, direction)
    np.testing.assert_allclose(np.cross(point - origin, direction), 0.0, atol=1e-12)
    assert (point - origin) @ direction > 0.0
    assert float(Scene(eye=EYE, surface=surface).depth(point)) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", SURFACES)
def test_every_pixel_of_the_camera_sees_the_far_wall(name):
    scene = Scene(eye=EYE, surface=SURFACES[name], camera=Camera(resolution=60))
    x, y = np.meshgrid(np.arange(60) + 0.5, np.arange(60) + 0.5)
    rays = scene.camera.rays(np.stack([x, y], axis=-1)).directions
    points = scene.surface.intersect(scene.eye, scene.camera.centre, rays)
    assert points.shape == (60, 60, 3)
    np.testing.assert_allclose(scene.depth(points), 0.0, atol=1e-9)
    assert points[..., 2].max() < 5.0


def test_a_ray_past_the_eye_and_one_that_begins_outside_meet_nothing():
    for surface in SURFACES.values():
        misses = surface.intersect(EYE, np.array([[0.0, 20.0, 100.0], [3.0, 0.0, -5.0]]), np.array([0.0, 0.0, -1.0]))
        assert np.isnan(misses[0]).all()
    raised = SURFACES["bumps"].intersect(EYE, [3.0, 0.0, -5.0], [0.0, 0.0, -1.0])
    assert np.isnan(raised).all()


def test_depth_counts_bumps_maps_and_ellipsoid_in():
    tip = np.array([0.0, 0.0, 0.5])
    assert float(Scene().depth(tip)) == pytest.approx(0.5)
    assert float(Scene(surface=Surface(bumps=(Bump(x=0.0, y=0.0),))).depth(tip)) == pytest.approx(0.4)
    even = ReliefMap(kind="csv", file="even.csv", width=4.0, unit=0.1, points=((2.0,) * 4,) * 4)
    assert float(Scene(surface=Surface(height_map=even)).depth(tip)) == pytest.approx(0.3)
    above = np.array([0.0, 0.0, 25.0])
    assert float(Scene().depth(above)) < 0.0 < float(Scene(surface=Surface(semi_axes=(1.0, 1.0, 1.1))).depth(above))
    np.testing.assert_allclose(Scene().depth(np.array([tip, above])), [0.5, -1.0])


def test_the_height_map_is_the_spline_through_its_nodes():
    """Against scipy's tensor spline with flat ends; rows run from +y down, columns from -x to +x."""
    rows, columns = len(DRUSEN.points), len(DRUSEN.points[0])
    pitch = 8.0 / (columns - 1)
    x = 0.3 + (np.arange(columns) - (columns - 1) / 2.0) * pitch
    y = -0.2 - (np.arange(rows) - (rows - 1) / 2.0) * pitch
    nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    heights = np.array(DRUSEN.points) * 1e-3
    np.testing.assert_allclose(DRUSEN.at(nodes)[0], heights.ravel(), atol=1e-14)

    at = np.column_stack([RNG.uniform(x[0], x[-1], 200), RNG.uniform(y[-1], y[0], 200)])
    by_row = CubicSpline(x, heights, axis=1, bc_type="clamped")(at[:, 0])
    expected = np.diagonal(CubicSpline(y[::-1], by_row[::-1], bc_type="clamped")(at[:, 1]))
    np.testing.assert_allclose(DRUSEN.at(at)[0], expected, atol=1e-14)


def test_beyond_its_border_the_height_map_goes_on_without_a_kink():
    edge = 0.3 + 4.0
    arc = np.array([[edge - 1e-7, 0.1], [edge + 1e-7, 0.1], [edge + 2.0, 0.1]])
    height, slope = DRUSEN.at(arc)
    np.testing.assert_allclose(height, height[0], atol=1e-12)
    np.testing.assert_allclose(slope, [slope[0]] * 3, atol=1e-5)


def test_arc_coordinates_of_the_map_are_lengths_along_the_retina():
    peak = np.zeros((9, 9))
    peak[4, 6] = 100.0
    surface = Surface(height_map=ReliefMap(kind="csv", file="peak.csv", width=4.0, points=peak.tolist()))
    angle = 1.0 / 12.5  # two columns of 0.5 mm to the right of the middle
    assert float(surface.displacement(EYE, [math.sin(angle), 0.0, -math.cos(angle)])) == pytest.approx(0.1, abs=1e-12)


def test_no_surface_is_higher_than_its_relief_says():
    for name in ("bumps", "height map"):
        d = directions(5000, 0.3)
        assert np.abs(SURFACES[name].displacement(EYE, d)).max() <= SURFACES[name].relief < 0.5
    assert SURFACES["ellipsoid"].relief == 0.0


def scene_file(tmp_path, surface, csv=None):
    if csv is not None:
        (tmp_path / "map.csv").write_text(csv)
    (tmp_path / "scene.yaml").write_text(f"eye: {{radius: 12 mm}}\nsurface: {surface}\n")
    return read_scene(read_document(tmp_path / "scene.yaml"))


MAP = "{height_map: {kind: csv, file: map.csv, width: 6 mm, unit: 1 um}}"
MATRIX = "# drusen\n" + "0, 10, 20, 30\n" * 4


def test_a_file_describes_all_of_it(tmp_path):
    scene = scene_file(
        tmp_path,
        "{semi_axes: [1, 1, 1.1], bumps: [{x: 1 mm, y: 0 mm}],"
        " height_map: {kind: csv, file: map.csv, width: 6 mm, unit: 2 um, x: 0.5 mm}}",
        MATRIX,
    )
    assert scene.surface.semi_axes == (1.0, 1.0, 1.1)
    assert scene.surface.height_map.points == ((0.0, 10.0, 20.0, 30.0),) * 4
    np.testing.assert_allclose(scene.surface.height_map.at(np.array([[3.5, 0.0]]))[0], 0.06)
    assert Scene.model_validate(scene.model_dump()) == scene


def test_what_the_map_holds_counts_not_what_its_file_is_called(tmp_path):
    first = scene_file(tmp_path, MAP, MATRIX).surface
    other = scene_file(tmp_path, MAP, MATRIX.replace("30", "31")).surface
    assert identity(first) != identity(other)
    assert identity(first) == identity(scene_file(tmp_path, MAP, MATRIX.replace("# drusen\n", "")).surface)


@pytest.mark.parametrize(
    ("csv", "said"),
    [
        ("0,0,0,0\n0,0,zero,0\n", r"map.csv:2: expected heights separated by commas"),
        ("0,0,0,0\n0,nan,0,0\n", r"map.csv:2: heights must be finite"),
        ("0,0,0,0\n0,1e999,0,0\n", r"map.csv:2: heights must be finite"),
        ("0,0,0,0\n\n0,0,0\n", r"map.csv:3: 3 heights where the first row has 4"),
        ("0,0,0,0\n" * 3, r"needs 4 to 512 equally long rows and columns"),
        ("", r"needs 4 to 512 equally long rows and columns"),
        ("0," * 600 + "0\n", r"map.csv:1: a height map has at most 512"),
        ("0,0,0,0\n" * 600, r"map.csv:513: a height map has at most 512"),
        ("0,9000,9000,0\n" * 4, r"rises or sinks by up to 12 mm, over half the eye's radius"),
        ("0,1e308,-1e308,0\n" * 4, r"map.csv: heights must be finite and below 100 mm"),
        (None, r"map.csv: cannot be read as CSV"),
    ],
)
def test_a_map_that_cannot_be_used_is_refused_in_one_sentence(tmp_path, csv, said):
    with pytest.raises(InputError, match=said) as error:
        scene_file(tmp_path, MAP, csv)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("surface", "said"),
    [
        ("{semi_axes: [1, 1, 3]}", "less than 2"),
        ("{semi_axes: [12 mm, 12 mm, 13 mm]}", "number"),
        ("{height_map: {kind: png, file: map.csv, width: 6 mm}}", "csv"),
        ("{height_map: {kind: csv, file: map.csv, width: 60 mm}}", "beyond the lower half of the eye"),
        ("{height_map: {kind: csv, file: map.csv, width: 6}}", "no unit"),
        ("{ellipsoid: [1, 1, 1]}", "unknown key 'ellipsoid'"),
    ],
)
def test_a_surface_that_cannot_be_is_refused(tmp_path, surface, said):
    with pytest.raises(InputError, match=said):
        scene_file(tmp_path, surface, MATRIX)


def test_interreflection_is_refused_off_the_sphere():
    with pytest.raises(ValueError, match="interreflection is worked out in a sphere"):
        Scene(surface=SURFACES["ellipsoid"], interreflection={})
    assert Scene(surface=SURFACES["bumps"], interreflection={}).interreflection is not None


def test_surfaces_are_called_what_they_are_made_of():
    assert surface_name(load_scene("paper").surface) == "smooth"
    assert surface_name(bump_grid()) == "bumps"
    assert surface_name(KNOWN["bumps-literal"]) == "bumps-literal"
    assert surface_name(Surface(bumps=(Bump(x=0.0, y=0.0),))) == "1 bump"
    assert surface_name(Surface(semi_axes=(1.0, 1.0, 1.08))) == "ellipsoid 1 x 1 x 1.08"
    assert surface_name(SURFACES["height map"]) == "height map"
    assert surface_name(SURFACES["all"]) == "ellipsoid 1.03 x 0.97 x 1.1 with 15 bumps and height map"


def test_a_new_eye_radius_scales_the_ellipsoid():
    d = directions(50)
    np.testing.assert_allclose(
        1.2 * SURFACES["ellipsoid"].points(Eye(radius=10.0), d), SURFACES["ellipsoid"].points(Eye(radius=12.0), d)
    )
