"""Which reading of the paper's bumps (4.2) explains Table V: profile, height and spacing swept, at 2000 px.

Run with `python benchmarks/bump_readings.py [POSES]`; at 100 poses about half a minute a reading on one core. The
localizer is `paper-code-float`, whose errors at 2000 px are the published ones (see `campaign show reproduce_ci`).
"""

from __future__ import annotations

import sys

import numpy as np

from conespot.campaigns.row import Finding, errors
from conespot.localize import locate
from conespot.render import Exposure, Renderer
from conespot.results.paper_values import paper_value
from conespot.scene import Scene, load_scene
from conespot.scene.bump import Bump
from conespot.scene.spotlights import RIGS
from conespot.scene.surface import SURFACES, Surface, bump_grid
from conespot.scene.trajectory import Helix

CELLS, EDGES = (10.0 / 3.0, 2.0), (5.0, 2.5)  #: in the middle of equal cells, or from edge to edge of the 10 x 10 mm


def like(profile: str, height: float = 0.1, diameter: float = 0.5) -> Bump:
    """A bump to repeat [mm]; a Gaussian's diameter is six sigma."""
    return Bump.model_validate({"x": 0.0, "y": 0.0, "profile": profile, "height": height, "diameter": diameter})


READINGS = {
    "smooth": SURFACES["smooth"],
    "cosine, cells (bumps-literal)": SURFACES["bumps-literal"],
    "cosine, cells, half as high": bump_grid(CELLS, like("cosine", 0.05)),
    "cosine, to the edges": bump_grid(EDGES, like("cosine")),
    "cap, cells": bump_grid(CELLS, like("cap")),
    "cap, to the edges": bump_grid(EDGES, like("cap")),
    "Gaussian (6 sigma), cells": bump_grid(CELLS, like("gaussian")),
    "Gaussian (6 sigma), cells, half as high": bump_grid(CELLS, like("gaussian", 0.05)),
    "Gaussian (6 sigma), to the edges (bumps)": SURFACES["bumps"],
    "Gaussian (4 sigma), to the edges": bump_grid(EDGES, like("gaussian", diameter=0.75)),
    "Gaussian (half maximum), to the edges": bump_grid(EDGES, like("gaussian", diameter=0.5 / 2.3548 * 6.0)),
}
METRICS = ("position_error_mm", "rotation_error_deg")


def measured(surface: Surface, rig: str, poses: int) -> dict[str, list[float]]:
    """Mean and largest error of each metric along the helix."""
    plain = load_scene("paper-code")
    camera = plain.camera.model_copy(update={"resolution": 2000})
    scene = Scene(**{**dict(plain), "camera": camera, "spotlights": RIGS[rig], "surface": surface})
    renderer = Renderer(scene)
    exposure = Exposure(renderer.background(), scene.sensor)
    rows = []
    for i, tip in enumerate(Helix().positions(poses, np.random.default_rng(0))):
        pose = scene.pose(tip)
        tiles = [renderer.tile(pose, k, seed=3 * i + k) for k in range(len(scene.spotlights))]
        found = locate(exposure.frame(tiles, scene.power.value), scene, "paper-code-float")
        if found:
            answer = Finding(case="", localizer="", apex=found.apex_mm.tolist(), axis=found.axis.tolist())
            rows.append(errors(pose, answer, scene.instrument.rcm))
    return {m: [float(f([float(row[m]) for row in rows])) for f in (np.mean, np.max)] for m in METRICS}


def main() -> None:
    """Print a line a reading: ours over the paper's, AE and ME of position and rotation, one spotlight | three."""
    poses = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    for name, surface in READINGS.items():
        cells = []
        for rig in ("single", "triple"):
            for metric, pair in measured(surface, rig, poses).items():
                for quantity, ours in zip(("AE", "ME"), pair, strict=True):
                    known = paper_value("Table V", "helix", rig, quantity, metric)
                    cells.append(f"{ours:.3f} ({ours / known:.2f})" if known else f"{ours:.3f}")
        sys.stdout.write(f"{name:42} {' '.join(cells[:4])} | {' '.join(cells[4:])}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
