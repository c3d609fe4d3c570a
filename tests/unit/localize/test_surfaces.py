"""Known surfaces that are no sphere: what pixels see of them, and the tip from an outline on them."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from conespot.localize.model.forward import moved
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.outline import fit_outline
from conespot.localize.model.sight import look
from conespot.localize.theory.bounds import smoothed_over
from conespot.scene.beam import HardBeam
from conespot.scene.camera import Camera
from conespot.scene.height_map import ReliefMap
from conespot.scene.scene import Scene
from conespot.scene.surface import Bump, Surface, bump_grid

FREE = Knowns(rcm_sigma_mm=None)
#: heights of 0 to 60 um over 10 mm, blurred by nothing but the spline: slopes up to 0.2
DRUSEN = ReliefMap(
    kind="csv", file="drusen.csv", width=10.0, points=np.random.default_rng(1).uniform(0.0, 60.0, (25, 25)).tolist()
)
SURFACES = {
    "ellipsoid": Surface(semi_axes=(1.03, 0.97, 1.1)),
    "flat ellipsoid": Surface(semi_axes=(1.05, 1.0, 0.9)),
    "bump": Surface(bumps=(Bump(x=0.4, y=0.3, diameter=3.0, height=0.1),)),
    "bumps": bump_grid(),
    "height map": Surface(height_map=DRUSEN),
    "all": Surface(semi_axes=(1.03, 0.97, 1.1), bumps=bump_grid().bumps, height_map=DRUSEN),
}


def scene_on(name, **parts):
    return Scene(**{"surface": SURFACES[name], "camera": Camera(resolution=1000), "beam": HardBeam(), **parts})


@pytest.mark.parametrize("name", SURFACES)
def test_what_a_pixel_sees_moves_with_it_as_finite_differences_say(name):
    scene = scene_on(name)
    pixels = np.random.default_rng(2).uniform(150.0, 850.0, (2000, 2))
    h = 1e-3
    seen = look(scene, pixels, 3.0)
    by_x, by_y = (
        3.0 * (look(scene, pixels + step).points - look(scene, pixels - step).points) / (2.0 * h)
        for step in (np.array([h, 0.0]), np.array([0.0, h]))
    )
    np.testing.assert_allclose(scene.camera.project(seen.points), pixels, atol=1e-9)
    np.testing.assert_allclose(scene.depth(seen.points), 0.0, atol=1e-9)
    # a bump's curvature steps at its foot
    np.testing.assert_allclose(seen.along_x, by_x, atol=3e-6)
    np.testing.assert_allclose(seen.along_y, by_y, atol=3e-6)
    np.testing.assert_allclose(np.linalg.norm(seen.normals, axis=1), 1.0, atol=1e-12)
    for along in (seen.along_x, seen.along_y):
        np.testing.assert_allclose(np.sum(along * seen.normals, axis=1), 0.0, atol=1e-12)


def test_a_sphere_by_another_name_is_seen_as_the_sphere():
    """The closed form's fast path against the general one, which a bump out of sight chooses."""
    pixels = np.random.default_rng(2).uniform(0.0, 1000.0, (500, 2))
    far = Surface(bumps=(Bump(x=10.0, y=0.0),))
    plain, general = (look(Scene(surface=s, camera=Camera(resolution=1000)), pixels) for s in (Surface(), far))
    for field, value in vars(plain).items():
        np.testing.assert_allclose(getattr(general, field), value, atol=1e-11)


def fitted(scene, pose, believed=None):
    pixels = scene.camera.project(scene.outline(pose, 0, 400))
    return fit_outline(pixels, believed or scene, knowns=FREE, robust=False)


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(
    name=st.sampled_from(list(SURFACES)),
    x=st.floats(-4.0, 4.0),
    y=st.floats(-4.0, 4.0),
    z=st.floats(1.0, 8.0),
    half_angle=st.floats(5.0, 15.0),
    port=st.floats(0.0, 360.0),
    turn=st.tuples(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02)),
)
def test_a_noise_free_outline_on_a_known_surface_gives_the_tip_to_a_nanometre(name, x, y, z, half_angle, port, turn):
    rcm = (6.0 * math.cos(math.radians(port)), 6.0 * math.sin(math.radians(port)), 22.0)
    scene = scene_on(name, instrument={"rcm": rcm}, beam=HardBeam(half_angle=math.radians(half_angle)))
    apex = np.array([x, y, z])
    assume(scene.depth(apex) > 1.0)
    pose = moved(scene.pose(apex), np.array([0.0, 0.0, 0.0, *turn]))  # off the RCM
    fit = fitted(scene, pose)
    assert fit is not None
    assert np.linalg.norm(fit.estimate.pose.apex - apex) < 1e-6
    assert np.arccos(min(1.0, fit.estimate.pose.axis @ pose.axis)) < 1e-6


def test_an_ellipsoid_taken_for_a_sphere_moves_the_tip_as_the_theory_says():
    """A whole fit that believes in the sphere, against the theory's one step, for an eye 0.24 mm longer than wide."""
    scene = scene_on("ellipsoid", surface=Surface(semi_axes=(1.0, 1.0, 1.01)))
    sphere = scene_on("ellipsoid", surface=Surface())
    for apex in ([0.0, 0.0, 4.0], [2.0, -1.0, 5.0]):
        pose = scene.pose(np.array(apex))
        fit = fitted(scene, pose, believed=sphere)
        step = smoothed_over(scene, pose, rcm=False)[:3]
        np.testing.assert_allclose(fit.estimate.pose.apex - pose.apex, step, atol=0.1 * np.linalg.norm(step))
        assert 0.004 < np.linalg.norm(step) < 0.008  # a micrometre for 0.04 mm of length
