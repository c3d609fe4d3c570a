"""`campaign theory`: what it finds, what it writes, and what it refuses."""

import subprocess
import sys

import pandas as pd
import pytest

from conespot.campaigns.command import main

pytestmark = pytest.mark.slow
CAMPAIGN = [sys.executable, "-m", "conespot"]
FILES = {"table_1.csv", "bounds.csv", "budget.csv", "design.csv", "theory.txt"}
FILES |= {f"{name}.{kind}" for name in ("budget", "design") for kind in ("png", "svg", "pdf")}


def theory(*arguments, cwd):
    return subprocess.run(
        [*CAMPAIGN, "theory", *map(str, arguments)], cwd=cwd, capture_output=True, text=True, timeout=120
    )


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """The answer and the folder for a camera of its own at 1000 px, described by a file and settings."""
    folder = tmp_path_factory.mktemp("theory")
    (folder / "mine.yaml").write_text("preset: paper-code\ncamera: {resolution: 1000}\n")
    done = theory("mine.yaml", "--out", "out", "--set", "scene.sensor.kind=emva", cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout, folder / "out"


def read(found, name):
    return pd.read_csv(found[1] / f"{name}.csv")


def test_it_writes_four_tables_their_text_and_two_figures(found):
    text, folder = found
    assert {path.name for path in folder.iterdir()} == FILES
    assert (folder / "theory.txt").read_text() in text
    assert "Square pixels that average exactly" in text
    assert "10800 e- where the patch is brightest" in text  # 80 % of the camera's full well of 13500


def test_table_1_stands_in_the_papers_sense_and_in_space(found):
    table = read(found, "table_1")
    assert (table["in_plane_um"] - table["published_um"]).abs().max() < 0.02
    assert (table["distance_3d_um"] > table["in_plane_um"]).all()
    assert (table["volume_distance_3d_um"] > table["distance_3d_um"]).all()


def test_bounds_fall_with_resolution_edge_and_what_is_known_of_the_rcm(found):
    bounds = read(found, "bounds")
    assert len(bounds) == 2 * 2 * 2 * 3
    table = bounds.set_index(["resolution_px", "edge", "height_mm", "rcm"])["position_um"]
    for height in (3.0, 6.0):
        assert table[5000, "hard", height, "free"] < table[1000, "hard", height, "free"]
        assert table[1000, "hard", height, "free"] < table[1000, "soft", height, "free"]
        assert table[1000, "soft", height, "exact"] < table[1000, "soft", height, "0.05 mm"]
        assert table[1000, "soft", height, "0.05 mm"] < table[1000, "soft", height, "free"]


def test_the_budget_has_every_quantity_and_the_rcm_only_where_it_is_used(found):
    budget = read(found, "budget")
    everywhere = {"half_angle", "eye_radius", "camera_height", "focal_length", "noise", "pixel_size", "unknown_bumps"}
    for (_, rcm), part in budget.groupby(["height_mm", "rcm"]):
        extra = {"rcm_sideways", "rcm_along"} if rcm == "exact" else set()
        assert set(part["quantity"]) == everywhere | extra
    per = budget["position_um_per_unit"] * budget["tolerance"]
    pd.testing.assert_series_equal(per, budget["position_um"], check_names=False)
    assert (budget["position_um"] > 0.0).all()


def test_the_design_guidance_prefers_wide_cones_and_hard_edges(found):
    design = read(found, "design")
    for _, part in design.groupby("rcm"):
        wide = part[part["varied"] == "half angle"].sort_values("half_angle_deg")
        assert wide["position_um"].is_monotonic_decreasing
        soft = part[part["varied"] == "edge softness"].sort_values("softness")
        assert soft["position_um"].is_monotonic_increasing
    assert set(design["spotlights"]) == {1, 2, 3, 4, 6}


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["papr"], "papr: no such scene preset, neither a file nor shipped; did you mean 'paper'?"),
        (["--set", "scene.eye.radius=-1 mm"], "--set scene.eye.radius: scene.eye.radius: input should be greater"),
        (["--set", "scene.eye.radius=2 mm", "--out", "out"], "the tip at (2, 0, 6) mm is outside the eye"),
        (["--set", "poses=3"], "--set poses: the theory is about a scene alone; set a key such as scene.eye.radius"),
        (["--set", "scene"], "--set scene: write KEY=VALUE"),
        (["mine.yaml"], "mine.yaml:1: scene.eys: unknown key 'eys'; did you mean 'eye'?"),
        (["--out", "mine.yaml"], "mine.yaml: is a file, not a folder; choose another --out"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(tmp_path, monkeypatch, capsys, arguments, says):
    (tmp_path / "mine.yaml").write_text("eys: {radius: 12 mm}\n")
    monkeypatch.chdir(tmp_path)
    assert main(["theory", *arguments]) == 2
    said = capsys.readouterr()
    assert says in said.err
    assert len(said.err.splitlines()) == 1
    assert said.out == ""
    assert not list(tmp_path.rglob("*.csv"))
