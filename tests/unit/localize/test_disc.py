"""Soft patches with an optic disc in them: its rim may pass for the end of the light."""

import math

import numpy as np
import pytest
from photographs import NOISE, fundus, photograph, scene_of

from conespot.localize import Knowns, Localization, locate
from conespot.localize.outcome import VARIED
from conespot.scene.beam import CyclesBeam

TIP = (1.0, 0.5, 6.5)


def with_disc(texture, at, radius, times):
    """The `texture` with a disc about `at` [mm] that is so many times as bright."""
    y, x = np.mgrid[:1400, :1400]
    distance = np.hypot(0.01 * (x - 700) - at[0], 0.01 * (700 - y) - at[1])
    return texture * np.where(distance < radius, times, 1.0).astype(np.float32)


@pytest.mark.parametrize(("times", "refused"), [(1.0, False), (4.0, True)])
def test_a_disc_within_a_soft_patch_is_refused_and_mottle_is_not(times, refused):
    scene = scene_of(CyclesBeam(), resolution=400)
    pose = scene.pose(np.array(TIP))
    outline = scene.outline(pose, 0, 64)
    middle, size = outline.mean(axis=0), float(np.mean(np.linalg.norm(outline - outline.mean(axis=0), axis=1)))
    texture = with_disc(fundus(0.1), middle[:2] + [0.25 * size, 0.0], 0.8 * size, times)
    found = locate(photograph(scene, pose, texture), scene, "photometric", knowns=Knowns(0.05), noise=NOISE)
    if refused:
        assert getattr(found, "reason", None) == VARIED
    else:
        assert isinstance(found, Localization)
        sigma = math.sqrt(float(np.trace(found.covariance[:3, :3])))
        assert np.linalg.norm(found.apex_mm - pose.apex) < 6.0 * sigma + 0.05
