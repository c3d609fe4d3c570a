"""Tiles and frames: linear in power, the same whatever else is rendered, encoded as stated."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import t

from conespot.render import Exposure, Renderer, kernel, wavefront
from conespot.render.exposure import encode
from conespot.render.reflectance import Reflectance
from conespot.scene import Camera, Scene
from conespot.scene.illumination import Ambient
from conespot.scene.retina import PhotoRetina, UniformRetina
from conespot.scene.sensor import Linear, Srgb8
from conespot.scene.spotlights import RIGS, Instrument, spotlight_axes


def scene_of(**changes):
    return Scene(**{"camera": Camera(resolution=400), "retina": UniformRetina(albedo=0.1), **changes})


def test_a_sphere_met_in_closed_form_is_what_embree_meets(monkeypatch):
    """The same tile with the scene asked what each ray meets and whether anything shades it; to the bit."""
    if not kernel.load()[2].vectorized:
        pytest.skip("the scalar variant has a loop of its own")
    if kernel.load()[2].variant.startswith("cuda"):
        pytest.skip("OptiX meets a sphere by a program of its own: single pixels of an edge differ by up to 3.5 %")
    scene = scene_of(retina=PhotoRetina())
    pose = scene.pose(np.array([0.8, 0.4, 4.0]))
    tile = Renderer(scene).tile(pose, 0, seed=1)
    monkeypatch.setattr(wavefront, "_unblocked", wavefront._direct)
    np.testing.assert_array_equal(Renderer(scene).tile(pose, 0, seed=1).radiance, tile.radiance)
    assert tile.radiance.max() > 0.0


@pytest.mark.slow
def test_sum_of_tiles_times_power_is_one_render_at_that_power():
    """z-test per pixel, Sidak-corrected: the tiled frame against brute force with all lights in one scene of a mesh."""
    from conespot.render import emitters
    from conespot.render.retina_mesh import retina_mesh

    scene = scene_of(spotlights=RIGS["triple"], retina=PhotoRetina(), camera=Camera(resolution=300))
    pose = scene.pose(np.array([0.8, 0.4, 4.0]))
    power = 0.25
    mi, _, _ = kernel.load()
    renderer = Renderer(scene, samples=16)
    runs = 16
    tiled = np.empty((runs, 300, 300))
    edges = []
    for i in range(runs):
        frame = np.zeros((300, 300), np.float32)
        for k in range(3):
            tile = renderer.tile(pose, k, seed=100 * i + k)
            frame[tile.crop.slices] += power * tile.radiance[..., 0]
            edges.append([(side.start, side.stop) for side in tile.crop.slices])
        tiled[i] = frame
    # brute force: the same retina under three lights of that power in one Mitsuba scene, 20 px beyond the tiles
    top, left = np.maximum(np.min(edges, axis=0)[:, 0] - 20, 0)
    bottom, right = np.minimum(np.max(edges, axis=0)[:, 1] + 20, 300)
    tiled = tiled[:, top:bottom, left:right]
    lights = {}
    for k, axis in enumerate(spotlight_axes(pose, scene.spotlights)):
        light = emitters.spotlight(mi, scene)
        light["to_world"] = emitters.aim(mi, pose.apex, axis)
        intensity = power / (4.0 * math.pi) * 1e6 / 300.0
        light["intensity"] = {
            "type": "regular",
            "wavelength_min": 400.0,
            "wavelength_max": 700.0,
            "values": f"{intensity}, {intensity}",
        }
        lights[f"light{k}"] = light
    look = Reflectance(scene.retina)
    brute_scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 2},
            "retina": retina_mesh(mi, scene, mi.load_dict(look.bsdf(mi, look.texture(mi, None)))),
            "sensor": {
                "type": "perspective",
                "fov": math.degrees(scene.camera.full_fov),
                "fov_axis": "x",
                "to_world": mi.ScalarTransform4f().look_at(origin=[0, 0, 110], target=[0, 0, 0], up=[0, 1, 0]),
                "film": {
                    "type": "specfilm",
                    "width": 300,
                    "height": 300,
                    "crop_offset_x": int(left),
                    "crop_offset_y": int(top),
                    "crop_width": int(right - left),
                    "crop_height": int(bottom - top),
                    "component_format": "float32",
                    "rfilter": {"type": "box"},
                    "band": {"type": "regular", "wavelength_min": 400.0, "wavelength_max": 700.0, "values": "1, 1"},
                },
            },
            **lights,
        }
    )
    brute = np.stack([np.array(mi.render(brute_scene, spp=48, seed=1000 + i))[..., 0] for i in range(runs)])
    spread = np.sqrt(tiled.var(axis=0, ddof=1) / runs + brute.var(axis=0, ddof=1) / runs)
    lit = spread > 1e-6 * brute.mean()
    z = (tiled.mean(axis=0) - brute.mean(axis=0))[lit] / spread[lit]
    assert lit.sum() > 2000
    # t distribution with about 2 (runs - 1) degrees, Sidak-corrected for all pixels at 1 % false alarm
    limit = t.isf((1.0 - 0.99 ** (1.0 / lit.sum())) / 2.0, runs - 1)
    assert np.abs(z).max() < limit
    totals = tiled.sum(axis=(1, 2)), brute.sum(axis=(1, 2))
    error = math.sqrt(sum(total.var(ddof=1) / runs for total in totals))
    assert abs(totals[0].mean() - totals[1].mean()) < 4.0 * error
    assert error < 2e-3 * totals[1].mean(), "the totals must be known well for this to mean anything"


def test_exposing_at_more_powers_renders_nothing_more():
    """The count of renderings at one power against that at four."""
    scene = scene_of()
    renderer = Renderer(scene, samples=4)
    exposure = Exposure(renderer.background(), scene.sensor)
    tiles = [renderer.tile(scene.pose(np.array([0.0, 0.0, 4.0])), 0, seed=1)]
    before = renderer.rendered
    frames = [exposure.frame(tiles, power) for power in (0.001, 0.01, 0.1, 1.0)]
    assert renderer.rendered == before == 2
    sums = [int(f.sum(dtype=np.int64)) for f in frames]
    assert sums == sorted(sums)
    assert sums[0] < sums[-1]


@pytest.mark.parametrize("power", [2.0**-5, 0.25, 2.0])
def test_a_frame_is_exactly_linear_in_power(power):
    """Linear pixel values over darkness against those of the 1 W frame times the power: equal to half a step."""
    scene = scene_of(sensor=Linear(white=500.0, bits=16), ambient=Ambient(irradiance=0.0))
    renderer = Renderer(scene, samples=4)
    tile = renderer.tile(scene.pose(np.array([0.0, 1.0, 4.0])), 0, seed=1)
    exposure = Exposure(renderer.background(), scene.sensor)
    exact = tile.radiance[..., 0].astype(float) * power / 500.0 * 65535.0
    assert exact.max() < 65535.0
    assert np.abs(exposure.frame([tile], power)[tile.crop.slices] - exact).max() <= 0.5 + 1e-2


def test_a_frame_is_the_encoded_background_plus_scaled_tiles():
    """`Exposure.frame`, which works on crops, against the whole frame composed here; to one step of rounding."""
    scene = scene_of(spotlights=RIGS["triple"], sensor=Linear(white=20.0, bits=12))
    renderer = Renderer(scene, samples=4)
    pose = scene.pose(np.array([0.0, 1.0, 4.0]))
    tiles = [renderer.tile(pose, k, seed=k) for k in range(3)]
    total = renderer.background().astype(np.float32).copy()
    for tile in tiles:
        total[tile.crop.slices] += np.float32(0.3) * tile.radiance
    frame = Exposure(renderer.background(), scene.sensor).frame(tiles, 0.3)
    assert frame.dtype == np.uint16
    assert np.abs(frame.astype(int) - encode(total[..., 0], scene.sensor).astype(int)).max() <= 1


def test_the_same_seed_gives_the_same_tile_in_any_order():
    """Tiles of three poses against the same rendered backwards by another renderer: equal to the bit."""
    scene = scene_of(retina=PhotoRetina())
    poses = [scene.pose(np.array([x, 0.3, 4.0])) for x in (-1.0, 0.0, 1.0)]
    first, second = Renderer(scene), Renderer(scene)
    forward = [first.tile(p, 0, seed=9).radiance for p in poses]
    backward = [second.tile(p, 0, seed=9).radiance for p in reversed(poses)][::-1]
    for a, b in zip(forward, backward, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(forward[0], first.tile(poses[0], 0, seed=10).radiance)


def test_a_patch_outside_the_field_is_an_empty_tile():
    scene = scene_of(instrument=Instrument(rcm=(-11.0, 0.0, 14.0)))
    tile = Renderer(scene).tile(scene.pose(np.array([9.0, 0.0, 9.0])), 0, seed=1)
    assert tile.radiance.size == 0
    frame = Exposure(np.zeros((400, 400, 1), np.float32), scene.sensor).frame([tile], 1.0)
    assert not frame.any()


def test_srgb8_encodes_as_iec_61966_2_1():
    radiance = np.array([0.0, 0.001, 0.0031308, 0.05, 0.214, 1.0, 7.0], np.float32)
    plain = [0.0, 0.01292, 0.04045, 0.247801, 0.499946, 1.0, 1.0]
    np.testing.assert_array_equal(encode(radiance, Srgb8(white=1.0)), np.floor(np.array(plain) * 255 + 0.5))
