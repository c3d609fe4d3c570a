"""Where a patch is smooth few samples are taken: what that leaves of noise, and that it changes nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t

from conespot.render import Exposure, Renderer, Tile
from conespot.render.monte_carlo import tolerance
from conespot.scene import Camera, Scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.retina import Fundus, PhotoRetina
from conespot.scene.sensor import SENSORS, Linear, Srgb8
from conespot.scene.surface import SURFACES

TIP = np.array([1.2, -0.7, 4.0])
RUNS = 16
SCENES = {
    "soft": Scene(camera=Camera(resolution=1000), beam=CyclesBeam(), retina=PhotoRetina()),
    "hard": Scene(camera=Camera(resolution=1000), beam=HardBeam(), retina=PhotoRetina()),
    "bumps": Scene(camera=Camera(resolution=1000), surface=SURFACES["bumps"], retina=PhotoRetina()),
    "camera": Scene(camera=Camera(resolution=600), retina=Fundus(), sensor=SENSORS["cmv12000-mono"]),
}


@pytest.fixture(scope="module")
def both():
    """Tiles `[RUNS, h, w]` and their crop, with few samples where they are enough and with all, made once a scene."""
    made = {}

    def make(name):
        if name not in made:
            scene = SCENES[name]
            pose = scene.pose(TIP)
            crop = Renderer(scene).footprint(pose, 0)
            stacks = [
                np.stack([renderer.tile(pose, 0, seed=first + i).radiance[..., 0] for i in range(RUNS)])
                for first, renderer in ((100, Renderer(scene)), (200, Renderer(scene, noise=0.0)))
            ]
            made[name] = crop, *stacks
        return made[name]

    return make


#: bumps take as long as all others, and a real camera as long as the rest
EACH = [pytest.param(name, marks=pytest.mark.slow if name in {"bumps", "camera"} else ()) for name in SCENES]


@pytest.mark.parametrize("name", EACH)
def test_few_samples_show_what_all_of_them_show(both, name):
    """Means of 16 renderings; z-test per pixel, Sidak-corrected at 1 %, and of all pixels together."""
    _, few, many = (a.astype(float) if isinstance(a, np.ndarray) else a for a in both(name))
    variance = few.var(axis=0, ddof=1) + many.var(axis=0, ddof=1)
    lit = variance > 1e-12 * many.max() ** 2
    z = (few.mean(axis=0) - many.mean(axis=0))[lit] / np.sqrt(variance[lit] / RUNS)
    assert lit.sum() > 2000
    # the two variances are unequal, so that the mean of few has the fewest degrees of freedom
    assert np.abs(z).max() < t.isf((1.0 - 0.99 ** (1.0 / lit.sum())) / 2.0, RUNS - 1)
    assert abs(z.mean()) * np.sqrt(lit.sum()) < 5.0


@pytest.mark.parametrize("name", EACH)
def test_noise_is_what_the_sensor_forgives_or_what_all_samples_leave(both, name):
    """Pixels twice as noisy as the tolerance and as all samples leave them; against 1 % of all.

    Of two standard deviations of 16 runs, in truth equal, one is twice the other in 0.5 % of cases.
    """
    _, few, many = both(name)
    bound = 2.0 * np.maximum(tolerance(SCENES[name].sensor) * many.mean(axis=0), many.std(axis=0, ddof=1))
    lit = many.mean(axis=0) > 0.0
    assert (few.std(axis=0, ddof=1) > bound)[lit].mean() < 0.01


@pytest.mark.parametrize("power", [0.05, 0.25, 1.0])
def test_an_edge_lies_where_all_samples_put_it(both, power):
    """Where rows cross level 50 of 255 on the patch's left and right; few against all samples; mean to 0.02 px."""
    scene = SCENES["soft"]
    crop, few, many = both("soft")
    background = np.zeros((1000, 1000, 1), np.float32)
    exposure = Exposure(background, Linear(white=scene.sensor.white, bits=16))
    level = 0.0319 * 65535.0  # of 255 after the sRGB transfer: 50
    places = []
    for stack in (few, many):
        found = []
        for radiance in stack:
            image = exposure.frame([Tile(crop, radiance[..., None])], power)[crop.slices].astype(float)
            found.append(crossings(image, level))
        places.append(np.stack(found))
    assert places[0].shape[1] > 40
    assert np.abs(places[0].mean(axis=(0, 1)) - places[1].mean(axis=(0, 1))).max() < 0.02
    assert np.sqrt(np.mean(places[0].var(axis=0))) < 1.2 * np.sqrt(np.mean(places[1].var(axis=0)))


def crossings(image: np.ndarray, level: float) -> np.ndarray:
    """Columns `[N, 2]` where the middle half of the rows rise above the level first and fall below it last."""
    rows = image[len(image) // 4 : 3 * len(image) // 4]
    found = []
    for row in rows:
        above = np.flatnonzero(row > level)
        first, last = above[0], above[-1]
        rise = first - (row[first] - level) / (row[first] - row[first - 1])
        fall = last + (row[last] - level) / (row[last] - row[last + 1])
        found.append((rise, fall))
    return np.array(found)


def test_the_tolerance_is_half_a_level_at_white():
    """A white pixel and one darker by the tolerance, exposed; half a level of 8 and of 12 bits apart."""
    for sensor, levels in ((Srgb8(), 255), (Linear(bits=12), 4095)):
        darker = 1.0 - tolerance(sensor)
        value = 1.055 * darker ** (1.0 / 2.4) - 0.055 if levels == 255 else darker
        assert levels * (1.0 - value) == pytest.approx(0.5, rel=0.01)


def test_a_pixel_that_a_hard_edge_barely_enters_gets_all_samples():
    """256 stratified samples scatter a mid-edge pixel by 1 % of the step; four that all miss it are off by a fourth."""
    scene = SCENES["hard"].model_copy(update={"camera": Camera(resolution=500)})
    few, many = Renderer(scene, samples=256), Renderer(scene, samples=256, noise=0.0)
    for number, tip in enumerate((TIP, TIP + 0.3, TIP - 0.4)):
        pose = scene.pose(tip)
        one, other = (renderer.tile(pose, 0, seed=number).radiance[..., 0] for renderer in (few, many))
        assert np.abs(one - other).max() < 0.08 * other.max()
