"""Spotlights that are no still point: a core's penumbra, and the patch of a tip that moves, against closed forms."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest

from conespot.render import Renderer, kernel, wavefront
from conespot.scene import Camera, Scene
from conespot.scene.beam import HardBeam
from conespot.scene.motion import Velocity, poses_during
from conespot.scene.pose import Pose
from conespot.scene.retina import UniformRetina
from conespot.scene.spotlights import Instrument, spotlight_axes
from conespot.scene.surface import Bump, Surface

needs_jit = pytest.mark.skipif(not kernel.load()[2].vectorized, reason="the scalar variant refuses both")
TIP = np.array([0.8, 0.4, 4.0])
HALF = math.radians(9.0)


def scene_of(resolution=400, core=0.0, **more):
    beam = HardBeam(source_diameter=core)
    return Scene.model_validate(
        {"camera": Camera(resolution=resolution), "beam": beam, "retina": UniformRetina(albedo=0.1), **more}
    )


def seen(scene, tile, rows=slice(None)):
    """A tile's rows over what a point at mid-exposure would make everywhere; and the places they see `[h, w, 3]`."""
    y, x = (np.arange(s.start, s.stop) + 0.5 for s in tile.crop.slices)
    rays = scene.camera.rays(np.stack(np.meshgrid(x, y[rows]), axis=-1))
    return tile.radiance[rows, :, 0], scene.surface.intersect(scene.eye, rays.origins, rays.directions)


def lit(scene, points, apex):
    """Closed form of the radiance at 1 W of places that a point of light at `apex` reaches."""
    to = points - apex
    distance = np.linalg.norm(to, axis=-1)
    cosine = np.sum(to * (points - scene.eye.centre), axis=-1) / distance / scene.eye.radius
    return 0.1 / math.pi * cosine / (4.0 * math.pi * (1e-3 * distance) ** 2)


def overlap(distance, large, small):
    """Part of a disc of radius `small` within one of radius `large` whose centre is `distance` away."""
    d = np.clip(distance, np.abs(large - small), large + small)
    one = np.arccos(np.clip((d**2 + small**2 - large**2) / (2.0 * d * small), -1.0, 1.0))
    other = np.arccos(np.clip((d**2 + large**2 - small**2) / (2.0 * d * large), -1.0, 1.0))
    kite = np.sqrt(
        np.maximum((-d + small + large) * (d + small - large) * (d - small + large) * (d + small + large), 0)
    )
    return (small**2 * one + large**2 * other - 0.5 * kite) / (math.pi * small**2)


@needs_jit
def test_the_penumbra_of_a_core_is_the_overlap_of_core_and_cone():
    """A core of 100 um on a hard rim, 6.6 um a pixel: 12 bins across the penumbra against two discs' overlap, 0.5 %.

    In the plane across the axis a place at depth z and distance d from it sees the points of the core within z tan(b)
    of itself, whatever the surface. The flux is that of a point within 0.1 %.
    """
    scene = scene_of(2000, core=0.1)
    pose = scene.pose(TIP)
    tile = Renderer(scene, samples=64, noise=0.0).tile(pose, 0, seed=1)
    radiance, points = seen(scene, tile)
    axis = spotlight_axes(pose, scene.spotlights)[0]
    depth = (points - pose.apex) @ axis
    across = np.linalg.norm(points - pose.apex - depth[..., None] * axis, axis=-1)
    edge = (across - depth * math.tan(HALF)) / 0.05
    share = radiance / lit(scene, points, pose.apex)
    expected = overlap(across, depth * math.tan(HALF), 0.05)
    bins = np.digitize(edge, np.linspace(-1.2, 1.2, 13))
    for k in range(1, 13):
        assert share[bins == k].mean() == pytest.approx(expected[bins == k].mean(), abs=0.005)
    assert radiance[edge > 1.2].max() == 0.0
    assert share[edge < -1.2].min() > 0.98
    point = Renderer(scene_of(2000), samples=64, noise=0.0).tile(scene.pose(TIP), 0, seed=1)
    assert radiance.sum() == pytest.approx(point.radiance.sum(), rel=1e-3)


