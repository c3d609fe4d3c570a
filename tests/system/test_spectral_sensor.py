"""What sensors and filters make of light: response integrals, bands that keep to themselves, the scalar fallback."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from conespot.render import Renderer, kernel
from conespot.scene import Camera, Scene
from conespot.scene.emva import BandPass, Emva
from conespot.scene.illumination import LIGHTS, Ambient, FlatBand
from conespot.scene.retina import FundusSite, UniformRetina
from conespot.scene.sensor import SENSORS, Linear
from conespot.scene.spectrum import tabulated

SCALAR = """
import numpy as np, sys
from conespot.render import Crop, Renderer
from conespot.scene import Camera, Scene
from conespot.scene.illumination import LIGHTS, Ambient
from conespot.scene.retina import Fundus
from conespot.scene.sensor import SENSORS
light = LIGHTS["led-b3"]
scene = Scene(camera=Camera(resolution=24), retina=Fundus(source="procedural", detail=0.0), illumination=light,
              ambient=Ambient(illumination=light), sensor=SENSORS["cmv12000-rgb"])
np.save(sys.argv[1], Renderer(scene)._ambient(with_shaft=False).render(Crop(0, 0, 24, 24), 256, 1))
"""


@pytest.mark.parametrize("band", [(500.0, 600.0), (830.0, 870.0), (920.0, 960.0)])
def test_sensor_response_integrals(band):
    """Signal over radiance of a grey retina in a flat band; against the responsivity's mean, summed at 1 pm; 0.1 %."""
    light = FlatBand(low=band[0], high=band[1])
    signals = []
    for sensor in (SENSORS["cmv12000-nir"], Linear()):
        scene = Scene(
            camera=Camera(resolution=64),
            retina=UniformRetina(),
            illumination=light,
            ambient=Ambient(illumination=light),
            sensor=sensor,
        )
        signals.append(float(Renderer(scene).background().mean(dtype=float)))
    x = np.linspace(*band, 100_001)
    responsivity = np.mean(tabulated("camera_qe_cmv12000", "qe_nir")(x) * x) / 1239.84
    assert signals[0] / signals[1] == pytest.approx(responsivity, rel=1e-3)


def test_nothing_outside_a_filter_s_band():
    """White LED behind an 800 nm long-pass, green line behind a band-pass; against exactly 0, spot and background."""
    blocked = {
        "led-b3": SENSORS["cmv12000-nir-longpass800"],
        "line532": Emva(filters=(BandPass(low=830.0, high=870.0),)),
    }
    for name, sensor in blocked.items():
        light = LIGHTS[name]
        scene = Scene(
            camera=Camera(resolution=64), illumination=light, ambient=Ambient(illumination=light), sensor=sensor
        )
        renderer = Renderer(scene)
        assert renderer.tile(scene.pose(np.array([0.0, 0.0, 5.0])), 0, seed=1).radiance.max() == 0.0
        assert renderer.background().max() == 0.0


def test_infrared_light_and_white_ambient_keep_to_themselves():
    """850 nm spotlight under white ambient light behind a long-pass; against a black background and a lit patch."""
    scene = Scene(
        camera=Camera(resolution=64),
        retina=FundusSite(),
        illumination=LIGHTS["ir850"],
        ambient=Ambient(illumination=LIGHTS["led-b3"]),
        sensor=SENSORS["cmv12000-nir-longpass800"],
    )
    renderer = Renderer(scene)
    assert renderer.background().max() == 0.0
    assert renderer.tile(scene.pose(np.array([0.0, 0.0, 5.0])), 0, seed=1).radiance.max() > 0.0


def test_no_ambient_light_is_black():
    """A living eye without ambient light; against a background of exactly 0."""
    scene = Scene(camera=Camera(resolution=32), retina=FundusSite(), ambient=Ambient(irradiance=0.0))
    assert Renderer(scene).background().max() == 0.0


@pytest.mark.slow
@pytest.mark.skipif(not kernel.load()[2].vectorized, reason="needs a JIT variant to compare the scalar one with")
def test_the_scalar_fallback_agrees_with_the_jit(tmp_path):
    """A fundus in three colour channels by maps averaged over bands; against per-wavelength evaluation; within 1 %."""
    frames = []
    for variant in ("scalar_spectral", kernel.load()[2].variant):
        target = tmp_path / f"{variant}.npy"
        environment = {**os.environ, "CONESPOT_VARIANT": variant}
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", SCALAR, str(target)], env=environment, check=True, timeout=300
        )
        frames.append(np.load(target).astype(float))
    ratio = frames[0] / frames[1]
    assert np.median(ratio, axis=(0, 1)) == pytest.approx(np.ones(3), abs=0.01)
    assert np.abs(ratio - 1.0).mean() < 0.03
