"""A run folder without a renderer: rows with known errors, a resolved campaign, its cases, and Table I."""

import itertools
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from ruamel.yaml import YAML

from conespot.results import style
from conespot.results.columns import COLUMNS
from conespot.scene import Scene, load_scene
from conespot.scene.document import read_document, shipped
from conespot.scene.illumination import LIGHTS
from conespot.scene.surface import SURFACES
from conespot.scene.words import assumed

POWERS = (0.05, 0.1, 0.15, 0.25, 0.5, 0.75, 1.0)


def campaign(**changes):
    scene = read_document(shipped("scene", "presets")["paper-code"]).data
    document = {
        "name": "synthetic",
        "description": "Rows that nobody rendered.",
        "scene": scene,
        "trajectory": {"kind": "box"},
        "poses": 100,
        "localizers": ["paper-code"],
        "seed": 7,
        "made_with": {"conespot": "0.1.0", "mitsuba": "3.9.1"},
        "sweep": {"trajectory": ["box", "helix"], "scene.power.value": ["0.05 W", "1 W"]},
    }
    return {**document, **changes}


def rows(
    poses=25,
    trajectories=("box", "helix"),
    rigs=("single", "triple"),
    powers=POWERS,
    surfaces=("smooth",),
    localizers=("paper-code",),
    failing=0.0,
    gross=0.0,
    swept=None,
):
    """Errors that fall with power, are smaller with three spotlights and grow with height."""
    rng = np.random.default_rng(3)
    parts = []
    swept = swept or {}
    settings = itertools.product(trajectories, rigs, powers, surfaces, localizers, *swept.values())
    for case, (trajectory, rig, power, surface, localizer, *values) in enumerate(settings):
        u = np.linspace(0.0, 1.0, poses)
        size = (0.02 + 0.02 * u) * (1.0 + 0.12 / power**0.7) * (0.8 if rig == "triple" else 1.0)
        size = size * (1.6 if surface == "bumps" else 1.0) * (3.0 if localizer == "paper" else 1.0)
        along = np.column_stack([np.sin(9 * u), np.cos(7 * u), -2.0 + u]) / 2.5
        error = size[:, None] * (along + rng.normal(0.0, 0.25, (poses, 3)))
        error[rng.random(poses) < gross] *= 60.0
        turn = 4.0 * size[:, None] * (along[:, :2] + rng.normal(0.0, 0.25, (poses, 2)))
        tip = np.column_stack([2.0 * np.sin(6 * u), 2.0 * np.cos(6 * u), 2.0 + 4.0 * u])
        ok = rng.random(poses) >= failing
        part = {
            "case": f"{case:016x}",
            "trajectory": trajectory,
            "spotlights": rig,
            "power_w": power,
            "illumination": "white",
            "surface": surface,
            "sensor": "srgb8",
            "resolution_px": 5000,
            "localizer": localizer,
            "pose": np.arange(poses),
            "status": np.where(ok, "ok", "failed"),
            "reason": np.where(ok, "", "patch cut by the border"),
        }
        for i, axis in enumerate("xyz"):
            part[f"true_{axis}_mm"] = tip[:, i]
            part[f"est_{axis}_mm"] = np.where(ok, tip[:, i] + error[:, i], np.nan)
            part[f"error_{axis}_mm"] = np.where(ok, error[:, i], np.nan)
        part["position_error_mm"] = np.where(ok, np.linalg.norm(error, axis=1), np.nan)
        part["error_rot_y_deg"], part["error_rot_z_deg"] = np.where(ok[:, None], turn, np.nan).T
        part["rotation_error_deg"] = np.hypot(part["error_rot_y_deg"], part["error_rot_z_deg"])
        part["axis_error_deg"] = 0.7 * part["rotation_error_deg"]
        frame = pd.DataFrame(part)[[column.name for column in COLUMNS if column.name in part]]
        parts.append(frame.assign(**dict(zip(swept, values, strict=True))))
    return pd.concat(parts, ignore_index=True)


def cases(frame, scene_of=None):
    """A description of every case in the rows; `scene_of` makes its scene from one of them, else from paper-code."""
    found = []
    for key, mine in frame.groupby("case", sort=False):
        row = mine.iloc[0].to_dict()
        scene = (scene_of or default_scene)(row)
        standing = ("trajectory", "spotlights", "power_w", "illumination", "surface", "sensor", "resolution_px")
        swept = [name for name in frame if name not in {column.name for column in COLUMNS} and name[:4] != "est_"]
        words = {"threshold": "fixed 50 of 255 after median 9", "ambiguity": "RCM for one spotlight"}
        found.append(
            {
                "schema": 1,
                "key": key,
                "frame": row.get("frame", key),
                "labels": {name: row[name] for name in (*standing, *swept)},
                "localizers": {name: words for name in mine["localizer"].unique()},
                "assumes": assumed(scene),
                "watts": asdict(scene.power.both(scene.beam)),
                "told": {"rcm_sigma": "0.05 mm"},
                "trajectory": {"kind": row["trajectory"]},
                "poses": len(mine),
                "samples": 16,
                "edge_samples": 0,
                "bounds": False,
                "scene": scene.model_dump(mode="json"),
            }
        )
    return found


def default_scene(row):
    scene = load_scene("paper-code").model_dump()
    known = SURFACES.get(row["surface"], SURFACES["smooth"])
    light = LIGHTS.get(row["illumination"], LIGHTS["white"])
    return Scene(**{**scene, "surface": known, "illumination": light, "power": {"value": float(row["power_w"])}})


def write_cases(folder, described):
    lines = (json.dumps(case, default=lambda number: number.item()) for case in described)
    (folder / "cases.jsonl").write_text("".join(f"{line}\n" for line in lines))


def write_run(folder: Path, frame=None, *, document=None, described=None, theory=False, kind="parquet") -> Path:
    """A run folder; `described` are its cases, none of them with an empty list."""
    folder.mkdir(parents=True, exist_ok=True)
    if frame is not None and described is None:
        described = cases(frame)
    if described:
        write_cases(folder, described)
    with (folder / "campaign.yaml").open("w") as stream:
        YAML(typ="safe", pure=True).dump(document or campaign(), stream)
    if frame is not None and kind == "parquet":
        frame.to_parquet(folder / "errors.parquet", index=False)
    elif frame is not None:
        frame.to_csv(folder / "errors.csv", index=False)
    if theory:
        (folder / "theory.csv").write_text(
            "half_angle_deg,in_plane_um,distance_3d_um\n"
            "5,0.08,0.9\n7,0.23,1.9\n9,0.49,3.2\n11,0.90,5.1\n13,1.51,7.6\n15,2.35,10.6\n"
        )
    return folder


@pytest.fixture(scope="session", autouse=True)
def coarse_figures():
    """No claim depends on the raster's size, and a third of the time does."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "_DPI", 50)
        yield


@pytest.fixture(scope="session")
def make_campaign():
    return campaign


@pytest.fixture(scope="session")
def make_cases():
    return cases


@pytest.fixture(scope="session")
def make_rows():
    return rows


@pytest.fixture(scope="session")
def make_run():
    return write_run
