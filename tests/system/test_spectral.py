"""Spectral renderings against the closed forms and published values they must reproduce."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

import numpy as np
import pytest

from conespot.render import Crop, Renderer, kernel
from conespot.render.fundus_maps import FundusMaps
from conespot.scene import Camera, Eye, Scene, fundus
from conespot.scene.beam import HardBeam
from conespot.scene.eye import Globe
from conespot.scene.illumination import LIGHTS, Ambient, FlatBand, Line
from conespot.scene.power import Power
from conespot.scene.retina import RETINAS, Fundus, FundusSite, Glint, UniformRetina
from conespot.scene.sensor import Linear
from conespot.scene.spectrum import Curve
from conespot.scene.spotlights import Instrument, Shaft

DATA = Path(__file__).parents[1] / "data"


#: stated values of the closed form at the perifovea [%]
PERIFOVEA = {
    400: 1.89,
    450: 1.61,
    500: 1.77,
    560: 2.03,
    600: 3.88,
    650: 6.81,
    700: 9.12,
    800: 11.96,
    850: 12.5,
    940: 12.7,
}


#: optical densities of artery and vein
VESSELS = {570: (0.44, 0.45), 600: (0.08, 0.22), 660: (0.01, 0.05), 850: (0.025, 0.030)}


BROAD = FlatBand(low=380.0, high=1000.0)


def narrow_channels(wavelengths) -> dict[str, Curve]:
    """One film channel per wavelength: a triangle 1 nm wide."""
    return {f"{w:g}": Line(wavelength=float(w)).spectrum for w in wavelengths}


def background_spectrum(retina, wavelengths, resolution=32) -> np.ndarray:
    """Radiance `[N, N, wavelengths]` of a retina in the ambient light, relative to a white one."""
    frames = []
    for surface in (retina, UniformRetina(albedo=1.0)):
        scene = Scene(
            camera=Camera(resolution=resolution),
            retina=surface,
            illumination=BROAD,
            ambient=Ambient(illumination=BROAD),
        )
        renderer = Renderer(scene, responses=narrow_channels(wavelengths))
        stage = renderer._ambient(with_shaft=False)
        frames.append(stage.render(Crop(0, 0, resolution, resolution), 256, 1).astype(float))
    return frames[0] / frames[1]


def measured(site: str) -> tuple[np.ndarray, np.ndarray]:
    text = (DATA / "fundus_reflectance_delori1989.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in text if not line.startswith("#")))
    return np.array([float(r["wavelength_nm"]) for r in rows]), np.array([float(r[f"{site}_pct"]) for r in rows])


@pytest.mark.parametrize("site", ["perifovea", *(pytest.param(s, marks=pytest.mark.slow) for s in ("nasal", "fovea"))])
def test_rendered_sites_follow_delori_and_pflibsen(site):
    """Rendered reflectance behind a phakic lens; against Table I at 18 to 20 wavelengths; rms within 6 %."""
    wavelengths, percent = measured(site)
    ours = 100.0 * np.mean(background_spectrum(FundusSite(site=site, water=False), wavelengths), axis=(0, 1))
    error = ours * 10.0 ** (-2.0 * fundus.lens_density(wavelengths)) / percent - 1.0
    assert np.sqrt(np.mean(error**2)) < 0.06


def test_rendered_perifovea_has_the_stated_values():
    """Rendered reflectance of the perifovea from 400 to 940 nm; against ten stated values; within 1 %."""
    ours = np.mean(background_spectrum(FundusSite(water=False), list(PERIFOVEA)), axis=(0, 1))
    assert 100.0 * ours == pytest.approx(list(PERIFOVEA.values()), rel=0.01)


def test_rendered_vessels_have_the_stated_density(monkeypatch):
    """A fundus with an 80 um artery, a 110 um vein and none, side by side; against the stated densities; 10 %."""
    site, shape = fundus.SITES["perifovea"], (60, 60)

    def stripes(depth: float, low: int, high: int) -> np.ndarray:
        image = np.zeros((60, 60), np.float32)
        image[:, low:high] = depth
        return image

    flat = {
        name: np.full(shape, getattr(site, name), np.float32) for name in ("melanin", "blood", "epithelium", "macular")
    }
    maps = FundusMaps(
        **flat,
        disc=np.zeros(shape, np.float32),
        artery=stripes(80.0, 0, 25),
        vein=stripes(110.0, 35, 60),
        mosaic=np.zeros((8, 8), np.float32),
    )
    monkeypatch.setattr("conespot.render.reflectance.fundus_maps", lambda retina: maps)
    seen = background_spectrum(Fundus(water=False), list(VESSELS))
    artery, clear, vein = (seen[:, s].mean(axis=(0, 1)) for s in (slice(2, 10), slice(15, 17), slice(22, 30)))
    assert clear == pytest.approx(fundus.reflectance(np.array(list(VESSELS), float), site), rel=0.01)
    for through, stated in ((artery, [v[0] for v in VESSELS.values()]), (vein, [v[1] for v in VESSELS.values()])):
        assert -np.log10(through / clear) == pytest.approx(stated, rel=0.1, abs=0.0005)


def test_vitreous_takes_its_share_on_both_ways():
    """Patch at 970 nm with and without water; against 24 mm out and the tip's 5 mm in, from the table; within 1 %."""
    pose_at = np.array([0.0, 0.0, 5.0])
    light = Line(wavelength=970.0)
    signal = []
    for water in (True, False):
        scene = Scene(
            camera=Camera(resolution=200), retina=FundusSite(water=water), illumination=light, sensor=Linear()
        )
        signal.append(float(Renderer(scene).tile(scene.pose(pose_at), 0, seed=1).radiance.mean(dtype=float)))
    hit = scene.surface.intersect(scene.eye, pose_at, scene.pose(pose_at).axis)
    way = 24.0 + float(np.linalg.norm(hit - pose_at))
    assert signal[0] / signal[1] == pytest.approx(float(fundus.water_transmission(970.0, way)), rel=0.01)


