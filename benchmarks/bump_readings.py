"""Which reading of the paper's bumps (4.2) explains Table V: what is left open is swept, without rendering a frame.

Run with `python benchmarks/bump_readings.py`; about 20 s a reading on one core. Frames are cast from the scene's
geometry in bins of 4 px, enlarged to the paper's 5000 px without noise, and localized as the authors' code does, along
the helix with one spotlight and with three. They are good to some 4 % of the means: rendered frames, which decide, give
0.0310 and 0.0258 mm on the smooth helix where these give 0.032 and 0.027.
"""

from __future__ import annotations

import argparse
import math

import cv2
import numpy as np
from numpy.typing import NDArray

from conespot.campaigns.row import Finding, errors
from conespot.localize import locate
from conespot.localize.model.forward import look, window
from conespot.results.paper_values import paper_value
from conespot.scene import Scene, load_scene
from conespot.scene.bump import Bump
from conespot.scene.spotlights import RIGS, spotlight_axes
from conespot.scene.surface import Surface, bump_grid
from conespot.scene.trajectory import Helix

Array = NDArray[np.float64]

BIN = 4  #: [px]
ALBEDO = 0.077  #: mean of the presets' retina in the frame
CELLS, EDGES = (10.0 / 3.0, 2.0), (5.0, 2.5)  #: bumps in the middle of equal cells, or out to the edges of 10 x 10 mm


def like(profile: str, height: float = 0.1, diameter: float = 0.5) -> Bump:
    """A bump to repeat; a Gaussian's diameter is six sigma."""
    return Bump.model_validate({"x": 0.0, "y": 0.0, "profile": profile, "height": height, "diameter": diameter})


READINGS = {
    "smooth": Surface(),
    "cosine, cells (bumps-literal)": bump_grid(CELLS, like("cosine")),
    "cosine, cells, 0.05 mm high": bump_grid(CELLS, like("cosine", 0.05)),
    "cosine, to the edges": bump_grid(EDGES, like("cosine")),
    "cap, cells": bump_grid(CELLS, like("cap")),
    "cap, to the edges": bump_grid(EDGES, like("cap")),
    "Gaussian, 6 sigma = 0.5 mm, cells": bump_grid(CELLS, like("gaussian")),
    "Gaussian, 6 sigma = 0.5 mm, cells, 0.05 mm high": bump_grid(CELLS, like("gaussian", 0.05)),
    "Gaussian, 6 sigma = 0.5 mm, to the edges (bumps)": bump_grid(EDGES, like("gaussian")),
    "Gaussian, 4 sigma = 0.5 mm, to the edges": bump_grid(EDGES, like("gaussian", diameter=0.75)),
    "Gaussian, half maximum at 0.5 mm, to the edges": bump_grid(EDGES, like("gaussian", diameter=3.0 / 2.3548)),
}


class Bench:
    """Casts noise-free frames of one scene; what its pixels see is worked out once."""

    def __init__(self, scene: Scene) -> None:
        bins = scene.camera.resolution // BIN
        sight = look(scene, window(0, 0, bins, bins, BIN), BIN)
        self.scene = scene
        self._points, self._normals = (field.reshape(bins, bins, 3) for field in (sight.points, sight.normals))
        self._ambient = scene.ambient.irradiance * np.maximum(self._normals @ scene.ambient.towards, 0.0)

    def frame(self, tip: Array) -> NDArray[np.uint8]:
        """The frame `[H, W]` of the pose with its tip there."""
        pose = self.scene.pose(tip)
        irradiance = self._ambient.copy()
        edge = np.concatenate([self.scene.outline(pose, k, 64) for k in range(len(self.scene.spotlights))])
        places = self.scene.camera.project(edge) / BIN
        low = np.maximum(places.min(axis=0).astype(int) - 25, 0)
        high = np.minimum(places.max(axis=0).astype(int) + 26, len(irradiance))
        here = np.s_[low[1] : high[1], low[0] : high[0]]
        to = self._points[here] - pose.apex
        distance = np.linalg.norm(to, axis=-1)
        to /= distance[..., None]
        incident = np.maximum(-np.sum(self._normals[here] * to, axis=-1), 0.0) / distance**2 * 1e6
        intensity = self.scene.power.axial_intensity(self.scene.beam)
        for axis in spotlight_axes(pose, self.scene.spotlights):
            irradiance[here] += intensity * self.scene.beam.intensity(to @ axis) * incident
        shown = cv2.resize(
            (ALBEDO / math.pi * irradiance).astype(np.float32), self.scene.camera.shape, interpolation=cv2.INTER_CUBIC
        )
        from conespot.render.exposure import encode

        return np.asarray(encode(shown, self.scene.sensor), np.uint8)
