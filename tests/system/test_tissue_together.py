"""Tissue beside other effects, and against photons that are followed one by one."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from conespot.render.deep_light import EntryMap
from conespot.render.renderer import Renderer
from conespot.scene import Camera, Scene
from conespot.scene.beam import HardBeam
from conespot.scene.illumination import Line
from conespot.scene.retina import Fundus, Spread
from conespot.scene.spotlights import Instrument, Shaft, spotlight_axes
from conespot.scene.spread import spread_table
from conespot.scene.surface import SURFACES, Surface

INFRARED = Line(wavelength=850.0, width=1.0)
SMOOTH = {"vessels": False, "detail": 0.0, "water": False}


def scene_of(spread, **more):
    values = {
        "camera": Camera(resolution=400),
        "beam": HardBeam(half_angle=math.radians(5.0)),
        "illumination": INFRARED,
        "retina": Fundus(**SMOOTH, spread=spread),
        **more,
    }
    return Scene.model_validate(values)


def flux(tile):
    assert np.all(np.isfinite(tile.radiance))
    return float(tile.radiance.sum(dtype=float))


@pytest.mark.slow
def test_deep_light_is_that_of_photons_followed_from_the_tip_to_the_pixel():
    """850 nm, blocks of 4 px: a million photons from the tip to an entry, a distance of the table's, an exit, a pixel.

    They know no chart, lattice, Gaussians or camera rays in the kernel: the distance is drawn from the table's shares,
    monotone cubics of log distance between its radii, and the exit lies on the sphere at that chord. Blocks of 100
    photons and more, a quarter of a millimetre off the rim, where no block is half local. No z beyond Sidak's bound,
    and a mean square near 1: the table's rings are as steep as its cubics to some hundredths only.
    """
    scene = scene_of(Spread())
    pose = scene.pose(np.array([1.5, 1.0, 4.0]))
    renderer = Renderer(scene, samples=16)
    whole = renderer.tile(pose, 0, seed=3)
    renderer._lit.glow = None
    local = renderer.tile(pose, 0, seed=3)
    crop, deep = whole.crop, whole.radiance[..., 0].astype(float)
    row, column = local.crop.row - crop.row, local.crop.column - crop.column
    deep[row : row + local.crop.height, column : column + local.crop.width] -= local.radiance[..., 0]

    rng, count = np.random.default_rng(7), 1_000_000
    axis = spotlight_axes(pose, scene.spotlights)[0]
    across = np.linalg.svd(axis[None])[2][1:]
    cosine = 1.0 - rng.random(count) * (1.0 - math.cos(scene.beam.half_angle))
    turn = rng.random(count) * 2.0 * math.pi
    sideways = np.stack([np.cos(turn), np.sin(turn)], axis=-1) @ across
    rays = cosine[:, None] * axis + np.sqrt(1.0 - cosine**2)[:, None] * sideways
    entry = scene.surface.intersect(scene.eye, pose.apex, rays)
    solid_angle = 2.0 * math.pi * (1.0 - math.cos(scene.beam.half_angle))
    intensity = scene.power.axial_intensity(scene.beam) / scene.power.value

    table = spread_table("medium")
    enclosed = table.enclosed[1, list(table.wavelengths).index(850.0)]
    grown = PchipInterpolator(enclosed, np.log(table.radii))
    share = rng.random(count)
    # nearer than the first ring the density goes as 1 / distance, so the share goes as the distance
    chord = np.where(share < enclosed[0], table.radii[0] * share / enclosed[0], np.exp(grown(share)))
    chord = np.minimum(chord, table.radii[-1])
    normal = (entry - scene.eye.centre) / scene.eye.radius
    tangent = np.cross(normal, rng.normal(size=(count, 3)))
    tangent /= np.linalg.norm(tangent, axis=-1, keepdims=True)
    half = chord / (2.0 * scene.eye.radius)
    away = (1.0 - 2.0 * half**2)[:, None] * normal + (2.0 * half * np.sqrt(1.0 - half**2))[:, None] * tangent
    leaves = scene.eye.centre + scene.eye.radius * away

    t_in, t_out = (
        EntryMap(scene.retina, scene.eye.arc(p - scene.eye.centre)).passage(850.0).astype(float)
        for p in (entry, leaves)
    )
    weight = 1e6 * intensity * solid_angle / count * t_in * t_out / math.pi
    block = 4
    shape = (crop.height // block, crop.width // block)
    at = (scene.camera.project(leaves) - (crop.column, crop.row)) / block
    edges = [np.arange(n + 1) for n in shape]
    first, second = (np.histogram2d(at[:, 1], at[:, 0], bins=edges, weights=weight**k)[0] for k in (1, 2))

    x, y = (np.arange(n + 1) * block + start for n, start in ((shape[1], crop.column), (shape[0], crop.row)))
    seen = scene.camera.rays(np.stack(np.meshgrid(x, y), axis=-1))
    corners = scene.surface.intersect(scene.eye, seen.origins, seen.directions)
    diagonals = corners[1:, 1:] - corners[:-1, :-1], corners[1:, :-1] - corners[:-1, 1:]
    area = 0.5 * np.linalg.norm(np.cross(*diagonals), axis=-1)
    found = deep[: shape[0] * block, : shape[1] * block].reshape(shape[0], block, shape[1], block).mean(axis=(1, 3))

    rim = scene.outline(pose, 0)
    middle = 0.25 * (corners[1:, 1:] + corners[:-1, :-1] + corners[1:, :-1] + corners[:-1, 1:])
    from_rim = np.linalg.norm(middle[:, :, None] - rim, axis=-1).min(axis=-1)
    photons = np.histogram2d(at[:, 1], at[:, 0], bins=edges)[0]
    tested = (photons > 100) & (from_rim > 0.25)
    z = (found - first / area)[tested] / (np.sqrt(second) / area)[tested]
    assert tested.sum() > 50
    assert np.abs(z).max() < 4.2
    assert np.mean(z**2) < 1.5


@pytest.mark.parametrize("lens", [{}, {"lens": {"aperture": 10.0, "blur": {"sigma": 0.02}}}], ids=["pinhole", "lens"])
def test_through_the_eyes_optics_deep_light_is_as_much_as_in_the_closed_form(lens):
    """Fundus without detail behind cornea, lens and flat contact lens: the tile's sum with spread and without it."""
    more = {
        "eye": {"radius": 12.0},
        "camera": {"resolution": 300, "optics": {"eye": "navarro", "contact": "flat"}, **lens},
        "instrument": {"rcm": [0.0, 0.0, 22.0]},
    }
    with_it, without = (scene_of(spread, **more) for spread in (Spread(), None))
    pose = with_it.pose(np.array([0.3, 0.2, 4.0]))
    seen, expected = (flux(Renderer(scene, samples=16).tile(pose, 0, seed=1)) for scene in (with_it, without))
    assert seen == pytest.approx(expected, rel=0.01)


