"""Tips so near the wall that their patches are hardly larger than what spreads them."""

import cv2
import numpy as np
import pytest
from photographs import AMBIENT, NOISE, PEAK, READ, WHITE, cast, spotlight

from conespot.localize import Knowns, locate
from conespot.localize.image import Frame
from conespot.localize.model.estimate import Estimate
from conespot.localize.spot.light import Moving, SpotLight
from conespot.localize.spot.start import spot_start
from conespot.localize.spot.window import is_spot, window_of
from conespot.scene.beam import HardBeam
from conespot.scene.camera import Camera
from conespot.scene.lens import Lens
from conespot.scene.motion import Tremor
from conespot.scene.point_spread import GaussianSpread
from conespot.scene.pose import Pose
from conespot.scene.scene import Scene
from conespot.scene.sensor import Linear

CORE, BLUR, WALL = 0.1, 0.006, np.array([0.4, -0.3])


@pytest.fixture(scope="module")
def near():
    """A hand that trembles with a fibre above a few millimetres of retina, 7 um a pixel."""
    lens = Lens(blur=GaussianSpread(sigma=BLUR))
    camera = Camera(resolution=400, focal_length=1500.0, lens=lens)
    return Scene(
        beam=HardBeam(source_diameter=CORE), camera=camera, sensor=Linear(bits=12), motion=Tremor(exposure=0.008)
    )


def above(scene, distance):
    """The pose with the tip so far above WALL along its axis [mm]."""
    wall = np.append(WALL, float(scene.eye.centre[2] - np.sqrt(scene.eye.radius**2 - WALL @ WALL)))
    axis = Pose.through(wall + [0.0, 0.0, 0.5], scene.instrument.rcm).axis
    return Pose.through(wall - distance * axis, scene.instrument.rcm)


def places(scene, pose, way, instants=9, parts=32):
    """Poses whose tips are spread over the core, on a straight way."""
    radius, angle = CORE / 2.0 * np.sqrt((np.arange(parts) + 0.5) / parts), np.arange(parts) * 2.399963
    disc = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    for share in (np.arange(instants) + 0.5) / instants - 0.5:
        moved = Pose.through(pose.apex + share * way, scene.instrument.rcm)
        for off in disc @ moved.rotation()[:, :2].T:
            yield Pose(moved.apex + off, moved.axis)


def light_of(scene, pose, way, low, side, k=2):
    """The mean light of `side` x `side` pixels from `low` on."""
    x, y = (low[i] + (np.arange(side * k) + 0.5) / k for i in (0, 1))
    points = cast(scene, x, y)
    found = np.mean([spotlight(scene, one, points) for one in places(scene, pose, way)], axis=0)
    sharp = found.reshape(side, k, side, k).mean(axis=(1, 3))
    return cv2.GaussianBlur(sharp, (0, 0), BLUR / scene.camera.pixel_pitch)


def exposed(scene, pose, way, seed, side=60):
    low = np.round(scene.camera.project(scene.surface.intersect(scene.eye, pose.apex[None], pose.axis[None]))[0])
    low = low.astype(int) - side // 2
    light = light_of(scene, pose, way, low, side)
    electrons = np.full(scene.camera.shape, AMBIENT)
    electrons[low[1] : low[1] + side, low[0] : low[0] + side] += PEAK * light / light.max()
    rng = np.random.default_rng(seed)
    electrons = rng.poisson(electrons) + READ * rng.standard_normal(electrons.shape)
    return np.clip(np.round(electrons / WHITE * 4095.0), 0, 4095).astype(np.uint16)


def test_a_spots_light_is_that_of_all_places_of_its_core_and_its_way(near):
    pose, way = above(near, 0.3), np.array([0.08, -0.03, 0.05])
    at = window_of(Estimate(pose, near))
    own, _ = SpotLight(at, near)(Moving(Estimate(pose, near), way))
    assert at.side == 1
    side = max(at.height, at.width)
    true = light_of(near, pose, way, (at.column, at.row), side)[: at.height, : at.width]
    off = own.reshape(at.height, at.width) * (true.sum() / own.sum()) - true
    assert np.abs(off).max() < 0.03 * true.max()
    assert np.sqrt(np.mean(np.square(off))) < 0.006 * true.max()


@pytest.mark.parametrize(
    ("distance", "way"),
    [(0.3, (0.07, -0.03, 0.02)), pytest.param(0.8, (0.0, 0.05, 0.04), marks=pytest.mark.slow)],
)
def test_a_tip_near_the_wall_is_found_where_core_and_way_are_as_wide_as_its_patch(near, distance, way):
    pose = above(near, distance)
    assert is_spot(Estimate(pose, near))
    found = locate(exposed(near, pose, np.array(way), 3), near, "cone", noise=NOISE, knowns=Knowns(rcm_sigma_mm=0.02))
    assert found, found.reason
    off = found.apex_mm - pose.apex
    assert np.linalg.norm(off) < 0.02
    assert abs(found.distance.along_mm - distance) < 4.0 * found.distance.sigma_along_mm < 0.05


@pytest.mark.slow
def test_a_round_light_that_is_no_spot_is_not_taken_for_one(near):
    y, x = np.mgrid[:400, :400] + 0.5
    off = np.hypot(x - 210.0, y - 190.0)
    for seed, light in enumerate((off < 20.0, np.maximum(1.0 - off / 30.0, 0.0))):
        rng = np.random.default_rng(seed)
        electrons = rng.poisson(AMBIENT + PEAK * light) + READ * rng.standard_normal(light.shape)
        frame = np.clip(np.round(electrons / WHITE * 4095.0), 0, 4095).astype(np.uint16)
        assert spot_start(Frame(frame, near.sensor), near) is None
