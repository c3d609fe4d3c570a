"""results.assumptions: every number says what it assumes, as the run's own cases say it."""

import pandas as pd
import pytest

from conespot.results.assumptions import Assumptions, pairs, power_in_words, watts_of
from conespot.results.assumptions import assumptions as of_pairs
from conespot.results.cases import Case
from conespot.scene import Scene, load_scene
from conespot.scene.beam import CyclesBeam, HardBeam
from conespot.scene.sensor import SENSORS


def described(make_cases, frame, scene_of=None):
    return {case["key"]: Case.model_validate(case) for case in make_cases(frame, scene_of)}


def assumptions(cases, frame):
    return of_pairs(cases, pairs(frame))


def scene_with(**parts):
    return Scene(**{**load_scene("paper-code").model_dump(), **parts})


def test_the_preset_as_coded(make_cases, make_rows):
    frame = make_rows(poses=2)
    assert assumptions(described(make_cases, frame), frame) == Assumptions(
        radius="12.5 mm",
        edge="Cycles blend 1 (fully soft), half angle 9 deg",
        power_convention="isotropic (I0 = P / 4 pi)",
        transfer="sRGB, 8 bit, white 0.25 W/m2/sr",
        surface_shape="smooth",
        threshold="fixed 50 of 255 after median 9",
        ambiguity="RCM for one spotlight",
    )


def test_a_sweep_over_whole_beams_states_edge_convention_and_watts_of_each(make_cases, make_rows):
    """Two beams named by their text in a column, under a stated flux; against the words of either."""
    beams = {"{kind: hard}": HardBeam(), "{kind: cycles}": CyclesBeam(half_angle=0.2)}
    frame = make_rows(poses=2, powers=(0.003,), swept={"scene.beam": tuple(beams)})
    cases = described(
        make_cases,
        frame,
        lambda row: scene_with(beam=beams[row["scene.beam"]], power={"value": row["power_w"], "convention": "flux"}),
    )
    for text, beam in beams.items():
        rows = frame[frame["scene.beam"] == text]
        found = assumptions(cases, rows)
        assert (found.edge, found.power_convention) == (beam.words, "flux (P leaves the tip)")
        assert watts_of(cases, pairs(rows)).flux_w == pytest.approx(0.003)
        assert "(3 mW flux)" in power_in_words(cases, pairs(rows), 0.003)
    assert assumptions(cases, frame).edge == " or ".join(beam.words for beam in beams.values())
    assert watts_of(cases, pairs(frame)) is None


def test_bumps_are_no_smooth_eye_and_a_camera_is_more_than_its_kind(make_cases, make_rows):
    frame = make_rows(poses=2, powers=(1.0,), surfaces=("smooth", "bumps")).assign(sensor="emva")
    camera = SENSORS["cmv12000-nir"]
    surfaces = {"smooth": "smooth", "bumps": "15 bumps (0.5 mm across, 0.1 mm high)"}
    cases = described(make_cases, frame, lambda row: scene_with(surface=row["surface"], sensor=camera))
    for surface, words in surfaces.items():
        found = assumptions(cases, frame[frame["surface"] == surface])
        assert (found.surface_shape, found.transfer) == (words, camera.words)
    assert assumptions(cases, frame).surface_shape == "smooth or 15 bumps (0.5 mm across, 0.1 mm high)"


def test_a_run_that_states_nothing_is_said_to(make_rows):
    frame = make_rows(poses=2, powers=(1.0,))
    assert set(assumptions({}, frame).columns().values()) == {"not stated"}
    assert power_in_words({}, pairs(frame), 1.0) == "1 W (convention not stated)"
    assert watts_of({}, pairs(frame)) is None


def test_a_case_left_out_is_not_covered_by_the_others(make_cases, make_rows):
    frame = make_rows(poses=2, powers=(1.0,), trajectories=("box",))
    cases = described(make_cases, frame)
    del cases[frame["case"].iloc[0]]
    assert assumptions(cases, frame).radius == "not stated or 12.5 mm"
    assert watts_of(cases, pairs(frame)) is None


def test_a_localizer_that_the_case_does_not_know_states_nothing(make_cases, make_rows):
    frame = make_rows(poses=2, powers=(1.0,))
    found = assumptions(described(make_cases, frame), frame.assign(localizer="mine"))
    assert (found.threshold, found.radius) == ("not stated", "12.5 mm")


def test_many_different_ones_are_named_in_part(make_cases, make_rows):
    frame = make_rows(poses=1, powers=(1.0,), swept={"eye.radius": tuple(f"{r} mm" for r in range(10, 18))})
    cases = described(make_cases, frame, lambda row: scene_with(eye={"radius": float(row["eye.radius"][:2])}))
    assert assumptions(cases, frame).radius == "10 mm or 11 mm or 12 mm or 13 mm or 4 others"


def test_the_order_of_the_rows_does_not_decide_what_is_stated(make_cases, make_rows):
    frame = make_rows(poses=2, powers=(1.0,), surfaces=("smooth", "bumps"))
    cases = described(make_cases, frame)
    words = {assumptions(cases, pd.DataFrame(part)).surface_shape for part in (frame, frame.iloc[::-1])}
    assert all("smooth" in text and "15 bumps" in text for text in words)
