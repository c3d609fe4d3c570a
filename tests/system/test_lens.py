"""Frames through a lens: depth of field, and what is left of a hard rim."""

import math

import cv2
import numpy as np
import pytest
from scipy.stats import ncx2

from conespot.render import Renderer, kernel
from conespot.render.rays import RayGenerator
from conespot.scene import Camera, Scene
from conespot.scene.beam import HardBeam
from conespot.scene.lens import Lens
from conespot.scene.optics import Optics
from conespot.scene.point_spread import GaussianSpread
from conespot.scene.retina import UniformRetina
from conespot.scene.spotlights import Instrument

needs_jit = pytest.mark.skipif(
    not kernel.load()[2].vectorized, reason="the scalar variant has Mitsuba's own sensor, which is a plain pinhole"
)


def scene_of(lens, half_angle_deg=9.0, **camera):
    return Scene(
        camera=Camera(**{"resolution": 1000, "lens": lens, **camera}),
        retina=UniformRetina(albedo=0.1),
        beam=HardBeam(half_angle=math.radians(half_angle_deg)),
        instrument=Instrument(rcm=(0.0, 0.0, 22.0)),  # over the pole, so that a patch may be a disc
    )


def moments(tile):
    """Sum, centre (x, y) and mean variance along an axis of a tile's light [px]."""
    image = tile.radiance[..., 0].astype(float)
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    total = image.sum()
    centre = np.array([(image * x).sum(), (image * y).sum()]) / total
    spread = (image * ((x - centre[0]) ** 2 + (y - centre[1]) ** 2)).sum() / total / 2.0
    return total, centre + 0.5 + [tile.crop.column, tile.crop.row], spread


@needs_jit
@pytest.mark.parametrize("optics", [None, Optics(contact="flat")])
def test_the_renderers_rays_are_those_of_the_camera_all_over_the_pupil(optics):
    """Pixels and places in the pupil at random, aslant, with and without the eye's optics; against `Camera.rays`."""
    mi, dr, _ = kernel.load()
    lens = Lens(aperture=8.0, focus=1.0)
    camera = Camera(resolution=400, tilt=0.08, azimuth=0.5, roll=0.3, optics=optics, lens=lens)
    rng = np.random.default_rng(0)
    pixels = rng.uniform(150.0, 250.0, (500, 2)).astype(np.float32).astype(float)
    place = (rng.uniform(-0.7, 0.7, (500, 2))).astype(np.float32).astype(float)
    wavelengths = dr.full(mi.Spectrum, 589.3, 500)
    cast, seen = RayGenerator(camera, 60.0).rays(
        *(mi.Float(part) for part in pixels.T), wavelengths, mi.Point2f(*(mi.Float(part) for part in place.T))
    )
    rays = camera.rays(pixels, pupil=4.0 * place)
    through = np.isfinite(rays.directions[:, 0])
    assert through.sum() > 300
    np.testing.assert_array_equal(np.broadcast_to(np.array(seen), 500), through)
    directions, origins = np.array(cast.d).T[through], np.array(cast.o).T[through]
    np.testing.assert_allclose(directions, rays.directions[through], rtol=0.0, atol=3e-6)
    beside = np.cross(origins - rays.origins[through], rays.directions[through])
    assert np.abs(beside).max() < 3e-4


@needs_jit
@pytest.mark.parametrize("focus", [0.5, 1.0, 2.0, 3.0, 4.0])
def test_blur_of_a_small_patch_is_the_circle_of_confusion(focus):
    """A patch of 10 px at the pole with the lens in focus above it; diameter of its blur, by second moments over the
    sharp patch, against a (s' - s) / s in the plane of the patch: 2 %.

    A uniform disc of diameter c has the variance c^2 / 16 along an axis.
    """
    pose_at = np.array([0.0, 0.0, 1.5])
    tiles = []
    for lens in (None, Lens(aperture=11.0, focus=focus)):
        scene = scene_of(lens, half_angle_deg=2.5)
        tiles.append(Renderer(scene, samples=1024, noise=0.0).tile(scene.pose(pose_at), 0, seed=1))
    (light, at, sharp), (spread_light, moved, wide) = (moments(tile) for tile in tiles)
    geometric = 11.0 * focus / (110.0 - focus) / scene.camera.pixel_pitch
    assert 4.0 * math.sqrt(wide - sharp) == pytest.approx(geometric, rel=0.02)
    assert spread_light == pytest.approx(light, rel=0.01)
    np.testing.assert_allclose(moved, at, atol=0.1)


