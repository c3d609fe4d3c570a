"""What each light of a run does to the retina: peak irradiance over the run's own poses, against the limits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from pydantic import TypeAdapter, ValidationError

from conespot.results.cases import Case
from conespot.results.columns import TRUE_TIP
from conespot.results.run import Run
from conespot.scene import Pose, Scene
from conespot.scene.exposure_limits import RetinalExposure, scene_exposure
from conespot.scene.quantity import FROM_FILE

_MOST_POSES = 400


def light_exposures(run: Run) -> dict[str, RetinalExposure]:
    """The exposure of every light at its highest power, worst over poses; none of cases that are not described."""
    found: dict[str, RetinalExposure] = {}
    if run.rows is None:
        return found
    for (name, _), rows in run.rows.frame.groupby(["illumination", "spotlights"], sort=False):
        for worst in _exposures(run, rows):
            if name not in found or worst.irradiance > found[name].irradiance:
                found[str(name)] = worst
    return found


def _exposures(run: Run, rows: pd.DataFrame) -> Iterator[RetinalExposure]:
    """The worst of each case that is as bright as any of the rows'."""
    cases = [run.cases[key] for key in rows["case"].unique() if key in run.cases]
    most = max((case.watts.axial_intensity for case in cases), default=0.0)
    bright = [case for case in cases if case.watts.axial_intensity >= 0.999 * most][:_MOST_POSES]
    for case in bright:
        scene = _scene(case)
        if scene is not None:
            tips = np.unique(rows.loc[rows["case"] == case.key, list(TRUE_TIP)].to_numpy(float), axis=0)
            tips = tips[np.all(np.isfinite(tips), axis=-1) & np.any(tips != np.asarray(scene.instrument.rcm), axis=-1)]
            tips = tips[:: max(1, len(bright) * len(tips) // _MOST_POSES)]
            poses = [Pose.through(tip, scene.instrument.rcm) for tip in tips]
            yield scene_exposure(scene, poses, scene.power.value)


def _scene(case: Case) -> Scene | None:
    """The scene of a case; None if it is none of ours. Sensor and retina have no part in it and may be anything."""
    data = {key: value for key, value in case.scene.items() if key not in ("sensor", "retina")}
    if _names_a_file(data):
        return None
    try:
        return TypeAdapter(Scene).validate_python(data, context={FROM_FILE: True})
    except ValidationError:
        return None


def _names_a_file(data: Any) -> bool:
    """Whether reading it would open a file: a stranger's run opens none."""
    if isinstance(data, dict):
        return ("file" in data and "points" not in data) or any(_names_a_file(value) for value in data.values())
    return isinstance(data, list) and any(_names_a_file(item) for item in data)
