"""Every effect of `campaigns/reality.yaml`, and what becomes of answers by what a localizer is told of it.

`python benchmarks/told_worlds.py ROWS.csv` renders frames with each effect alone and with all of them (`theatre`), and
has `photometric` find their tips, told rightly, told wrongly (`WRONG` says how), wrongly but with its sigma (`SIGMAS`)
and told nothing: that the world is `theatre-ideal`, its light and camera apart. `MORE` are worlds that are told wrongly
and are in no effect: beam, camera, wall and transfer. The RCM is told with an error of 0.05 mm along each axis, which
is also its sigma. `--poses N` frames a cell, `--columns N` px, `--effects` by name. What is in ROWS.csv is not measured
again, so that the command can be stopped and given again with more poses. Printed: the matrix of docs/localizers.md.

Rendered so that rendering adds nothing: with 16 samples and 512 on edges, 83 % of 24 tips of the ideal world were
inside their 95 % ellipsoids, with these 96 %.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, chi2

from conespot.campaigns.schema import combinations, read_campaign
from conespot.localize import Knowns, Localization, locate
from conespot.localize.image import AnyImage
from conespot.render import Exposure, Renderer
from conespot.scene import Pose, Scene

Array = NDArray[np.float64]
#: what is told in place of the truth
WRONG: dict[str, dict[str, Any]] = {
    "eye's optics": {"scene.camera.optics": {"eye": "navarro", "lens": "aphakic", "contact": "flat", "pupil": "8 mm"}},
    "aslant": {
        "scene.camera": {"tilt": "4 deg", "azimuth": "90 deg", "look_at": ["0 mm", "0 mm", "9 mm"], "height": "181 mm"}
    },
    "tissue": {"scene.retina.spread": {"scattering": 1, "amount": 2, "length": 2}},
    "depth of field": {"scene.camera.lens": {"numerical_aperture": 0.03, "focus": "0 mm"}},
    "blur": {"scene.camera.lens": {"blur": "11.4 um"}},
    "glare": {"scene.camera.lens": {"glare": 0.04}},
    "fibre's core": {"scene.beam.source_diameter": "0.05 mm"},
    "tremor": {
        "scene.motion": {
            "kind": "tremor", "rms": "0.091 mm", "frequency": "9 Hz", "bandwidth": "2 Hz", "frame_rate": "60 Hz"
        }
    },
    "microscope's light": {"scene.ambient.irradiance": "5 W/m2"},
    "fixed pattern": {"scene.sensor.fixed_pattern": {"serial": 1, "prnu": {"pixel": 0.004}}},
    "recording": {
        "scene.sensor": {
            "kind": "recorded", "quality": 90, "range": "full",
            "camera": {"kind": "emva", "chip": "cmv12000-nir", "exposure_time": "8 ms", "f_number": 8.7},
        }
    },
    "theatre": {
        "scene": "theatre",
        "scene.camera.optics": {"eye": "navarro", "lens": "aphakic", "contact": "flat", "pupil": "8 mm"},
    },
}  # fmt: skip
_RECORDED: dict[str, Any] = {
    "kind": "recorded", "quality": 90,
    "camera": {"kind": "emva", "chip": "cmv12000-nir", "exposure_time": "8 ms", "f_number": 8.7},
}  # fmt: skip
_CAMERA: dict[str, Any] = _RECORDED["camera"]
#: hardly compressed: its values have gamma and the camera's noise
_CURVED = {"scene.sensor": _RECORDED | {"quality": 100}}
_SOFT = {"scene.beam": {"kind": "cycles", "half_angle": "9 deg"}}
#: without noise there must be light around a patch that stands out
_LIT = {"scene.ambient.irradiance": "50 W/m2"}
#: twice the brightest light
_GAMMA: dict[str, Any] = {"kind": "srgb8", "white": "10 W/m2/sr"}
_LINEAR: dict[str, Any] = {"kind": "linear", "white": "10 W/m2/sr", "bits": 8}
#: worlds beside the effects: what is true, and what is told in its place
MORE: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "half angle": ({}, {"scene.beam.half_angle": "9.2 deg"}),
    "half angle, soft": (_SOFT, {"scene.beam": {"kind": "cycles", "half_angle": "9.2 deg"}}),
    "camera's height": ({}, {"scene.camera.height": "191 mm"}),
    "ellipsoid": ({"scene.surface": {"semi_axes": [1, 1, 1.05]}}, {"scene.surface": {"semi_axes": [1, 1, 1]}}),
    "gamma": (_LIT | {"scene.sensor": _GAMMA}, _LIT | {"scene.sensor": _LINEAR}),
    "gamma, soft": (_LIT | _SOFT | {"scene.sensor": _GAMMA}, _LIT | _SOFT | {"scene.sensor": _LINEAR}),
    "linear": (_LIT | {"scene.sensor": _LINEAR}, _LIT | {"scene.sensor": _GAMMA}),
    "linear, soft": (_LIT | _SOFT | {"scene.sensor": _LINEAR}, _LIT | _SOFT | {"scene.sensor": _GAMMA}),
    "camera's gamma": (_CURVED, {"scene.sensor": _CAMERA}),
    "camera's gamma, soft": (_SOFT | _CURVED, _SOFT | {"scene.sensor": _CAMERA}),
    "black": ({"scene.sensor": _CAMERA}, {"scene.sensor": _CAMERA | {"black_level": 64}}),
    "full range": (
        {"scene.sensor": _RECORDED | {"range": "full"}}, {"scene.sensor": _RECORDED | {"range": "limited"}}
    ),
}  # fmt: skip
#: the light of an effect that the white LED does not show
LIGHTS = {"tissue": "infrared"}
TOLD = ("rightly", "wrongly", "wrongly, with its sigma", "nothing")
#: what localizers may assume of what they are told wrongly, where a sigma exists for it
SIGMAS = {
    "aslant": Knowns(camera_tilt_sigma_deg=1.0),
    "half angle": Knowns(half_angle_sigma_deg=0.2),
    "half angle, soft": Knowns(half_angle_sigma_deg=0.2),
    "camera's height": Knowns(camera_height_sigma_mm=1.0),
    "ellipsoid": Knowns(semi_axes_sigma_mm=0.6),
}
COLUMNS = ("effect", "told", "pose", "columns", "error_um", "axis_deg", "chi2", "reason")
RCM_MM = 0.05


@dataclass(frozen=True)
class World:
    """A scene with an effect, and scenes that a localizer is told in its place."""

    effect: str
    true: Scene
    told: dict[str, Scene]


def worlds(columns: int) -> Iterator[World]:
    """All effects of the campaign."""
    document = read_campaign("reality")
    sweep = document.data["sweep"]
    effects: dict[str, dict[str, Any]] = sweep["effect"]

    def scene(effect: dict[str, Any], light: str) -> Scene:
        one = {"light": {light: sweep["light"][light]}, "effect": {"this": effect}}
        found = next(iter(combinations(replace(document, data={**document.data, "sweep": one})))).campaign.scene
        camera = found.camera
        rows = round(columns * camera.shape[0] / camera.shape[1])
        return found.model_copy(update={"camera": camera.model_copy(update={"resolution": (columns, rows)})})

    for name, effect in effects.items():
        light = LIGHTS.get(name, "white")
        true = scene(effect, light)
        told = {"rightly": true}
        if name in WRONG:
            told |= {"wrongly": scene(WRONG[name], light), "nothing": scene({}, light)}
        yield World(name, true, told | _with_sigma(name, told))
    for name, (is_so, wrong) in MORE.items():
        told = {"rightly": scene(is_so, "white"), "wrongly": scene(wrong, "white")}
        yield World(name, told["rightly"], told | _with_sigma(name, told))


def _with_sigma(effect: str, told: dict[str, Scene]) -> dict[str, Scene]:
    return {"wrongly, with its sigma": told["wrongly"]} if effect in SIGMAS else {}


@dataclass(frozen=True, eq=False)
class View:
    """A frame of a world, and how it came about."""

    image: AnyImage
    pose: Pose
    off: Array  #: of the RCM as it is told `[3]` [mm]


def view_of(world: World, renderer: Renderer, number: int) -> View:
    """The frame of one pose."""
    rng = np.random.default_rng([number, 12])
    tip = rng.uniform([-1.5, -1.5, 3.0], [1.5, 1.5, 4.3])
    off = RCM_MM * rng.standard_normal(3)
    scene = world.true
    pose = Pose.through(tip, scene.instrument.rcm, scene.sway(float(rng.uniform(0.0, 10.0)), number))
    exposure = Exposure(renderer.background(pose), scene.sensor)
    return View(exposure.frame([renderer.tile(pose, 0, number)], scene.power.value, number), pose, off)


def answers(world: World, view: View, number: int, columns: int) -> Iterator[dict[str, Any]]:
    """Rows of one pose."""
    pose = view.pose
    for told, believed in world.told.items():
        rcm = tuple(map(float, np.asarray(believed.instrument.rcm) + view.off))
        given = believed.model_copy(update={"instrument": believed.instrument.model_copy(update={"rcm": rcm})})
        row = {"effect": world.effect, "told": told, "pose": number, "columns": columns}
        knowns = SIGMAS[world.effect] if told.endswith("sigma") else None
        found = locate(view.image, given, "photometric", knowns=knowns)
        if isinstance(found, Localization):
            miss = found.apex_mm - pose.apex
            assert found.covariance is not None
            yield row | {
                "error_um": 1e3 * float(np.linalg.norm(miss)),
                "axis_deg": math.degrees(math.acos(min(1.0, float(found.axis @ pose.axis)))),
                "chi2": float(miss @ np.linalg.solve(np.asarray(found.covariance)[:3, :3], miss)),
                "reason": "",
            }
        else:
            yield row | {"error_um": math.nan, "axis_deg": math.nan, "chi2": math.nan, "reason": found.reason}


def cell(rows: list[dict[str, Any]]) -> str:
    """Of the rows of one effect and what is told: rms, share inside the 95 % ellipsoid, refusals."""
    good = [row for row in rows if not row["reason"]]
    refused = f"{len(rows) - len(good)} of {len(rows)}" if len(good) < len(rows) else "0"
    if not good:
        return f"all {len(rows)} refused"
    rms = math.sqrt(sum(float(row["error_um"]) ** 2 for row in good) / len(good))
    inside = sum(float(row["chi2"]) < chi2.ppf(0.95, 3) for row in good)
    # marked where as few inside come about less than once in 200 frames' worth of cells by chance
    mark = "**" if inside < binom.ppf(0.005, len(good), 0.95) else ""
    return f"{rms:.3g}, {mark}{100 * inside / len(good):.0f} %{mark}, {refused}"


def main() -> None:
    """Measure what is missing, then print the matrix."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", type=Path)
    parser.add_argument("--poses", type=int, default=8)
    parser.add_argument("--columns", type=int, default=960)
    parser.add_argument("--effects", nargs="*", help="these alone; default: all")
    asked = parser.parse_args()
    rows: list[dict[str, Any]] = []
    if asked.rows.exists():
        with asked.rows.open(newline="") as stream:
            rows = list(csv.DictReader(stream))
    done = {(row["effect"], int(row["pose"]), int(row["columns"])) for row in rows}
    with asked.rows.open("a", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        if not rows:
            writer.writeheader()
        every = [w for w in worlds(asked.columns) if not asked.effects or w.effect in asked.effects]
        for world in every:
            missing = [n for n in range(asked.poses) if (world.effect, n, asked.columns) not in done]
            renderer = Renderer(world.true, samples=128, edge_samples=8192) if missing else None
            for number in missing:
                assert renderer is not None
                new = list(answers(world, view_of(world, renderer, number), number, asked.columns))
                writer.writerows(new)
                stream.flush()
                rows += new
    sys.stdout.write(f"| effect | {' | '.join(f'told {told}' for told in TOLD)} |\n|---|---|---|---|\n")
    for world in every:
        mine = [row for row in rows if row["effect"] == world.effect and int(row["columns"]) == asked.columns]
        cells = [cell([row for row in mine if row["told"] == told]) if told in world.told else "" for told in TOLD]
        sys.stdout.write(f"| {world.effect} | {' | '.join(cells)} |\n")


if __name__ == "__main__":
    main()