@pytest.mark.parametrize("albedo", [0.2, pytest.param(0.5, marks=pytest.mark.slow)])
def test_closed_sphere_is_an_integrating_sphere(albedo):
    """Light reflected at least twice in a closed eyeball; against rho / pi Phi rho / (4 pi R^2 (1 - rho)); 1 %."""
    eye = Eye(radius=12.0)
    shared = {
        "eye": eye,
        "camera": Camera(resolution=24),
        "retina": UniformRetina(albedo=albedo),
        # a wide patch is found by more of the paths, for less noise; the wall's mean does not depend on its size
        "beam": HardBeam(half_angle=math.radians(45.0)),
        "power": Power(convention="flux"),
    }
    closed = Scene(interreflection=Globe(pupil=0.0, bounces=24 if albedo > 0.3 else 10), **shared)
    pose = closed.pose(np.array([0.0, 0.0, 12.0]))
    whole = Renderer(closed, samples=1024).tile(pose, 0, seed=2)
    first = Renderer(Scene(**shared), samples=1024).tile(pose, 0, seed=2)
    assert whole.radiance.shape == (24, 24, 1)
    indirect = whole.radiance.astype(float)
    indirect[first.crop.slices] -= first.radiance
    irradiance = albedo / (4.0 * math.pi * (eye.radius * 1e-3) ** 2 * (1.0 - albedo))  # of 1 W
    assert indirect.mean() == pytest.approx(albedo / math.pi * irradiance, rel=0.01)


@pytest.mark.slow
def test_a_pupil_lets_light_escape():
    """Indirect light with an 8 mm pupil; against a closed eyeball: less, by about the pupil's share of the wall."""
    means = []
    for pupil in (0.0, 8.0):
        scene = Scene(
            camera=Camera(resolution=24),
            retina=UniformRetina(albedo=0.5),
            beam=HardBeam(half_angle=math.radians(45.0)),
            interreflection=Globe(pupil=pupil, bounces=24),
        )
        pose = scene.pose(np.array([0.0, 0.0, 12.0]))
        whole = Renderer(scene, samples=2048).tile(pose, 0, seed=2).radiance.astype(float)
        first = Renderer(scene.model_copy(update={"interreflection": None}), samples=256).tile(pose, 0, seed=2)
        whole[first.crop.slices] -= first.radiance
        means.append(whole.mean())
    share = 4.0**2 / (4.0 * 12.0**2)
    # of each flight between walls the share is lost: the series is 1 / (1 - rho (1 - f)), its first flight included
    assert means[1] / means[0] == pytest.approx((1 - 0.5) / (1 - 0.5 * (1 - share)), rel=0.01)


