"""`campaign localize`: own images to a table, files and pictures; refusals counted; distances with an alarm."""

import csv
import json
import math
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from photographs import photograph, scene_of

from conespot import load_scene
from conespot.campaigns import own_frames
from conespot.campaigns.command import main
from conespot.localize.outcome import LocalizationFailure
from conespot.scene.beam import HardBeam

TIPS = [(0.6, -0.4, 3.0), (-1.2, 0.8, 2.0)]
MY_YAML = """\
preset: paper
camera: {resolution: 400}
beam: {kind: hard, half_angle: 9 deg}
sensor: {kind: emva, bits: 12, gain: 0.364, black_level: 0, full_well: 11250, read_noise: 15}
knowledge: {rcm_sigma: 0.02 mm}
"""


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """A folder with the description of a microscope, two frames of it, and an empty one."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "my.yaml").write_text(MY_YAML)
    scene = scene_of(HardBeam(), resolution=400)
    (folder / "frames").mkdir()
    for number, tip in enumerate(TIPS):
        image = photograph(scene, scene.pose(np.array(tip)), seed=number)
        cv2.imwrite(str(folder / "frames" / f"frame_{number}.png"), image)
    cv2.imwrite(str(folder / "dark.png"), np.random.default_rng(1).integers(0, 9, (400, 400), np.uint16))
    return folder


def localize(own, *arguments):
    return main(["localize", *map(str, arguments), "--scene", str(own / "my.yaml")])


def test_a_folder_of_frames_is_a_table_and_files_that_agree_with_it(own, tmp_path, capsys):
    files = ["--csv", tmp_path / "x.csv", "--json", tmp_path / "x.json", "--overlay", tmp_path / "seen"]
    assert localize(own, own / "frames", *files, "--alarm", "0.1 mm") == 0
    said = capsys.readouterr()
    assert "Research, no safety device." in said.out
    assert [line.rpartition(" ")[2] for line in said.out.splitlines()[2:]] == ["safe", "safe"]
    with open(tmp_path / "x.csv") as table:
        rows = list(csv.DictReader(table))
    for row, tip in zip(rows, TIPS, strict=True):
        found = np.array([float(row[key]) for key in ("x_mm", "y_mm", "z_mm")])
        assert np.linalg.norm(found - tip) < 0.02
        wall = 12.0 - np.linalg.norm(np.array(tip) - [0.0, 0.0, 12.0])
        assert abs(float(row["nearest_mm"]) - wall) < 5.0 * float(row["sigma_nearest_mm"])
        assert row["safe"] == "yes"
    told = json.loads((tmp_path / "x.json").read_text())
    assert [one["x_mm"] for one in told["frames"]] == [float(row["x_mm"]) for row in rows]
    assert np.array(told["frames"][0]["covariance"]).shape == (5, 5)
    pictures = [cv2.imread(str(path)) for path in sorted((tmp_path / "seen").glob("*.png"))]
    assert len(pictures) == 2
    assert all(picture.std() > 10 for picture in pictures)


def test_a_refused_frame_has_its_reason_is_not_safe_and_makes_the_exit_code_1(own, tmp_path, capsys):
    arguments = [own / "frames" / "frame_0.png", own / "dark.png", "--alarm", "0.1 mm", "--csv", tmp_path / "x.csv"]
    assert localize(own, *arguments) == 1
    said = capsys.readouterr()
    assert "dark.png" in said.out
    assert "NOT SAFE" in said.out.splitlines()[-1]
    assert "1 of 2 frames refused: 1 x " in said.err
    with open(tmp_path / "x.csv") as table:
        rows = list(csv.DictReader(table))
    assert [(row["status"], row["safe"]) for row in rows] == [("localized", "yes"), ("refused", "no")]
    assert rows[1]["reason"]
    assert rows[1]["x_mm"] == ""


def test_a_frame_that_does_not_fit_is_one_sentence_and_nothing_is_written(own, tmp_path, capsys):
    cv2.imwrite(str(tmp_path / "eight.png"), np.zeros((400, 400), np.uint8))
    assert localize(own, own / "frames", tmp_path / "eight.png", "--csv", tmp_path / "x.csv") == 2
    error = capsys.readouterr().err.splitlines()
    assert len(error) == 1
    assert "eight.png: has 8 bits a pixel, but scene.sensor has 12" in error[0]
    assert not (tmp_path / "x.csv").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--localizer", "paper-code-oracle"], "needs the true pose, which your own frames lack"),
        (["--localizer", "con"], "did you mean 'cone'?"),
        (["--alarm", "0.1"], "--alarm: "),
        (
            ["--alarm", "0.1 mm", "--set", "scene.sensor=linear"],
            "--alarm: scene.sensor (linear) has no noise but rounding",
        ),
        (["--alarm", "0.1 mm", "--false-safe", "0.9"], "must lie between 0 and 0.5"),
        (["--csv", "no/such/x.csv"], "its folder does not exist; choose another --csv"),
        (["--set", "poses=3"], "--set poses: localize is about a scene alone"),
        (["--set", "knowledge.rcm_error=1 mm"], "knowledge.rcm_error: belongs to a campaign"),
        (["--localizer", "paper", "--reference", "frames"], "--reference: localizer 'paper' has no use for it"),
    ],
)
def test_bad_options_are_one_sentence_before_any_frame_is_looked_at(own, capsys, arguments, said):
    assert localize(own, own / "frames", *arguments) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1


def test_a_black_reference_is_refused_in_a_sentence(own, tmp_path, capsys):
    cv2.imwrite(str(tmp_path / "black.png"), np.zeros((400, 400), np.uint16))
    assert localize(own, own / "frames", "--reference", tmp_path / "black.png") == 2
    assert capsys.readouterr().err.count("--reference: is black everywhere") == 1


def test_a_scenes_own_word_on_how_well_it_is_known_is_told_to_the_localizer(own, tmp_path):
    def sigma(*settings):
        localize(own, own / "frames" / "frame_0.png", "--csv", tmp_path / "x.csv", *settings)
        with open(tmp_path / "x.csv") as table:
            return float(next(csv.DictReader(table))["sigma_nearest_mm"])

    sure = sigma()
    unsure = sigma("--set", "knowledge.relief_sigma=0.05 mm")
    assert unsure == pytest.approx(math.hypot(sure, 0.05), rel=1e-6)
    assert load_scene(own / "my.yaml").camera.resolution == 400  # whoever wants the scene alone may read it too


def calibrated(folder, own, scene, *options, rays):
    """The scene that `campaign calibrate` makes of four frames of `scene`, and the file's text."""
    for number in range(4):
        tip = np.array([2.5 * math.sin(1.7 * number), 2.5 * math.cos(1.7 * number), 3.0 + 0.5 * number])
        cv2.imwrite(str(folder / f"{number}.png"), photograph(scene, scene.pose(tip), seed=number, rays=rays))
    resolution = f"scene.camera.resolution={scene.camera.resolution}"
    command = ["calibrate", folder, "--scene", own / "my.yaml", "--out", folder / "calibrated.yaml"]
    assert main([*map(str, command), "--set", resolution, *options]) == 0
    return load_scene(folder / "calibrated.yaml"), (folder / "calibrated.yaml").read_text()


