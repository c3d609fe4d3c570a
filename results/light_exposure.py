"""What each light of a run does to the retina: peak irradiance over the run's own poses, against the limits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from conespot.results.cases import Case
from conespot.results.columns import TRUE_TIP
from conespot.results.run import Run
from conespot.scene import Pose, Scene
from conespot.scene.exposure_limits import RetinalExposure, exposure, peak_irradiance, scene_exposure
from conespot.scene.quantity import FROM_FILE

_MOST_POSES = 400
_FEW_POSES, _MOST_LIGHTS = 25, 60
#: the parts of a scene, beside its power, that say how much light falls where
_OF_EXPOSURE = ("eye", "surface", "spotlights", "beam", "illumination", "instrument")


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


def shares_of_limit(run: Run) -> dict[str, float]:
    """What each case's light does to the retina, worst over its poses, as a share of the nearer limit.

    Computed at one power of each light, beam and trajectory, and scaled: irradiance is linear in power. The light of
    the microscope is left out, which no power of the spotlights changes. Cases that are not described have none.
    """
    found: dict[str, float] = {}
    if run.rows is None:
        return found
    worst: dict[tuple[str, ...], float] = {}  # at 1 W/sr on the axis
    tips = run.rows.frame.drop_duplicates(["case", "pose"]).groupby("case", sort=False)[list(TRUE_TIP)]
    for key, here in tips:
        case = run.cases.get(str(key))
        if case is None or case.watts.axial_intensity <= 0.0:
            continue
        alike = (str(case.labels.get("trajectory")), *(repr(case.scene.get(part)) for part in _OF_EXPOSURE))
        if alike not in worst:
            if len(worst) == _MOST_LIGHTS:
                break
            exposed = _spotlights_alone(case, here.to_numpy(float))
            if exposed is None:
                continue
            worst[alike] = max(exposed.photochemical_ratio, exposed.thermal_ratio) / case.watts.axial_intensity
        found[str(key)] = worst[alike] * case.watts.axial_intensity
    return found


def _spotlights_alone(case: Case, tips: NDArray[np.float64]) -> RetinalExposure | None:
    """The worst exposure to a case's spotlights over some of its tips `[N, 3]` [mm]."""
    scene = scene_of(case)
    if scene is None:
        return None
    some = tips[:: max(1, -(-len(tips) // _FEW_POSES))]
    most = max((peak_irradiance(scene, pose, scene.power.value) for pose in _poses(some, scene)), default=0.0)
    return exposure(most, scene.illumination.spectrum)


def _poses(tips: NDArray[np.float64], scene: Scene) -> list[Pose]:
    rcm = np.asarray(scene.instrument.rcm)
    usable = tips[np.all(np.isfinite(tips), axis=-1) & np.any(tips != rcm, axis=-1)]
    return [Pose.through(tip, scene.instrument.rcm) for tip in usable]


def _exposures(run: Run, rows: pd.DataFrame) -> Iterator[RetinalExposure]:
    """The worst of each case that is as bright as any of the rows'."""
    cases = [run.cases[key] for key in rows["case"].unique() if key in run.cases]
    most = max((case.watts.axial_intensity for case in cases), default=0.0)
    bright = [case for case in cases if case.watts.axial_intensity >= 0.999 * most][:_MOST_POSES]
    for case in bright:
        scene = scene_of(case)
        if scene is not None:
            tips = np.unique(rows.loc[rows["case"] == case.key, list(TRUE_TIP)].to_numpy(float), axis=0)
            poses = _poses(tips, scene)
            poses = poses[:: max(1, len(bright) * len(poses) // _MOST_POSES)]
            yield scene_exposure(scene, poses, scene.power.value)


def scene_of(case: Case) -> Scene | None:
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
