"""What each light of a run does to the retina: peak irradiance over the run's own poses, against the limits."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from conespot.results.assumptions import scene_of
from conespot.results.run import Run
from conespot.scene import Pose, Scene
from conespot.scene.exposure_limits import RetinalExposure, scene_exposure
from conespot.scene.illumination import LIGHTS
from conespot.scene.quantity import FROM_FILE

_MOST_POSES = 400


def light_exposures(run: Run) -> dict[str, RetinalExposure]:
    """The exposure of every light at its highest power, worst over poses; a light no name tells is left out."""
    found: dict[str, RetinalExposure] = {}
    if run.rows is None:
        return found
    frame = run.rows.frame
    for (name, rig), rows in frame.groupby(["illumination", "spotlights"], sort=False):
        first = {str(key): value for key, value in rows.iloc[0].items()}
        scene = _scene(run, {**first, "illumination": name, "spotlights": rig})
        if scene is None:
            continue
        brightest = rows[rows["power_w"] == rows["power_w"].max()]
        apexes = np.unique(brightest[["true_x_mm", "true_y_mm", "true_z_mm"]].to_numpy(float), axis=0)
        apexes = apexes[:: max(1, len(apexes) // _MOST_POSES)]
        poses = [Pose.through(apex, scene.instrument.rcm) for apex in apexes]
        worst = scene_exposure(scene, poses, float(rows["power_w"].max()))
        if name not in found or worst.irradiance > found[name].irradiance:
            found[str(name)] = worst
    return found


def _scene(run: Run, setting: dict[str, Any]) -> Scene | None:
    data = scene_of(run.scene, {k: v for k, v in setting.items() if k in run.rows.group}) if run.rows else {}
    if setting["illumination"] in LIGHTS:
        data = {**data, "illumination": setting["illumination"]}
    elif not isinstance(data.get("illumination"), dict) or data["illumination"].get("name") != setting["illumination"]:
        return None
    if setting["spotlights"] in ("single", "triple"):
        data = {**data, "spotlights": setting["spotlights"]}
    try:
        # the sensor and the retina's pattern have no part in it, and may be swept in ways only the campaign knows
        return TypeAdapter(Scene).validate_python(
            {k: v for k, v in data.items() if k not in ("sensor", "retina")}, context={FROM_FILE: True}
        )
    except ValidationError:
        return None