@pytest.mark.slow
def test_a_glint_adds_light_near_the_mirror_direction_only():
    """A fundus with a glint in light along the camera's axis; against none: brighter at the pole, equal at the rim."""
    light = LIGHTS["line532"]
    images = []
    for glint in (None, Glint(roughness=0.1)):
        retina = Fundus(vessels=False, glint=glint)
        scene = Scene(
            camera=Camera(resolution=64), retina=retina, illumination=light, ambient=Ambient(illumination=light)
        )
        images.append(Renderer(scene).background()[..., 0])
    ratio = images[1] / images[0]
    assert ratio[30:34, 30:34].mean() > 1.1
    assert np.median(ratio[:, :4]) == pytest.approx(1.0, abs=0.03)  # the coat sends 2 % back down


@pytest.mark.parametrize("shaft", [None, Shaft()], ids=["sphere", "mesh"])
def test_float32_is_enough_for_the_geometry(shaft):
    """Where Mitsuba's float32 camera rays meet the retina; against float64 closed form; below 0.1 um, 1/26 of a pixel.

    The retina is a mesh where something may stand in the light's way.
    """
    mi, _, _ = kernel.load()
    scene = Scene(camera=Camera(resolution=5000), retina=UniformRetina(), instrument=Instrument(shaft=shaft))
    stage = Renderer(scene)._lit
    assert ("Sphere" in str(stage.retina)) == (shaft is None)
    pixels = np.random.default_rng(1).uniform(50.0, 4950.0, (4000, 2))
    rays = scene.camera.rays(pixels).directions
    expected = scene.surface.intersect(scene.eye, np.broadcast_to(scene.camera.centre, rays.shape), rays)
    # the sensor's own rays begin at its near plane
    film = mi.Point2f(pixels.T.astype(np.float32))
    found = stage._scenes[0].ray_intersect(stage._scenes[0].sensors()[0].sample_ray(0.0, 0.5, film, 0.5)[0])
    points = np.array(found.p).reshape(3, -1).T
    assert np.max(np.linalg.norm(points - expected, axis=1)) < 1e-4


@pytest.mark.parametrize("name", RETINAS)
def test_no_retina_is_an_rgb_texture_in_the_infrared(name):
    """Mitsuba's account of every named retina at 850 nm; against that of a material given in red, green and blue."""
    scene = Scene(camera=Camera(resolution=32), retina=RETINAS[name], illumination=LIGHTS["ir850"])
    seen = str(Renderer(scene, samples=1)._lit.retina.bsdf())
    mi, _, _ = kernel.load()
    colour = str(mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.9, 0.3, 0.1]}}))
    assert "SRGB" in colour, "or this test would see nothing"
    assert "SRGB" not in seen
    for mean in re.findall(r"mean = \[([^\]]*)\]", seen):
        assert len(mean.split(",")) == 1, "a bitmap has one channel"


def test_a_grey_photograph_reflects_the_infrared_as_it_does_the_visible():
    """Backgrounds over the grey photograph in green and at 850 nm; against each other, pixel by pixel, to 1e-4."""
    frames = []
    for light in (FlatBand(low=500.0, high=600.0), LIGHTS["ir850"]):
        scene = Scene(camera=Camera(resolution=64), ambient=Ambient(illumination=light), illumination=light)
        frames.append(Renderer(scene).background().astype(float))
    assert np.ptp(frames[0]) > 0.2 * frames[0].mean(), "the photograph must show for this test to mean anything"
    assert frames[1] == pytest.approx(frames[0], rel=1e-4)
