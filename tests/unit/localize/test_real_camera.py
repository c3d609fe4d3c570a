"""Localizers on frames of a camera as a microscope has it, and on those of the ideal pinhole beside them."""

import math
from functools import lru_cache

import numpy as np
import pytest
from photographs import NOISE, fundus, photograph

from conespot.localize import Localization, locate
from conespot.scene import Camera, Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.distortion import Distortion
from conespot.scene.optics import Optics
from conespot.scene.sensor import Linear

IDEAL = Camera(resolution=1000)
#: fields as wide as the ideal one's; distortion moves the left and right edge by 10 px
REAL = Camera(
    resolution=(960, 540),
    pixel_aspect=1.05,
    principal_point=(500.0, 255.0),
    distortion=Distortion(k1=-5.0, k2=200.0, p1=0.05, p2=-0.08),
    tilt=math.radians(5.0),
    azimuth=math.radians(30.0),
    roll=math.radians(20.0),
)
TIPS = (1.0, 0.5, 4.0), (0.4, 0.3, 3.0), (-0.5, 0.2, 3.4)


@lru_cache
def taken(tip, real, soft):
    scene = Scene(beam=CyclesBeam() if soft else HardBeam(), camera=REAL if real else IDEAL, sensor=Linear(bits=12))
    return scene, photograph(scene, scene.pose(np.array(tip)), fundus(0.2))


def missed_um(localizer, *, real, soft=False, **more):
    """Root mean square over the tips."""
    errors = []
    for tip in TIPS:
        scene, image = taken(tip, real, soft)
        found = locate(image, scene, localizer, **more)
        assert isinstance(found, Localization), getattr(found, "reason", found)
        errors.append(np.linalg.norm(found.apex_mm - tip))
    return 1e3 * float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.parametrize(
    "soft", [pytest.param(False, id="hard"), pytest.param(True, id="soft", marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("localizer", ["cone", "photometric"])
def test_an_oblong_aslant_distorting_camera_is_as_good_as_the_ideal_one(localizer, soft):
    real, ideal = (missed_um(localizer, real=camera, soft=soft, noise=NOISE) for camera in (True, False))
    assert real < 2.0 * ideal + 5.0


def test_the_published_method_sees_what_such_a_camera_sees_through_the_papers_own_pinhole():
    real, ideal = (missed_um("paper", real=camera) for camera in (True, False))
    assert real < 2.0 * ideal + 20.0


def test_the_exact_method_sees_through_lens_and_contact_lens_with_the_lights_own_dispersion():
    """A hard cone at 850 nm under Navarro's eye and a flat contact lens, aslant; the frame is cast by exact rays."""
    optics = Optics(lens="phakic", contact="flat")
    camera = Camera(
        resolution=(480, 270),
        sensor_width=24.0,
        focal_length=750.0,
        height=200.0,
        tilt=math.radians(5.0),
        optics=optics,
    )
    scene = Scene(beam=HardBeam(), camera=camera, sensor=Linear(bits=12), illumination="ir850")
    tip = np.array([0.4, 0.3, 3.0])
    image = photograph(scene, scene.pose(tip), rays=12)
    yellow = scene.model_copy(update={"camera": camera.seeing(589.3)})
    off, wrong = (locate(image, told, "cone", noise=NOISE).apex_mm - tip for told in (scene, yellow))
    assert np.linalg.norm(off) < 3e-3 < np.linalg.norm(wrong)
