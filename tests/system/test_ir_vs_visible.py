"""The infrared question end to end: `campaign run ir_vs_visible`, then `campaign compare`."""

from __future__ import annotations

import pandas as pd
import pytest

from conespot.campaigns.command import main

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ir") / "run"
    options = ["--poses", "6", "--resolution", "400", "--samples", "4", "--workers", "1", "--out", str(folder)]
    powers = ["--set", "scene.power.value=0.5 W", "--set", "trajectory=box"]
    assert main(["run", "ir_vs_visible", *options, *powers]) == 0
    return folder


def test_three_lights_are_localized_on_the_same_poses(run):
    """Rows of a small run; against three lights with the same true positions and two cameras."""
    rows = pd.read_csv(run / "errors.csv")
    assert sorted(rows["illumination"].unique()) == ["ir850", "ir940", "led-b3"]
    assert sorted(rows["sensor"].unique()) == ["cmv12000-mono", "cmv12000-nir-longpass800"]
    assert rows.groupby("pose")["true_z_mm"].nunique().max() == 1
    assert (rows["status"] == "ok").mean() > 0.8
    assert "research estimate, not a safety assessment" in (run / "report.html").read_text()


def test_compare_answers_in_sentences_with_numbers(run, capsys):
    """`campaign compare` of that run; against a sentence for each infrared light, its table and figures, and exit 0."""
    assert main(["compare", str(run)]) == 0
    said = capsys.readouterr().out
    for light in ("ir850", "ir940"):
        assert f"{light}" in said
        assert (run / "figures" / f"comparison_{light}_led-b3_paper.png").exists()
    assert "led-b3" in said
    assert "failures" in said
    assert said.count("peak retinal irradiance, microscope included") == 3
    assert len(pd.read_csv(run / "tables" / "comparison.csv")) == 2


def test_compare_refuses_what_it_cannot_compare(run, capsys):
    """A missing folder, a light that is not there, one light twice; against exit 2 and one sentence each."""
    for arguments in ([str(run / "nothing")], [str(run), "--lights", "led-b3,xenon"], [str(run), "--lights", "a,a"]):
        assert main(["compare", *arguments]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
