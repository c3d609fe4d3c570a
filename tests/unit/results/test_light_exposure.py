"""results.light_exposure: the retina's exposure in a run's own scenes and poses; a stranger's files stay shut."""

import numpy as np
import pytest

from conespot.results.columns import TRUE_TIP
from conespot.results.light_exposure import light_exposures
from conespot.results.run import load_run
from conespot.scene import Pose, Scene, load_scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.exposure_limits import scene_exposure

BEAMS = {"soft": CyclesBeam(), "narrow": HardBeam(half_angle=np.radians(3.0))}


def scene_of(row):
    power = {"value": float(row["power_w"]), "convention": "flux"}
    return Scene(**{**load_scene("paper-code").model_dump(), "beam": BEAMS[row["scene.beam"]], "power": power})


@pytest.fixture
def frame(make_rows):
    return make_rows(
        poses=3, trajectories=("box",), rigs=("single",), powers=(1e-3, 5e-3), swept={"scene.beam": tuple(BEAMS)}
    )


def test_it_is_that_of_the_brightest_beam_at_the_highest_power(tmp_path, frame, make_run, make_cases):
    """Two beams of equal flux; against the narrow one's exposure at 5 mW, worst over the poses of its rows."""
    run = load_run(make_run(tmp_path / "run", frame, described=make_cases(frame, scene_of)))
    rows = frame[(frame["scene.beam"] == "narrow") & (frame["power_w"] == 5e-3)]
    scene = scene_of(rows.iloc[0])
    poses = [Pose.through(tip, scene.instrument.rcm) for tip in rows[list(TRUE_TIP)].to_numpy()]
    assert light_exposures(run)["white"].irradiance == pytest.approx(scene_exposure(scene, poses, 5e-3).irradiance)


def test_cases_that_are_not_described_have_none(tmp_path, frame, make_run):
    assert light_exposures(load_run(make_run(tmp_path / "run", frame, described=[]))) == {}


@pytest.mark.parametrize(
    "part",
    [
        {"surface": {"height_map": {"kind": "csv", "file": "secret.csv", "width": "5 mm"}}},
        {"illumination": {"kind": "csv", "name": "x", "file": "secret.csv"}},
        {"eye": {"radius": "a"}},
        {"beam": [1, 2]},
    ],
)
def test_no_file_is_opened_and_what_is_no_scene_has_none(tmp_path, frame, make_run, make_cases, monkeypatch, part):
    described = make_cases(frame, scene_of)
    for case in described:
        case["scene"] |= part
    run = load_run(make_run(tmp_path / "run", frame, described=described))

    def refuse(*_):
        raise RuntimeError("a stranger's file was opened")

    for module in ("height_map", "spectrum"):
        monkeypatch.setattr(f"conespot.scene.{module}.csv_lines", refuse)
    assert light_exposures(run) == {}
