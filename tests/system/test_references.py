"""Renderings of a fundus against stored reference images, pixel by pixel, as Mitsuba's own tests do.

`python tests/system/test_references.py` makes the references again: only when a change of the image is meant, with the
reason in the commit.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.stats import t

from conespot.render import Renderer
from conespot.scene import Camera, Scene
from conespot.scene.illumination import LIGHTS
from conespot.scene.retina import Fundus
from conespot.scene.sensor import SENSORS

FOLDER = Path(__file__).parents[1] / "data"
NAMES = {"visible": ("led-b3", "cmv12000-mono"), "infrared": ("ir850", "cmv12000-nir")}
#: above the macula beside a vessel of the photograph
APEX = np.array([-0.8, 2.0, 5.0])
RUNS, SAMPLES = 48, 64


def scene_of(name: str) -> Scene:
    """A fundus in white or 850 nm light, 600 px a side."""
    light, sensor = NAMES[name]
    return Scene(camera=Camera(resolution=600), retina=Fundus(), illumination=LIGHTS[light], sensor=SENSORS[sensor])


def renderings(name: str, runs: int, seed: int) -> np.ndarray:
    """Signals `[runs, h, w]` of the spotlight's tile, each with noise of its own."""
    scene = scene_of(name)
    renderer = Renderer(scene, samples=SAMPLES)
    pose = scene.pose(APEX)
    return np.stack([renderer.tile(pose, 0, seed + i).radiance[..., 0] for i in range(runs)]).astype(float)


def make() -> None:
    """Write tests/data/reference_*.npz: mean `[h, w]` and variance of the mean."""
    for name in NAMES:
        images = renderings(name, RUNS, seed=10_000)
        variance = images.var(axis=0, ddof=1) / RUNS
        np.savez_compressed(
            FOLDER / f"reference_{name}.npz",
            mean=images.mean(axis=0).astype(np.float32),
            variance=variance.astype(np.float32),
        )


@pytest.mark.parametrize("name", NAMES)
def test_renderings_match_their_reference(name, tmp_path):
    """Mean of 12 renderings of a fundus; against the reference; a z-test per pixel, Sidak-corrected, at 0.1 %.

    A failure leaves the images and their z behind.
    """
    stored = np.load(FOLDER / f"reference_{name}.npz")
    images = renderings(name, 12, seed=1)
    mean, own = images.mean(axis=0), images.var(axis=0, ddof=1)
    assert mean.shape == stored["mean"].shape
    # the spread is pooled: that of the reference's runs is the better known of the two
    single = (stored["variance"].astype(float) * RUNS * (RUNS - 1) + own * 11.0) / (RUNS + 10.0)
    lit = (single > 0.0) & (stored["mean"] > 1e-3 * stored["mean"].max())
    z = np.zeros(mean.shape)
    z[lit] = (mean - stored["mean"])[lit] / np.sqrt(single[lit] * (1.0 / 12.0 + 1.0 / RUNS))
    limit = t.isf((1.0 - 0.999 ** (1.0 / lit.sum())) / 2.0, RUNS + 10)
    if np.abs(z).max() >= limit:
        for label, image in (("rendered", mean), ("reference", stored["mean"]), ("z", 0.5 + z / (4.0 * limit))):
            scale = 255.0 / (1.0 if label == "z" else float(stored["mean"].max()))
            cv2.imwrite(str(tmp_path / f"{name}_{label}.png"), np.clip(image * scale, 0, 255).astype(np.uint8))
    assert lit.sum() > 2000
    assert np.abs(z).max() < limit, f"images are in {tmp_path}"
    # a shift of the whole image hides below every pixel's noise, but not below its mean's
    assert abs(z[lit].mean()) * np.sqrt(lit.sum()) < 5.0


def test_vessels_show_in_green_light_and_not_at_850_nm():
    """Local contrast inside the patch of the reference images; white light against 850 nm; more than twice."""
    contrast = {}
    for name in NAMES:
        image = np.load(FOLDER / f"reference_{name}.npz")["mean"]
        inside = cv2.erode((image > 0.5 * image.max()).astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
        smooth = cv2.GaussianBlur(image, (0, 0), 8.0)
        contrast[name] = 1.0 - np.percentile((image / smooth)[inside], 1.0)
    assert contrast["visible"] > 2.0 * contrast["infrared"]


if __name__ == "__main__":
    make()
