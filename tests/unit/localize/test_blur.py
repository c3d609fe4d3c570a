"""Blur in the model: profiles under it against quadrature, light against spread pictures, fits that find it."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

from conespot.localize import Knowns, SensorNoise, locate
from conespot.localize.model.forward import light
from conespot.localize.model.profile import Profile
from conespot.localize.model.sight import look, window
from conespot.localize.model.smooth import smoothed
from conespot.localize.theory.bounds import cramer_rao
from conespot.scene.beam import CyclesBeam, HardBeam, LinearBeam, TabulatedBeam
from conespot.scene.camera import Camera
from conespot.scene.lens import Lens
from conespot.scene.motion import Velocity
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.sensor import Linear

BEAMS = [
    HardBeam(),
    CyclesBeam(),
    CyclesBeam(blend=0.1),
    LinearBeam(),
    TabulatedBeam(angles=(0.0, 0.1, 0.157), intensities=(1.0, 0.7, 0.2)),
]
TIP = np.array([1.0, 0.5, 4.0])


def camera(resolution, blur_px=0.0):
    plain = Camera(resolution=resolution)
    return Camera(resolution=resolution, lens=Lens(blur=blur_px * plain.pixel_pitch)) if blur_px else plain


def kernel(distribution, reach, step):
    """Weights at multiples of `step` of what lies between their middles."""
    edges = (np.arange(-int(reach / step) - 1, int(reach / step) + 3) - 0.5) * step
    weights = np.diff(distribution(edges))
    return weights / weights.sum()


def disc(x):
    x = np.clip(x, -1.0, 1.0)
    return 0.5 + (x * np.sqrt(1.0 - x * x) + np.arcsin(x)) / np.pi


@pytest.mark.parametrize("beam", BEAMS, ids=lambda beam: beam.words)
@pytest.mark.parametrize(("sigma", "radius"), [(0.1, 0.0), (0.45, 0.0), (0.55, 0.0), (3.0, 0.0), (0.5, 3.0)])
def test_a_profile_under_pixel_gaussian_and_disc_is_what_quadrature_says(beam, sigma, radius):
    profile = Profile.of(beam)
    unit = 1e-4  # of w, as a pixel's side
    px, py, step = 0.4 * unit, 0.3 * unit, unit / 256.0
    w = profile.knots[0] + np.arange(-8.0, 8.0, 0.1) * unit
    # so that a knot lies between two places
    fine = profile.knots[0] + (np.arange(-30 * 256, 30 * 256) + 0.5) * step
    g = profile.value(fine)
    for reach, distribution in [
        (px, lambda x: np.clip((x / px + 1.0) / 2.0, 0.0, 1.0)),
        (py, lambda x: np.clip((x / py + 1.0) / 2.0, 0.0, 1.0)),
        (6.0 * sigma * unit, lambda x: ndtr(x / (sigma * unit))),
        (max(radius, 0.02) * unit, lambda x: disc(x / (max(radius, 0.02) * unit))),
    ]:
        g = np.convolve(g, kernel(distribution, reach, step), "same")
    same = np.ones_like(w)
    found = smoothed(profile, w, px * same, py * same, (sigma * unit) ** 2 * same, radius * unit * same)
    np.testing.assert_allclose(found.mean, np.interp(w, fine, g), atol=4e-3 if radius else 5e-4)
    sides = [
        smoothed(profile, w + e, px * same, py * same, (sigma * unit) ** 2 * same, radius * unit * same)
        for e in (1e-7, -1e-7)
    ]
    np.testing.assert_allclose(found.slope, (sides[0].mean - sides[1].mean) / 2e-7, atol=1e-4 / unit)
    np.testing.assert_allclose(found.curvature, (sides[0].slope - sides[1].slope) / 2e-7, atol=1e-4 / unit**2)


def cast(scene, places, low, size, fine):
    """Irradiance `[fine * h, fine * w]`, the mean over tips and axes, on a grid of `fine` places a pixel's side."""
    x, y = (low[k] + (np.arange(size[k] * fine) + 0.5) / fine for k in (0, 1))
    rays = scene.camera.rays(np.stack(np.meshgrid(x, y), axis=-1)).directions
    points = scene.surface.intersect(scene.eye, scene.camera.centre, rays)
    normals = (scene.eye.centre - points) / scene.eye.radius
    total = 0.0
    for apex, axis in places:
        to = points - apex
        d = np.linalg.norm(to, axis=-1)
        total = total + scene.beam.intensity(to @ axis / d) * -np.sum(normals * to, axis=-1) / d**3
    return total / len(places)