@needs_jit
def test_centre_and_width_of_a_moving_patch_are_those_of_the_closed_form():
    """Upright, 10 mm/s along x for 8 ms, 6.6 um a pixel: the patch moves D = v T (22 mm / 18 mm), away from the RCM.

    Its centre is that of mid-exposure to 0.02 px; the variance along x is larger than along y by D^2 / 12 within 3 %,
    the width at half height that of the still patch within 0.3 px, and the edge rises from 10 to 90 % over 0.8 D.
    """
    motion = Velocity(velocity=(10.0, 0.0, 0.0), exposure=0.008)
    scene = scene_of(2000, instrument=Instrument(rcm=(0.0, 0.0, 22.0)), motion=motion)
    tile = Renderer(scene, samples=64, noise=0.0).tile(scene.pose(np.array([0.0, 0.0, 4.0])), 0, seed=1)
    light = tile.radiance[..., 0].astype(float)
    y, x = (np.arange(s.start, s.stop) + 0.5 - 1000.0 for s in tile.crop.slices)
    total = light.sum()
    centre = light.sum(axis=0) @ x / total, light.sum(axis=1) @ y / total
    np.testing.assert_allclose(centre, 0.0, atol=0.02)
    way = 0.08 * 22.0 / 18.0 / scene.camera.pixel_pitch
    spread = light.sum(axis=0) @ x**2 / total - light.sum(axis=1) @ y**2 / total
    assert spread == pytest.approx(way**2 / 12.0, rel=0.03)
    middle = np.abs(y) < 6.0
    row = light[middle].mean(axis=0) / light[middle][:, np.abs(x) < 50.0].mean()
    outline = scene.camera.project(scene.outline(scene.pose(np.array([0.0, 0.0, 4.0])), 0))
    left, right = x < 0.0, x > 0.0
    at = {level: np.interp(level, row[left], x[left]) for level in (0.1, 0.5, 0.9)}
    other = np.interp(0.5, row[right][::-1], x[right][::-1])
    assert other - at[0.5] == pytest.approx(np.ptp(outline[:, 0]), abs=0.3)
    assert at[0.9] - at[0.1] == pytest.approx(0.8 * way, rel=0.04)


@needs_jit
def test_a_moving_edge_at_5000_px_is_a_ramp_and_no_staircase():
    """2.6 um a pixel, the edge 37 px wide: 21 rows' mean against the share of time in the cone, off by 1 % at most.

    Sixteen instants alike for all rays would make steps of 6 % and be off by 3 %.
    """
    motion = Velocity(velocity=(10.0, 0.0, 0.0), exposure=0.008)
    scene = scene_of(5000, instrument=Instrument(rcm=(0.0, 0.0, 22.0)), motion=motion)
    pose = scene.pose(np.array([0.0, 0.0, 4.0]))
    tile = Renderer(scene, samples=64).tile(pose, 0, seed=1)
    rows = slice(2490 - tile.crop.row, 2511 - tile.crop.row)
    radiance, points = seen(scene, tile, rows)
    near = slice(0, 80)  # its left edge
    share = np.zeros(points[:, near].shape[:2])
    instants = (np.arange(1000) + 0.5) / 1000.0 - 0.5
    for instant in instants:
        now = Pose.through(pose.apex + instant * 0.008 * np.array([10.0, 0.0, 0.0]), scene.instrument.rcm)
        to = points[:, near] - now.apex
        inside = to @ now.axis >= math.cos(HALF) * np.linalg.norm(to, axis=-1)
        share += inside * lit(scene, points[:, near], now.apex) / len(instants)
    scale = share.max()
    off = (radiance[:, near] - share).mean(axis=0) / scale
    assert np.count_nonzero((share[10] > 0.02 * scale) & (share[10] < 0.98 * scale)) > 30
    assert np.abs(off).max() < 0.01


