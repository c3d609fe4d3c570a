"""Colour previews, and the response curves in a frame's header."""

from __future__ import annotations

import numpy as np
import pytest

from conespot.render import Exposure, Renderer
from conespot.render.colour import colour_preview, observer, render_xyz, to_srgb
from conespot.render.frame_file import frame_header
from conespot.scene import Camera, Scene
from conespot.scene.illumination import LIGHTS, Ambient, FlatBand
from conespot.scene.retina import Fundus, UniformRetina
from conespot.scene.sensor import SENSORS


def scene_in(light, retina, **changes):
    return Scene(
        camera=Camera(resolution=80), retina=retina, illumination=light, ambient=Ambient(illumination=light), **changes
    )


def test_equal_energy_on_grey_has_the_chromaticity_of_illuminant_e():
    """XYZ of a grey retina in a band of constant power; against x = y = 1/3; within 0.001."""
    scene = scene_in(FlatBand(low=360.0, high=830.0), UniformRetina())
    xyz = render_xyz(scene, scene.pose(np.array([0.0, 0.0, 5.0])), 0.0).mean(axis=(0, 1), dtype=float)
    assert xyz[:2] / xyz.sum() == pytest.approx([1 / 3, 1 / 3], abs=0.001)


def test_white_led_has_its_published_chromaticity():
    """XYZ of LED-B3 on grey; against x, y = 0.3756, 0.3723 of CIE 015:2018; within 0.002."""
    scene = scene_in(LIGHTS["led-b3"], UniformRetina())
    xyz = render_xyz(scene, scene.pose(np.array([0.0, 0.0, 5.0])), 0.0).mean(axis=(0, 1), dtype=float)
    assert xyz[:2] / xyz.sum() == pytest.approx([0.3756, 0.3723], abs=0.002)


@pytest.mark.slow
def test_a_fundus_is_red_and_infrared_is_dark():
    """Colour previews of a fundus; white LED against red > green > blue, IR 940 nm against black."""
    pose_at = np.array([0.0, 0.0, 5.0])
    scene = scene_in(LIGHTS["led-b3"], Fundus())
    red, green, blue = colour_preview(scene, scene.pose(pose_at), 0.0).reshape(-1, 3).mean(axis=0)
    assert red > 1.3 * green > 1.3 * blue
    dark = scene_in(LIGHTS["ir940"], Fundus())
    assert colour_preview(dark, dark.pose(pose_at), 1.0).max() < 10


def test_srgb_of_daylight_white_is_white():
    """sRGB of D65's XYZ; against 255 in every channel."""
    assert to_srgb(np.array([[[0.95046, 1.0, 1.08906]]]), 1.0) == pytest.approx(255, abs=1)
    assert list(observer()) == ["x_bar", "y_bar", "z_bar"]


def test_a_frame_s_header_carries_response_curves_and_the_light():
    """Header of a Bayer camera's frame; against the responsivity at 550 nm and the light's spectrum at its peak."""
    scene = Scene(illumination=LIGHTS["led-b3"], sensor=SENSORS["cmv12000-rgb"])
    header = frame_header(scene, scene.pose(np.array([0.0, 0.0, 5.0])), 1.0, {})
    assert [header[f"conespot.channel.C{i}"] for i in range(3)] == ["red", "green", "blue"]
    assert header["conespot.unit"] == "A m-2 sr-1"
    pairs = dict(pair.split(":") for pair in str(header["conespot.response.C1"]).split())
    assert float(pairs["550"]) == pytest.approx(float(scene.sensor.responses["green"](550.0)), rel=1e-5)
    light = dict(pair.split(":") for pair in str(header["conespot.light"]).split())
    assert float(light["450"]) == pytest.approx(float(scene.illumination.spectrum(450.0)), rel=1e-5)


def test_a_grey_retina_in_flat_white_light_shows_alike_in_red_green_and_blue():
    """Tile and background of the three channels against the grey sensor's one, in sum; 1.5 %, four times the noise."""
    scene = Scene(camera=Camera(resolution=300), retina=UniformRetina(albedo=0.1))
    pose = scene.pose(np.array([0.5, 0.5, 4.0]))
    seen = []
    for sensor in ("srgb8", "srgb8-colour"):
        renderer = Renderer(Scene(**{**dict(scene), "sensor": sensor}), samples=16)
        seen.append((renderer.tile(pose, 0, seed=1).radiance, renderer.background()))
    for grey, colours in zip(*seen, strict=True):
        assert colours.shape[-1] == 3
        lit = grey[..., 0] > 0.2 * grey.max()
        assert colours[lit].sum(axis=0) / grey[lit].sum() == pytest.approx([1.0] * 3, rel=0.015)


def test_a_living_fundus_is_red_before_it_is_green_or_blue():
    scene = Scene(camera=Camera(resolution=200), retina="fundus", sensor="srgb8-colour")
    image = Exposure(Renderer(scene, samples=16).background(), scene.sensor).frame((), 0.0)
    red, green, blue = np.median(image.reshape(-1, 3), axis=0)
    assert image.shape == (200, 200, 3)
    assert red > green > blue
