"""A visible shaft in front of the patch and its shadow: what is left of the patch tells the tip."""

from __future__ import annotations

import numpy as np
import pytest

from conespot.localize import locate
from conespot.localize.model.knowns import Knowns
from conespot.localize.model.occlusion import covered
from conespot.localize.theory.bounds import patch_pixels
from conespot.render import Exposure, Renderer
from conespot.scene import Camera, Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.retina import PhotoRetina
from conespot.scene.sensor import Linear
from conespot.scene.spotlights import RIGS, Instrument, Shaft

KNOWNS = Knowns(rcm_sigma_mm=None)
#: light, rig, tip [mm], largest error [mm]: hard edges to a micrometre or two, a soft one on texture to tens of them
CASES = [
    (HardBeam(), "single", (5.0, 1.0, 4.0), 2e-3),
    pytest.param(HardBeam(), "single", (3.0, 1.0, 4.0), 2e-3, marks=pytest.mark.slow),
    pytest.param(HardBeam(), "triple", (5.0, 1.0, 4.0), 1e-3, marks=pytest.mark.slow),
    (CyclesBeam(), "single", (4.0, -1.0, 3.0), 0.05),
]


@pytest.mark.parametrize(("beam", "rig", "tip", "largest"), CASES)
def test_a_patch_behind_the_shaft_counts_with_what_is_visible(beam, rig, tip, largest):
    scene = Scene(
        camera=Camera(resolution=1000),
        beam=beam,
        retina=PhotoRetina(),
        sensor=Linear(bits=12),
        spotlights=RIGS[rig],
        instrument=Instrument(shaft=Shaft()),
    )
    pose = scene.pose(np.array(tip))
    renderer = Renderer(scene, samples=64, edge_samples=512)
    tiles = [renderer.tile(pose, k, seed=k + 1) for k in range(len(scene.spotlights))]
    image = Exposure(renderer.background(pose), scene.sensor).frame(tiles, 0.004)
    hidden = covered(patch_pixels(scene, pose), pose, scene)
    assert hidden.mean() > 0.05, "the shaft must be in the way for this to mean anything"
    found = locate(image, scene, "cone", knowns=KNOWNS)
    assert found
    assert np.linalg.norm(found.apex_mm - pose.apex) < largest