@pytest.mark.slow
def test_over_bumps_and_beside_a_shaft_deep_light_is_what_is_not_hidden():
    """The tile over bumps: its sum as without spread; with a shaft, what it hides is dark and the rest as before."""
    bumps = SURFACES["bumps"]
    assert isinstance(bumps, Surface)
    pose = scene_of(None).pose(np.array([2.6, 1.2, 4.5]))
    bare, closed = (scene_of(spread, surface=bumps) for spread in (Spread(), None))
    open_tile = Renderer(bare, samples=16).tile(pose, 0, seed=1)
    assert flux(open_tile) == pytest.approx(flux(Renderer(closed, samples=16).tile(pose, 0, seed=1)), rel=0.01)
    scene = scene_of(Spread(), surface=bumps, instrument=Instrument(shaft=Shaft()))
    tile = Renderer(scene, samples=16).tile(pose, 0, seed=1)
    assert tile.crop == open_tile.crop
    hidden = tile.radiance[..., 0] == 0.0
    lit = open_tile.radiance[..., 0] > 0.02 * open_tile.radiance.max()
    assert 0.0 < np.mean(hidden & lit) / np.mean(lit) < 0.9
    whole = np.isclose(tile.radiance[..., 0], open_tile.radiance[..., 0], rtol=0.01)
    assert np.mean((whole | hidden)[lit]) > 0.95


@pytest.mark.slow
def test_the_scalar_variant_refuses_spread_in_one_sentence():
    code = (
        "from conespot.render.renderer import Renderer; from conespot.scene import Scene\n"
        "from conespot.scene.retina import Fundus, Spread\n"
        "Renderer(Scene(retina=Fundus(spread=Spread())))"
    )
    environment = {**os.environ, "CONESPOT_VARIANT": "scalar_spectral", "CONESPOT_CACHE": "off"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    assert "retina.spread needs a JIT variant, and this is scalar_spectral" in done.stderr.splitlines()[-1]


def test_without_any_microscope_light_there_is_no_deep_light_of_it():
    scene = Scene.model_validate(
        {
            "camera": {"resolution": 60},
            "retina": {"kind": "fundus", "spread": {}},
            "ambient": {"irradiance": "0 W/m2"},
            "illumination": "ir850",
        }
    )
    assert not np.any(Renderer(scene, samples=4).background())
