import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conespot.localize.published.ellipse import fit_ellipse


def points_on(centre, a, b, angle, count=90, arc=2 * np.pi):
    t = np.arange(count) * arc / count
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.asarray(centre) + np.column_stack([a * np.cos(t), b * np.sin(t)]) @ turn.T


@given(
    st.tuples(st.floats(-5, 5), st.floats(-5, 5)),
    st.floats(0.2, 3.0),
    st.floats(0.3, 0.999),
    st.floats(0.0, np.pi),
    st.floats(2.0, 2 * np.pi),
)
def test_points_of_an_ellipse_give_it_back(centre, a, ratio, angle, arc):
    found = fit_ellipse(points_on(centre, a, a * ratio, angle, arc=arc))
    assert found.centre == pytest.approx(centre, abs=1e-6)
    assert (found.a, found.b) == pytest.approx((a, a * ratio), abs=1e-6)
    along = found.major @ [np.cos(angle), np.sin(angle)]
    assert abs(along) == pytest.approx(1.0, abs=1e-5)


def test_it_is_the_fit_of_opencv_that_the_authors_used():
    pixels = np.round(points_on((2612.3, 2381.9), 431.0, 407.5, 0.7, count=900))
    found = fit_ellipse(pixels)
    (x, y), (minor, major), _ = cv2.fitEllipse(pixels.astype(np.float32).reshape(-1, 1, 2))
    assert (*found.centre, found.a, found.b) == pytest.approx((x, y, major / 2, minor / 2), abs=2e-3)


def test_the_major_semi_axis_is_never_the_smaller():
    circle = points_on((0, 0), 1.0, 1.0, 0.0) + np.random.default_rng(0).normal(0, 1e-3, (90, 2))
    found = fit_ellipse(circle)
    assert found.a >= found.b


@pytest.mark.parametrize(
    "points",
    [
        points_on((0, 0), 1.0, 0.5, 0.0)[:4],
        np.zeros((20, 2)),
        np.column_stack([np.arange(20.0), 2 * np.arange(20.0)]),
        np.column_stack([np.arange(-9.5, 10.0), np.arange(-9.5, 10.0) ** 2]),
        np.array([(s * np.cosh(t), np.sinh(t)) for s in (1, -1) for t in np.linspace(-1, 1, 20)]),
    ],
    ids=["four points", "one point", "line", "parabola", "hyperbola"],
)
def test_what_is_no_ellipse_gives_none(points):
    assert fit_ellipse(points) is None
