"""What interreflection changes for the localizer."""

from __future__ import annotations

import math

import numpy as np
import pytest

from conespot.localize import locate
from conespot.render import Exposure, Renderer
from conespot.scene import Camera, Scene
from conespot.scene.beam import HardBeam
from conespot.scene.illumination import Ambient
from conespot.scene.retina import UniformRetina
from conespot.scene.sensor import Linear
from conespot.scene.trajectory import Helix


@pytest.mark.parametrize("albedo", [0.125, 0.3])
def test_light_reflected_twice_or_more_moves_the_published_tip_by_micrometres(albedo):
    """Tips from frames of 1000 px with the indirect light of a closed sphere against tips without it.

    The indirect irradiance Phi rho / (4 pi R^2 (1 - rho)) is even over the wall, so it is added to every pixel; that
    the path tracer gives just this is `test_spectral.test_closed_sphere_is_an_integrating_sphere`.
    Where the tip moves at all, Otsu's threshold has jumped by one of its 256 levels.
    """
    scene = Scene(
        camera=Camera(resolution=1000),
        beam=HardBeam(),
        retina=UniformRetina(albedo=albedo),
        ambient=Ambient(irradiance=0.0),
        sensor=Linear(white=400.0 * albedo / 0.125, bits=16),
    )
    renderer = Renderer(scene, samples=16)
    flux = scene.power.flux(scene.beam)
    sphere = 4.0 * math.pi * (scene.eye.radius * 1e-3) ** 2
    indirect = np.float32(albedo / math.pi * flux * albedo / (sphere * (1.0 - albedo)))
    dark = renderer.background()
    exposures = [Exposure(background, scene.sensor) for background in (dark, dark + indirect)]
    moved, share = [], []
    for tip in Helix().positions(10, np.random.default_rng(0)):
        tile = renderer.tile(scene.pose(tip), 0, seed=2)
        share.append(indirect / tile.radiance.max())
        without, with_it = (locate(e.frame([tile], 1.0), scene, "paper") for e in exposures)
        assert bool(with_it) == bool(without)
        if with_it and without:
            moved.append(1e3 * np.linalg.norm(with_it.apex_mm - without.apex_mm))
    assert len(moved) >= 8, "near-circles tell nothing, the others must"
    assert max(share) < 1e-3
    assert np.median(moved) < 1.0
    assert max(moved) < 10.0