def test_a_hard_rim_through_a_gaussian_is_in_closed_form():
    """A patch straight below the tip through sigma = 2 px: a disc convolved with a Gaussian, which is a noncentral
    chi-squared distribution; against the tile along its radius to 1 % of the step. No light is lost.
    """
    tiles = []
    pitch = Camera(resolution=400).pixel_pitch
    for blur in (None, GaussianSpread(sigma=2.0 * pitch)):
        scene = scene_of(Lens(blur=blur), resolution=400)
        tiles.append(Renderer(scene, samples=64, noise=0.0).tile(scene.pose(np.array([0.0, 0.0, 5.0])), 0, seed=1))
    sharp, found = (tile.radiance[..., 0].astype(float) for tile in tiles)
    assert found.sum() == pytest.approx(sharp.sum(), rel=1e-5)
    radius = math.sqrt((sharp > 0.5 * sharp.max()).sum() / math.pi)
    crop = tiles[1].crop
    y, x = np.mgrid[: crop.height, : crop.width]
    r = np.hypot(x + crop.column + 0.5 - 200.0, y + crop.row + 0.5 - 200.0)
    variance = 2.0**2 + 1.0 / 12.0  # and a pixel's own
    expected = ncx2.cdf(radius**2 / variance, 2, r**2 / variance)
    step = np.median(sharp[sharp > 0.5 * sharp.max()])
    rim = np.abs(r - radius) < 8.0
    means = [np.mean((found / step - expected)[rim & (np.round(r - radius) == k)]) for k in range(-7, 8)]
    assert np.abs(means).max() < 0.01


@needs_jit
@pytest.mark.parametrize("sigma", [0.2, 0.6])
def test_a_gaussian_narrower_than_pixels_leaves_a_rim_where_it_is(sigma):
    """A disc through a Gaussian of so many pixels; against one drawn with 16 x 16 places a pixel and blurred there, to
    0.6 % of the step, rms over single pixels of the rim. Weights of whole pixels would leave 1.3 %.
    """
    fine, side = 16, 400
    shown = slice(side // 2 - 50, side // 2 + 50)
    pitch = Camera(resolution=side).pixel_pitch
    scene = scene_of(Lens(blur=GaussianSpread(sigma=sigma * pitch)), resolution=side)
    pose = scene.pose(np.array([0.0, 0.0, 5.0]))
    radius = np.linalg.norm(scene.camera.project(scene.outline(pose, 0)) - side / 2.0, axis=-1).mean()
    assert radius < 45.0
    tile = Renderer(scene, samples=1024, noise=0.0).tile(pose, 0, seed=1)
    found = np.zeros((side, side))
    found[tile.crop.slices] = tile.radiance[..., 0]
    found = found[shown, shown]
    y, x = (np.mgrid[: 100 * fine, : 100 * fine] + 0.5) / fine - 50.0
    drawn = cv2.GaussianBlur((np.hypot(x, y) < radius).astype(np.float32), (0, 0), sigma * fine)
    expected = drawn.reshape(100, fine, 100, fine).mean(axis=(1, 3))
    y, x = np.mgrid[:100, :100] + 0.5 - 50.0
    off = np.hypot(x, y) - radius
    step = np.median(found[(off < -2.0) & (off > -4.0)])
    assert np.sqrt(np.mean((found / step - expected)[np.abs(off) < 1.0] ** 2)) < 0.006


@needs_jit
def test_pixels_that_the_rim_is_smeared_over_are_not_left_to_few_samples():
    """The edge out of focus: mean over runs with a pilot of four, against all samples everywhere; light to 0.3 %."""
    scene = scene_of(Lens(aperture=11.0, focus=3.0), resolution=500)
    pose = scene.pose(np.array([0.8, -0.5, 5.0]))
    adaptive, full = (
        np.mean([renderer.tile(pose, 0, seed=i).radiance for i in range(4)], axis=0)[..., 0]
        for renderer in (Renderer(scene, samples=16), Renderer(scene, samples=256, noise=0.0))
    )
    assert adaptive.sum(dtype=float) == pytest.approx(full.sum(dtype=float), rel=0.003)
    # a sixteenth of one sample in a pixel that the smeared rim barely enters would stand out
    assert np.abs(adaptive - full).max() < 0.15 * full.max()


@needs_jit
def test_the_background_is_seen_through_the_same_lens():
    """Differences of neighbouring pixels of a fundus, sharp and with each part of a lens; sums agree to 1 %."""
    pictures = {}
    for name, lens in {
        "sharp": None,
        "aperture": Lens(aperture=11.0, focus=4.0),
        "blur": Lens(blur=GaussianSpread(sigma=0.05)),
        "glare": Lens(glare=0.5),
    }.items():
        scene = Scene(camera=Camera(resolution=200, lens=lens))
        pictures[name] = Renderer(scene).background()[..., 0].astype(float)
    for name in ("aperture", "blur", "glare"):
        assert pictures[name].mean() == pytest.approx(pictures["sharp"].mean(), rel=0.01)
        assert np.diff(pictures[name]).std() < 0.8 * np.diff(pictures["sharp"]).std()
    assert pictures["glare"].std() == pytest.approx(0.5 * pictures["sharp"].std(), rel=1e-4)


def test_the_scalar_variant_refuses_an_aperture(monkeypatch):
    """One sentence in place of a frame in which all is sharp."""
    chosen = kernel.load()
    scalar = kernel.Kernel("scalar_spectral", "", "", chosen[2].mitsuba, chosen[2].drjit)
    monkeypatch.setattr(kernel, "load", lambda: (chosen[0], chosen[1], scalar))
    with pytest.raises(kernel.KernelError, match="a lens with an aperture needs a JIT variant"):
        Renderer(scene_of(Lens(aperture=8.0)))
