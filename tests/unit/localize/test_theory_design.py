"""Design guidance follows from the bound."""

import math

import numpy as np
import pytest

from conespot.localize.theory.design import compare_designs, ring
from conespot.scene.beam import HardBeam
from conespot.scene.camera import Camera
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.spotlights import spotlight_axes

SCENE = Scene(beam=HardBeam(), camera=Camera(resolution=500))
TIPS = ((0.0, 0.0, 3.0), (1.0, 1.0, 4.5))


@pytest.mark.parametrize("count", [2, 3, 5])
def test_a_ring_of_spotlights_leans_off_the_needle_by_its_spread(count):
    down = np.array([0.0, 0.0, -1.0])
    axes = spotlight_axes(Pose(np.zeros(3), down), ring(count, math.radians(11.0)))
    np.testing.assert_allclose(np.degrees(np.arccos(axes @ down)), 11.0, atol=1e-9)
    assert np.linalg.norm(axes[:, :2].sum(axis=0)) < 1e-9


def test_a_softer_edge_and_fewer_spotlights_tell_less():
    soft = compare_designs(SCENE, TIPS, softness=(0.0, 0.3, 1.0))
    assert [d.position_mm for d in soft] == sorted(d.position_mm for d in soft)
    rigs = compare_designs(SCENE, TIPS, rigs=((1, 0.0), (2, 0.19), (3, 0.19)))
    assert [d.position_mm for d in rigs] == sorted((d.position_mm for d in rigs), reverse=True)


def test_a_wider_cone_holds_the_tip_better():
    designs = compare_designs(SCENE, TIPS, half_angles=[math.radians(a) for a in (5.0, 9.0, 15.0)])
    assert [d.position_mm for d in designs] == sorted((d.position_mm for d in designs), reverse=True)