@needs_jit
@pytest.mark.parametrize(
    "surface",
    [Surface(), pytest.param(Surface(bumps=(Bump(x=0.3, y=0.4, diameter=1.0, height=0.3),)), marks=pytest.mark.slow)],
    ids=["smooth", "bump"],
)
def test_a_moving_core_lights_as_the_mean_of_still_points_does(surface):
    """A tremor and a core, oblique: against the mean of 100 tiles of a point where it stands, rms 0.5 % of the peak.

    On a bump that casts a shadow too: what is hidden is asked from where the light really is.
    """
    motion = {"kind": "tremor", "rms": 0.8, "exposure": 0.02}
    scene = scene_of(300, core=0.3, surface=surface, motion=motion)
    pose = scene.pose(TIP, time=0.3, seed=2)
    frame = np.zeros((300, 300))
    tile = Renderer(scene, samples=256, noise=0.0).tile(pose, 0, seed=1)
    frame[tile.crop.slices] = tile.radiance[..., 0]
    still = Renderer(scene_of(300, surface=surface), samples=16, noise=0.0)
    during = poses_during(pose, scene.instrument.rcm)[1:-1]  # whose ends count half
    assert np.ptp(pose.sway, axis=0).max() > 0.3
    mean = np.zeros_like(frame)
    for k in range(100):
        now = during[round((k * math.sqrt(2.0)) % 1.0 * (len(during) - 1))]
        across = np.linalg.svd(now.axis[None])[2][1:]
        radius, angle = 0.15 * math.sqrt((k + 0.5) / 100.0), 2.399963 * k
        offset = radius * np.array([math.cos(angle), math.sin(angle)]) @ across
        part = still.tile(Pose(now.apex + offset, now.axis), 0, seed=k)
        mean[part.crop.slices] += part.radiance[..., 0] / 100.0
    assert np.sqrt(np.mean((frame - mean) ** 2)) < 0.005 * mean.max()
    assert frame.sum() == pytest.approx(mean.sum(), rel=0.005)
    mean[tile.crop.slices] = 0.0
    assert mean.max() == 0.0  # none of them lights anything outside the tile


@needs_jit
def test_a_moving_core_is_seen_alike_whether_or_not_something_could_hide_it(monkeypatch):
    """The kernel that asks the scene for shadows against the one that need not, of one tile of a smooth eye."""
    if kernel.load()[2].variant.startswith("cuda"):
        pytest.skip("OptiX meets a sphere by a program of its own: single pixels of an edge differ by up to 8 %")
    scene = scene_of(core=0.1, motion=Velocity(velocity=(5.0, 5.0, 0.0), exposure=0.01))
    tile = Renderer(scene).tile(scene.pose(TIP), 0, seed=1)
    monkeypatch.setattr(wavefront, "_unblocked", wavefront._direct)
    other = Renderer(scene).tile(scene.pose(TIP), 0, seed=1)
    np.testing.assert_allclose(other.radiance, tile.radiance, rtol=1e-5)
    assert tile.radiance.max() > 0.0


@needs_jit
def test_a_pose_that_stands_still_is_refused_in_a_scene_that_moves():
    scene = scene_of(32, motion=Velocity(velocity=(10.0, 0.0, 0.0), exposure=0.008))
    with pytest.raises(ValueError, match=r"take scene\.pose\(tip\)"):
        Renderer(scene, samples=1).tile(Pose.through(TIP, scene.instrument.rcm), 0, seed=1)


def test_without_a_jit_variant_a_core_is_refused_in_a_sentence():
    code = """
from conespot.render import Renderer
from conespot.scene import Camera, Scene
from conespot.scene.beam import HardBeam
Renderer(Scene(camera=Camera(resolution=32), beam=HardBeam(source_diameter=0.1)), samples=1)
"""
    environment = {**os.environ, "CONESPOT_VARIANT": "scalar_spectral", "CONESPOT_CACHE": "off"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=300)
    assert done.stderr.splitlines()[-1].startswith(
        "conespot.render.kernel.KernelError: motion and beam.source_diameter need a JIT variant"
    )
