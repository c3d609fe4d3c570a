"""localize.sequence: the view without spotlights, from frames that each hide a part of it."""

import math

import numpy as np
import pytest

from conespot.localize.sequence import AmbientMap
from conespot.scene import InputError
from conespot.scene.beam import CyclesBeam
from conespot.scene.emva import Emva
from conespot.scene.sensor import Linear


@pytest.fixture
def exposed(frames):
    """The retina as it is, and frames `[H, W]` of it with a patch each, exposed to different levels."""

    def make(sensor, levels=(1.0, 0.3, 0.6, 0.2, 0.8)):
        scene = frames.make_scene(resolution=400, sensor=sensor, beam=CyclesBeam())
        rng = np.random.default_rng(2)
        x, y = np.meshgrid(np.arange(400), np.arange(400))
        retina = 0.05 * (1.0 + 0.3 * np.sin(x / 25.0) * np.cos(y / 31.0))
        taken = []
        for i, level in enumerate(levels):
            pose = scene.pose(np.array([1.5 * math.sin(i), 1.5 * math.cos(i), 4.0]))
            (low, tile), *_ = frames.tiles(scene, pose)
            light = retina.copy()
            light[low[1] : low[1] + tile.shape[0], low[0] : low[0] + tile.shape[1]] += 0.8 * tile / tile.max()
            black = getattr(sensor, "black_level", 0.0) / sensor.full_scale
            signal = black + level * light + rng.normal(0.0, 2e-4, light.shape)
            taken.append(np.clip(np.round(signal * sensor.full_scale), 0, sensor.full_scale).astype(np.uint16))
        return scene, retina, taken

    return make


@pytest.mark.parametrize("sensor", [Linear(bits=12), Emva(black_level=64.0)], ids=["linear", "camera"])
def test_frames_of_different_exposure_give_one_view_without_seams(exposed, sensor):
    """The learnt view over the retina, pixel by pixel: one factor everywhere, within the noise of the frames."""
    scene, retina, frames = exposed(sensor)
    ambient = AmbientMap(scene)
    assert all(ambient.add(frame) for frame in frames)
    learnt = ambient.reference()
    black = getattr(sensor, "black_level", 0.0) / sensor.full_scale
    ratio = (learnt.pixels - black) / retina
    assert np.std(ratio) / np.mean(ratio) < 0.01
    columns, rows = (np.median(ratio, axis=k) / np.mean(ratio) for k in (0, 1))
    assert max(np.ptp(columns), np.ptp(rows)) < 0.01
    assert 4.0 < learnt.frames <= 5.0


def test_a_sequence_needs_two_frames_of_one_shape(exposed):
    scene, _, frames = exposed(Linear(bits=12))
    ambient = AmbientMap(scene)
    assert ambient.reference() is None
    assert ambient.add(frames[0])
    assert ambient.reference() is None
    with pytest.raises(InputError, match="shape"):
        ambient.add(np.stack([frames[1]] * 3, axis=-1))


def test_a_frame_without_a_patch_teaches_nothing(exposed):
    scene, _, frames = exposed(Linear(bits=12))
    ambient = AmbientMap(scene)
    assert not ambient.add(np.full_like(frames[0], 200))