def test_what_a_sequence_does_not_show_stays_as_it_was_and_is_said_with_what_would_show_it(own, tmp_path, capsys):
    """One spotlight at 300 px, and an RCM told 0.05 mm off: neither half angle, height nor how high the RCM is."""
    off = ["--set", "scene.instrument.rcm=[6.05 mm, 0 mm, 22 mm]"]
    found, text = calibrated(tmp_path, own, scene_of(HardBeam(), resolution=300), *off, rays=4)
    said = capsys.readouterr().out
    for name in ("half_angle", "camera_height", "rcm_z"):
        assert f"{name}: not observable" in said
    assert "what would show it: an object of known size" in said
    assert "not asked: camera's tilt: give --tilt to have it asked for" in said
    assert "deep light: the scene has none; to have it asked for, give the scene retina: " in said
    assert "mm, asked with +- 0.2 mm); what would show it: tips further apart" in said
    assert "rcm_sigma stays 0.02 mm, as told\n" in said
    assert "half_angle_sigma stays 0 deg, as told: localize takes it as exact; write how well" in said
    assert found.instrument.rcm[2] == 22.0
    assert found.beam.half_angle == pytest.approx(math.radians(9.0))
    assert found.camera == load_scene(own / "my.yaml").camera.with_columns(300)
    assert "rcm_sigma: 0.02 mm" in text  # as well as it was known before
    assert "\n#   rcm_z: not observable" in text
    assert max(map(len, text.splitlines())) <= 120
    assert main(["localize", str(tmp_path / "0.png"), "--scene", str(tmp_path / "calibrated.yaml")]) == 0


@pytest.mark.slow
def test_three_spotlights_give_the_half_angle_back_and_the_next_command_takes_it(own, tmp_path):
    """Told 9 deg, which are 9.03, and upright; four frames of 500 px, within four of the sigmas that are stated."""
    scene = scene_of(HardBeam(half_angle=math.radians(9.03)), "triple", resolution=500)
    found, text = calibrated(tmp_path, own, scene, "--set", "scene.spotlights=triple", "--tilt", rays=8)
    assert math.degrees(found.beam.half_angle) == pytest.approx(9.03, abs=5e-3)
    assert "half_angle_sigma: 0 deg" not in text
    assert "camera_tilt_sigma: 0 deg" not in text
    assert found.camera.tilt < math.radians(0.3)
    assert main(["localize", str(tmp_path / "0.png"), "--scene", str(tmp_path / "calibrated.yaml")]) == 0


def test_the_scene_that_is_calibrated_is_not_written_over(own, capsys):
    command = ["calibrate", own / "frames", "--scene", own / "my.yaml", "--out", own / "my.yaml"]
    assert main([*map(str, command)]) == 2
    assert "is the scene that is calibrated" in capsys.readouterr().err
    command[-1] = own / "other.yaml"
    assert main([*map(str, command)]) == 2  # two frames are too few
    assert "at least three frames" in capsys.readouterr().err
    assert not (own / "other.yaml").exists()