def pixels(picture, fine):
    height, width = picture.shape
    return picture.reshape(height // fine, fine, width // fine, fine).mean(axis=(1, 3)).ravel()


def compared(scene, pose, places, sigma, fine):
    """How far the model is off a spread picture: at most, over the peak; what of it a fit takes for the tip [mm]."""
    outline = scene.camera.project(scene.outline(pose, 0))
    low = np.floor(outline.min(axis=0)).astype(int) - 12
    size = np.ceil(outline.max(axis=0)).astype(int) + 12 - low
    picture = cast(scene, places, low, size, fine)
    expected = pixels(gaussian_filter(picture, sigma * fine, truncate=5.0) if sigma else picture, fine)
    found = light(look(scene, window(low[1], low[0], size[1], size[0])), pose, scene, Profile.of(scene.beam))
    columns = np.column_stack([found.jacobian[:5].T, found.value, np.ones_like(found.value)])
    scale = np.linalg.norm(columns, axis=0)
    off = np.linalg.lstsq(columns / scale, expected - found.value, rcond=None)[0] / scale
    return np.max(np.abs(found.value - expected)) / found.value.max(), float(np.linalg.norm(off[:3]))


@pytest.mark.parametrize("beam", [HardBeam(), CyclesBeam(), CyclesBeam(blend=0.3)], ids=lambda beam: beam.words)
@pytest.mark.parametrize("sigma", [0.4, 2.0])
def test_a_blurred_patch_is_what_a_blurred_picture_shows(beam, sigma):
    scene = Scene(beam=beam, camera=camera(600, sigma))
    pose = scene.pose(TIP)
    most, tip = compared(scene, pose, [(pose.apex, pose.axis)], sigma, 10)
    # what is left of the hard edge is the picture's own grid
    assert most < ((0.03 if sigma < 1.0 else 5e-3) if beam.softness is None else 3e-3)
    assert tip < 3e-3


def test_a_core_is_the_mean_over_its_points():
    scene = Scene(beam=CyclesBeam(blend=0.3, source_diameter=0.1), camera=Camera(resolution=500))
    pose = scene.pose(TIP)
    number = 150
    radius, angle = 0.05 * np.sqrt((np.arange(number) + 0.5) / number), np.arange(number) * 2.399963
    u, v = pose.rotation()[:, 0], pose.rotation()[:, 1]
    tips = pose.apex + np.outer(radius * np.cos(angle), u) + np.outer(radius * np.sin(angle), v)
    most, tip = compared(scene, pose, [(apex, pose.axis) for apex in tips], 0.0, 3)
    assert most < 3e-3
    assert tip < 1e-3


def test_a_moving_patch_is_the_mean_over_its_way():
    still = Scene(beam=CyclesBeam(blend=0.3), camera=Camera(resolution=500))
    scene = still.model_copy(update={"motion": Velocity(velocity=(6.0, -6.0, 4.0), exposure=0.008)})
    pose = still.pose(TIP)
    way = [np.array([6.0, -6.0, 4.0]) * t for t in ((np.arange(60) + 0.5) / 60 - 0.5) * 0.008]
    places = [Pose.through(pose.apex + off, still.instrument.rcm) for off in way]
    most, tip = compared(scene, pose, [(place.apex, place.axis) for place in places], 0.0, 3)
    assert most < 0.01
    assert tip < 2e-3


def photograph(scene, pose, sigma, seed):
    """A noisy frame of 12 bits, 9000 electrons at the peak."""
    outline = scene.camera.project(scene.outline(pose, 0))
    low = np.floor(outline.min(axis=0)).astype(int) - 20
    size = np.ceil(outline.max(axis=0)).astype(int) + 20 - low
    seen = pixels(gaussian_filter(cast(scene, [(pose.apex, pose.axis)], low, size, 12), sigma * 12), 12)
    electrons = np.full(scene.camera.shape, 200.0)
    patch = electrons[low[1] : low[1] + size[1], low[0] : low[0] + size[0]]
    patch += 9000.0 * seen.reshape(size[::-1]) / seen.max()
    rng = np.random.default_rng(seed)
    electrons = rng.poisson(electrons) + 15.0 * rng.standard_normal(electrons.shape)
    return np.clip(np.round(electrons / 11250.0 * 4095.0), 0, 4095).astype(np.uint16)


@pytest.mark.parametrize("told", [0.0, 3.5])
def test_a_hard_edge_is_found_through_a_blur_whatever_is_told_of_it(told):
    scene = Scene(beam=HardBeam(), camera=camera(500, 2.0), sensor=Linear(bits=12))
    noise = SensorNoise(levels=4095, electrons=11250.0, read=15.0)
    pose = scene.pose(TIP)
    frame = photograph(scene, pose, 2.0, 1)
    believed = scene.model_copy(update={"camera": camera(500, told)})
    bound = cramer_rao(scene, pose, knowns=Knowns()).position_mm
    found = locate(frame, believed, "cone", noise=noise)
    assert found, found.reason
    assert np.linalg.norm(found.apex_mm - pose.apex) < 4.0 * bound
    held = locate(frame, believed, "cone", knowns=Knowns(blur_sigma_mm=0.0), noise=noise)
    assert not held or np.linalg.norm(held.apex_mm - pose.apex) > 4.0 * bound


def test_a_blur_costs_the_bound_little_and_not_to_know_it_nothing():
    # by an independent sum: 0.74, 0.95 and 1.27 um for 5, 10 and 20 um
    for blur, expected in [(5.0, 0.74), (10.0, 0.95), (20.0, 1.27)]:
        scene = Scene(beam=HardBeam(), camera=Camera(resolution=1000, lens=Lens(blur=1e-3 * blur)))
        pose = scene.pose(np.array([0.0, 0.0, 4.0]))
        unknown, known = (
            1e3 * cramer_rao(scene, pose, knowns=Knowns(None, blur_sigma_mm=sigma)).position_mm for sigma in (None, 0.0)
        )
        assert unknown == pytest.approx(expected, rel=0.03)
        assert unknown == pytest.approx(known, rel=0.01)
