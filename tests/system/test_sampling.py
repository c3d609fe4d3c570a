"""Samples: where they are many, that they are unbiased, and that a pixel does not know of the others."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from scipy.stats import t

from conespot.render import Crop, Renderer
from conespot.render.rim import rim_pixels
from conespot.scene import Camera, Scene
from conespot.scene.beam import CyclesBeam, HardBeam, LinearBeam, TabulatedBeam
from conespot.scene.illumination import LIGHTS
from conespot.scene.retina import FundusSite, PhotoRetina, UniformRetina
from conespot.scene.surface import Bump, Surface

BEAMS = {
    "hard": HardBeam(),
    "soft": CyclesBeam(blend=1.0),
    "half soft": CyclesBeam(blend=0.4),
    "linear": LinearBeam(),
    "table": TabulatedBeam(angles=(0.0, math.radians(4.0), math.radians(9.0)), intensities=(1.0, 0.9, 0.1)),
}


def scene_of(**changes):
    return Scene(**{"camera": Camera(resolution=400), "retina": UniformRetina(albedo=0.1), **changes})


@pytest.mark.parametrize("bumps", [False, True])
def test_a_refined_edge_is_unbiased_and_leaves_no_noisy_pixel(bumps):
    """Tiles with 256 samples on the edge; against plain ones of 256 everywhere; z-test per pixel, Sidak-corrected.

    The scatter of each pixel over the runs must nowhere be above what 256 samples leave in the worst one.
    """
    surface = Surface(bumps=(Bump(x=1.9, y=-0.5, diameter=1.0, height=0.1),)) if bumps else Surface()
    scene = scene_of(beam=HardBeam(), surface=surface)
    pose = scene.pose(np.array([1.2, -0.7, 4.0]))
    runs = 16
    refined, plain, coarse = (
        np.stack([renderer.tile(pose, 0, seed=first + i).radiance[..., 0].astype(float) for i in range(runs)])
        for first, renderer in (
            (100, Renderer(scene, samples=16, edge_samples=256)),
            (200, Renderer(scene, samples=256)),
            (300, Renderer(scene, samples=16)),
        )
    )
    lit = (refined.var(axis=0) > 0.0) & (plain.var(axis=0) > 0.0)
    z = (refined.mean(axis=0) - plain.mean(axis=0))[lit]
    z /= np.sqrt((refined.var(axis=0, ddof=1) + plain.var(axis=0, ddof=1))[lit] / runs)
    limit = t.isf((1.0 - 0.99 ** (1.0 / lit.sum())) / 2.0, runs - 1)
    assert lit.sum() > 1000
    assert np.abs(z).max() < limit
    step = np.median(plain[plain > 0.0])
    worst = [image.std(axis=0, ddof=1).max() / step for image in (refined, plain, coarse)]
    assert worst[0] < 1.25 * worst[1]
    assert worst[0] < worst[2] / 4.0


def test_a_beam_is_refined_where_it_is_steep_and_nowhere_else():
    """Pixels of the refined edge by the angle that their centres are seen at from the tip."""
    pose = scene_of().pose(np.array([0.5, 0.5, 5.0]))
    step = TabulatedBeam(angles=tuple(math.radians(a) for a in (0.0, 5.0, 5.01, 9.0)), intensities=(1.0, 0.9, 0.4, 0.0))
    angles = {}
    per_pixel = 18.0 / np.ptp(scene_of().camera.project(scene_of().outline(pose, 0)), axis=0).min()
    for name, beam in {**BEAMS, "step inside": step}.items():
        scene = scene_of(beam=beam)
        row, column = np.divmod(rim_pixels(scene, pose, 0).astype(int), 400)
        rays = scene.camera.rays(np.stack([column, row], axis=-1) + 0.5).directions
        to_point = scene.surface.intersect(scene.eye, scene.camera.centre, rays) - pose.apex
        angles[name] = np.degrees(np.arccos(to_point @ pose.axis / np.linalg.norm(to_point, axis=-1)))
    assert not angles["soft"].size
    for name, at in {"hard": 9.0, "step inside": 5.0}.items():
        # a pixel's corner is up to 0.7 px from its centre, and the edge is followed within half a pixel
        assert np.abs(angles[name] - at).max() < 1.2 * per_pixel
        assert np.histogram(angles[name], bins=3, range=(at - 0.15, at + 0.15))[0].min() > 20


def test_a_pixel_is_the_same_whatever_else_is_rendered_and_in_however_many_passes(monkeypatch):
    """A crop against one pixel in three of it, and against passes of 1,000 samples: equal to the bit."""
    from conespot.render import kernel, stage

    assert kernel.load()[2].vectorized
    renderer = Renderer(scene_of(retina=PhotoRetina()), samples=16)
    lit = renderer.tile(renderer.scene.pose(np.array([1.2, -0.7, 4.0])), 0, seed=3).crop
    crop = Crop(lit.row + 3, lit.column + 5, lit.height - 10, lit.width // 2)
    whole = renderer._lit.render(crop, 16, seed=3)
    assert whole.max() > 0.0
    some = renderer._lit.pixels(crop.pixels(400)[::3], 16, seed=3)
    np.testing.assert_array_equal(some, whole.reshape(-1, 1)[::3])
    monkeypatch.setattr(stage, "PASS", 1000)
    np.testing.assert_array_equal(renderer._lit.render(crop, 16, seed=3), whole)
    assert not np.array_equal(renderer._lit.render(crop, 16, seed=4), whole)


@pytest.mark.parametrize("samples", [1, 7, 12, 64])
def test_any_number_of_samples_is_unbiased(samples):
    """Mean of the lit radiance over many seeds with few or a prime number of samples; against 1,024; four sigma."""
    scene = scene_of(beam=HardBeam())
    pose = scene.pose(np.array([1.2, -0.7, 4.0]))
    renderer = Renderer(scene, samples=samples)
    totals = [renderer.tile(pose, 0, seed=i).radiance.sum(dtype=float) for i in range(24)]
    expected = Renderer(scene, samples=1024).tile(pose, 0, seed=99).radiance.sum(dtype=float)
    error = np.std(totals, ddof=1) / math.sqrt(24)
    assert error < 1e-3 * expected
    assert abs(np.mean(totals) - expected) < 4.0 * error


def test_rectangles_cover_any_pixels_once():
    """The scalar variant's rectangles of a random mask: their pixels, put together, are those of the mask."""
    mask = np.random.default_rng(3).random((40, 40)) < 0.6
    mask[5:20, 3:30] = True
    pixels = np.flatnonzero(mask).astype(np.uint32)
    crops = list(Crop.covering(pixels, 40))
    assert len(crops) < mask.sum() / 1.5
    np.testing.assert_array_equal(np.sort(np.concatenate([c.pixels(40) for c in crops])), pixels)
    assert list(Crop.covering(Crop(2, 7, 5, 6).pixels(40), 40)) == [Crop(2, 7, 5, 6)]


def test_white_light_over_a_uniform_spectral_retina_leaves_little_noise():
    """Scatter over seeds of a pixel inside the patch, 16 samples; 64 wavelengths, each in a cell of its own."""
    scene = scene_of(retina=FundusSite(), illumination=LIGHTS["led-b3"], beam=HardBeam())
    pose = scene.pose(np.array([1.2, -0.7, 4.0]))
    renderer = Renderer(scene, samples=16)
    tiles = np.stack([renderer.tile(pose, 0, seed=i).radiance[..., 0].astype(float) for i in range(12)])
    inner = cv2.erode((tiles.min(axis=0) > 0.0).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    scatter = tiles.std(axis=0, ddof=1)[inner] / tiles.mean(axis=0)[inner]
    assert inner.sum() > 300
    # were the cells of a ray's four wavelengths the same, it would be 1.3 %
    assert np.sqrt(np.mean(scatter**2)) < 5e-3