def test_where_the_first_frame_does_not_fit_its_sentence_stands_alone(own, tmp_path, capsys):
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((9, 9), np.uint16))
    assert localize(own, tmp_path / "small.png", "--alarm", "0.1 mm", "--csv", tmp_path / "x.csv") == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    assert not (tmp_path / "x.csv").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--csv", "f.png"], "f.png: is a frame that FRAMES reads; choose another --csv"),
        (["--json", "link"], "link: is a frame that FRAMES reads; choose another --json"),
        (["--mcap", "my.yaml"], "my.yaml: is the scene that --scene reads; choose another --mcap"),
        (["--tum", "curve.csv"], "curve.csv: is a file that --scene names; choose another --tum"),
        (["--csv", "dark.png", "--reference", "dark.png"], "is a frame that --reference reads; choose another --csv"),
        (["--csv", "x", "--json", "./x"], "x: is what --csv writes, too; choose another --json"),
        (["--csv", "o/x.png", "--overlay", "o"], "o/x.png: may be a picture of --overlay, too; choose another --csv"),
        (["--overlay", "."], ".: holds what FRAMES reads; choose another --overlay"),
        (["--csv", "/proc/x.csv"], "/proc/x.csv: cannot be written: No such file or directory; choose another --csv"),
        (["--csv", "/dev/null"], "/dev/null: cannot be written: is a device or a pipe, no file; choose another --csv"),
        (["--overlay", "my.yaml/seen"], "cannot be made: my.yaml is no folder; choose another --overlay"),
    ],
)
def test_what_is_read_is_never_written_over_and_what_cannot_be_written_is_said_first(
    own, tmp_path, monkeypatch, capsys, options, said
):
    monkeypatch.chdir(tmp_path)
    for name, source in (("f.png", "frames/frame_0.png"), ("dark.png", "dark.png")):
        (tmp_path / name).write_bytes((own / source).read_bytes())
    (tmp_path / "link").symlink_to("f.png")
    (tmp_path / "curve.csv").write_text("nm,x\n")
    (tmp_path / "my.yaml").write_text(MY_YAML)
    named = ["--set", "scene.camera.calibration=curve.csv"] if "curve.csv" in options else []
    monkeypatch.setattr(own_frames, "OwnFrames", lambda *_: SimpleNamespace(scene=None, localizer="cone", columns=()))
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    assert main(["localize", "f.png", "--scene", "my.yaml", *options, *named]) == 2
    assert said in capsys.readouterr().err
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_calibrated_scene_is_not_written_over_a_frame(own, capsys):
    frame = own / "frames" / "frame_0.png"
    command = ["calibrate", own / "frames", "--scene", own / "my.yaml", "--out", frame]
    assert main([*map(str, command)]) == 2
    assert "frame_0.png: is a frame that FRAMES reads; choose another --out" in capsys.readouterr().err


def test_names_are_told_apart_and_obeyed_by_no_terminal(own, tmp_path, monkeypatch, capsys):
    """Frames of one name in two folders, and one whose name has a line's end, an escape and a byte that is no text."""
    monkeypatch.setattr(own_frames, "locate", lambda *_, **__: LocalizationFailure("too dim"))
    monkeypatch.chdir(tmp_path)
    for name in ("d1/f.png", "d2/f.png", "d2/a\n\x1b[2J\udcff$x$.png"):
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_bytes((own / "dark.png").read_bytes())
    assert localize(own, "d1", "--csv", "x.csv", "--overlay", "seen", "d2") == 1  # an option between frames, too
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(" ")[0] for line in lines[1:]] == ["d1/f.png", r"a\n\x1b[2J\xff$x$.png", "d2/f.png"]
    assert sorted(path.name for path in Path("seen").iterdir())[1:] == ["d1-f.png.png", "d2-f.png.png"]
    assert r"\xff$x$.png" in Path("x.csv").read_text("utf-8")


@pytest.mark.parametrize(
    ("command", "options", "said"),
    [
        ("localize", ["--false-safe", "0.01"], "--false-safe: is the chance of an --alarm; give --alarm DISTANCE"),
        ("track", ["--smooth", "0"], "argument --smooth: must be a whole number, 1 to 100"),
        ("localize", ["--tum", "x.tum"], "has no time stamp, which --tum needs"),
        ("localize", ["--typo"], "unrecognized arguments: --typo"),
    ],
)
def test_options_that_cannot_be_are_a_sentence_without_a_table(
    own, tmp_path, monkeypatch, capsys, command, options, said
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(own_frames, "locate", lambda *_, **__: LocalizationFailure("too dim"))
    try:
        code = main([command, str(own / "dark.png"), "--scene", str(own / "my.yaml"), *options])
    except SystemExit as end:
        code = end.code
    heard = capsys.readouterr()
    assert (code, heard.out) == (2, "")
    assert said in heard.err
    assert not list(tmp_path.iterdir())
