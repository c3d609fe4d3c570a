import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conespot.localize.theory.conic import ConeSphere, table_1, volume_distance
from conespot.scene import Eye

PAPER = {5: 0.08, 7: 0.23, 9: 0.49, 11: 0.91, 13: 1.51, 15: 2.34}

cones = st.builds(
    lambda beta, distance, lean: ConeSphere(beta, distance * math.sin(lean), -distance * math.cos(lean), 12.0),
    st.floats(math.radians(5), math.radians(15)),
    st.floats(0.5, 10.5),
    st.floats(0.0, 0.7),
)


def inside(cone, count=41):
    low, high = cone.interval
    return low + (high - low) * np.linspace(0.0, 1.0, count)[1:-1]


@pytest.mark.parametrize("row", table_1(), ids=lambda row: f"{row.half_angle_deg:g} deg")
def test_table_1_is_the_papers(row):
    assert row.in_plane_um == pytest.approx(PAPER[round(row.half_angle_deg)], abs=0.02)


def test_in_space_the_curves_lie_further_apart_than_in_the_plane():
    rows = {round(row.half_angle_deg): row for row in table_1()}
    assert rows[9].distance_um == pytest.approx(3.12, abs=0.01)
    assert rows[9].volume_distance_um == pytest.approx(4.9, abs=0.05)
    assert rows[15].volume_distance_um == pytest.approx(14.4, abs=0.1)


def test_the_grid_over_the_volume_is_fine_enough():
    assert volume_distance(math.radians(9.0), cells=20) == pytest.approx(volume_distance(math.radians(9.0)), rel=0.005)


@given(cones)
def test_the_curve_lies_on_cone_and_sphere(cone):
    x = inside(cone)
    y, z = cone.curve(x)
    np.testing.assert_allclose(x**2 + y**2, (cone.slope * z) ** 2, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose((x - cone.x0) ** 2 + y**2 + (z - cone.z0) ** 2, cone.radius**2, rtol=1e-9)
    assert (z > 0).all()


@given(cones)
def test_the_ellipse_lies_on_the_cone_and_in_a_plane_through_the_curves_ends(cone):
    x = inside(cone)
    y, z = cone.ellipse(x)
    np.testing.assert_allclose(x**2 + y**2, (cone.slope * z) ** 2, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(np.diff(z, 2), 0.0, atol=1e-10)
    for end in cone.interval:
        assert cone.curve(end)[1] == pytest.approx(float(cone.ellipse(end)[1]), abs=1e-9)
        assert cone.curve(end)[0] == pytest.approx(0.0, abs=1e-5)


@given(cones)
def test_the_curve_is_where_the_cones_rays_meet_the_eye(cone):
    eye = Eye(radius=cone.radius)
    apex = eye.centre - [cone.x0, 0.0, cone.z0]
    phi = np.linspace(0.1, 3.0, 7)
    b = cone.half_angle
    rays = np.stack([np.sin(b) * np.cos(phi), np.sin(b) * np.sin(phi), np.full(7, np.cos(b))], axis=-1)
    met = eye.intersect(apex, rays)[:, None] * rays
    y, z = cone.curve(met[:, 0])
    np.testing.assert_allclose(np.column_stack([y, z]), met[:, 1:], atol=1e-6)


def test_a_cone_that_points_away_from_the_centre_cuts_a_circle():
    cone = ConeSphere(math.radians(9.0), 0.0, -7.0, 12.0)
    assert cone.in_plane_difference() < 1e-7
    assert cone.distance() < 1e-12


def test_what_has_no_curve_is_refused():
    with pytest.raises(ValueError, match="inside the sphere"):
        ConeSphere(math.radians(9.0), 12.0, -7.0, 12.0)
    with pytest.raises(ValueError, match="outside 0 to 45 deg"):
        table_1([math.radians(9.0), math.radians(90.0)])
