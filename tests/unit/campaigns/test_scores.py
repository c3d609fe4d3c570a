"""campaigns.scores: other people's estimates, hostile until validated, join the rows and leave the journal alone."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from conespot.campaigns.begun import plan_of
from conespot.campaigns.export import INDEX, _write_index, make_export
from conespot.campaigns.exporter import png
from conespot.campaigns.frame_names import FILE, FrameNames
from conespot.campaigns.pack import pack
from conespot.campaigns.plan import make_plan
from conespot.campaigns.pool import LocalPool
from conespot.campaigns.row import Finding, Record
from conespot.campaigns.schema import read_campaign
from conespot.campaigns.scores import NO_ESTIMATE, read_score
from conespot.campaigns.scoring import score
from conespot.campaigns.session import report
from conespot.campaigns.store import open_store
from conespot.campaigns.verify import verify
from conespot.results import writing
from conespot.scene import InputError, load_scene

CAMPAIGN = """\
scene: {preset: paper, camera: {resolution: 300}}
trajectory: random
poses: 4
localizers: [paper]
seed: 730911
sweep:
  knowledge: [{}, {rcm_error: 0.1 mm, reference: 1}]
"""
HEADER = "frame,x_mm,y_mm,z_mm,axis_x,axis_y,axis_z,reason\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A run whose localizer found nothing; three of its four poses are finished, one of those is lost."""
    home = tmp_path_factory.mktemp("scores")
    (home / "c.yaml").write_text(CAMPAIGN)
    document = read_campaign(str(home / "c.yaml"))
    plan = make_plan(document)
    folder = home / "run"
    with open_store(folder, plan, document) as store:
        for unit in list(plan.units())[:3]:
            cases = plan.groups[unit.group].cases
            findings = tuple(Finding(case=c.key, localizer="paper", reason="nothing found") for c in cases)
            lost = {"error": "the worker died"} if unit.pose == 2 else {"findings": findings}
            store.append(Record(unit=unit.key, **lost))
        store.write_rows()
    FrameNames.begun(folder, plan)
    return folder


@pytest.fixture
def run(made, tmp_path, monkeypatch):
    """A copy of it, whose report draws no figures."""
    monkeypatch.setattr(writing, "plan_figures", lambda run, boxes: ([], 0))
    return Path(shutil.copytree(made, tmp_path / "run"))


@pytest.fixture(scope="module")
def names(made):
    """The names of its exported frames by case, from 1, and pose."""
    plan = plan_of(made)
    found = FrameNames.of(made, plan)
    return {(number, i): found.frame(case, i) for number, case in enumerate(plan.cases, start=1) for i in range(4)}


def scored(run, text, name="theirs"):
    path = run.parent / "estimates.csv"
    path.write_text(text)
    return score(run, path, name)


def rows(run):
    frame = pd.read_csv(run / "errors.csv", keep_default_na=False)
    return frame[frame["localizer"] == "theirs"]


def test_estimates_join_the_rows_and_what_is_refused_left_out_or_lost_is_counted(run, names):
    journal, own = (run / "journal.jsonl").read_bytes(), pd.read_csv(run / "errors.csv")
    pose = plan_of(run).groups[0].pose(0)
    tip = ",".join(map(repr, (pose.apex + [0.0, 0.03, 0.04]).tolist()))
    axis = ",".join(map(repr, pose.axis.tolist()))
    said = scored(
        run, f"{HEADER}{names[1, 0]},{tip},{axis},\n{names[1, 1]},,,,,,,too dim\n{names[2, 0]},{tip},{axis}\n"
    )
    assert said == "theirs: 2 of 4 frames localized, 1 refused with a reason, 1 left out"
    found = rows(run)
    assert found["reason"].tolist() == ["", "too dim", "the worker died", "", NO_ESTIMATE, "the worker died"]
    errors = pd.to_numeric(found["position_error_mm"]).dropna().to_numpy()
    np.testing.assert_allclose(errors, [0.05, 0.05], rtol=1e-9)
    assert "theirs" in (run / "tables" / "tables.txt").read_text()
    assert (run / "journal.jsonl").read_bytes() == journal
    again = pd.read_csv(run / "errors.csv")
    pd.testing.assert_frame_equal(again[again["localizer"] == "paper"].reset_index(drop=True), own)


def test_a_packed_run_is_verified_with_its_scores_and_a_row_that_no_estimate_made_is_found(run, names):
    scored(run, f"frame,x_mm,y_mm,z_mm\n{names[1, 0]},1,1,5\n")
    pack(run, run.parent / "true.zip")
    assert verify(run.parent / "true.zip", 0, 1, LocalPool(1)).wrong == []
    text = (run / "errors.csv").read_text()
    (run / "errors.csv").write_text(text.replace(",theirs,", ",better,"))
    pack(run, run.parent / "forged.zip")
    assert any("errors.csv" in sentence for sentence in verify(run.parent / "forged.zip", 0, 1, LocalPool(1)).wrong)


def test_a_score_survives_a_report_is_replaced_by_its_name_and_goes_with_its_file(run, names):
    scored(run, f"frame,x_mm,y_mm,z_mm\n{names[1, 0]},1,1,5\n")
    first = (run / "errors.csv").read_bytes()
    report(run)
    assert (run / "errors.csv").read_bytes() == first
    scored(run, f"frame,x_mm,y_mm,z_mm\n{names[1, 1]},1,1,5\n")
    assert rows(run)["reason"].tolist()[:2] == [NO_ESTIMATE, ""]
    (run / "scores" / "theirs.csv").unlink()
    report(run)
    assert rows(run).empty


def test_without_an_axis_it_is_the_line_from_the_rcm(run, names):
    pose = plan_of(run).groups[0].pose(0)
    (run / "e.csv").write_text(f"frame,x_mm,y_mm,z_mm\n{names[1, 0]},{','.join(map(repr, pose.apex.tolist()))}\n")
    found = read_score(run / "e.csv", "theirs", run, plan_of(run))
    np.testing.assert_allclose(next(iter(found.values())).axis, pose.axis, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "is empty; a header frame,x_mm,y_mm,z_mm is needed"),
        ("frame,x_um,y_um,z_um\nF,1,1,5\n", ":1: the column x_um is not in millimetres"),
        ("frame,x_mm,y_mm\nF,1,1\n", ":1: no column z_mm"),
        ("frame,x_mm,y_mm,z_mm\n001-00000-00000000,1,1,5\n", ":2: '001-00000-00000000' is no frame"),
        ("frame,x_mm,y_mm,z_mm\nF,1,1,5\nF,1,1,5\n", ":3: the frame F stands in line 2 too"),
        ("frame,x_mm,y_mm,z_mm\nF,1,nan,5\n", ":2: the tip (1, nan, 5) is none; leave the line out"),
        ("frame,x_mm,y_mm,z_mm\nF,1,inf,5\n", ":2: the tip (1, inf, 5) is none"),
        ("frame,x_mm,y_mm,z_mm\nF,1,one,5\n", ":2: 'one' is no number"),
        ("frame,x_mm,y_mm,z_mm\nF,1,1\n", ":2: a cell is empty"),
        ("frame,x_mm,y_mm,z_mm\nF,0.001,0.001,0.005\n", "within 0.0052 mm of the posterior pole; give millimetres"),
        ("frame,x_mm,y_mm,z_mm\nF,1000,1000,5000\n", "beyond 5.2e+03 mm of the posterior pole; give millimetres"),
        (f"{HEADER}F,1,1,5,0,0,-9\n", ":2: the axis has a length of 9; give a unit vector"),
        (f"{HEADER}F,1,1,5,0,0,1\n", ":2: the axis points from the tip back to the RCM"),
        (f"{HEADER}F,1,1,5,0,0,-1,lost\n", ":2: has both numbers and a reason"),
    ],
)
def test_what_is_not_valid_is_a_sentence_and_nothing_is_written(run, names, text, says):
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    with pytest.raises(InputError) as error:
        scored(run, text.replace("F", names[1, 0]))
    assert says.replace("F", names[1, 0]) in str(error.value)
    assert {path: path.read_bytes() for path in run.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("name", ["paper", "cone", "../theirs", ".hidden", "", "x" * 60])
def test_a_name_that_is_taken_or_none_is_refused(run, names, name):
    with pytest.raises(InputError, match="--name"):
        scored(run, f"frame,x_mm,y_mm,z_mm\n{names[1, 0]},1,1,5\n", name)
    assert not (run / "scores").exists()


def test_frames_of_a_run_that_exported_none_are_asked_for(run):
    (run / FILE).unlink()
    with pytest.raises(InputError, match="no frames of this run were exported; `campaign export"):
        scored(run, "frame,x_mm,y_mm,z_mm\n001-00000-00000000,1,1,5\n")


def test_the_frames_of_another_run_are_not_scored_as_this_ones(run, names):
    (run / FILE).write_text('{"secret": "' + "0" * 32 + '"}')
    with pytest.raises(InputError, match="is no frame that was exported from"):
        scored(run, f"frame,x_mm,y_mm,z_mm\n{names[1, 0]},1,1,5\n")


def test_an_export_tells_what_localizers_are_told_and_nothing_that_leads_to_the_truth(run, names, tmp_path):
    plan, frames = plan_of(run), tmp_path / "frames"
    (frames / "scenes").mkdir(parents=True)
    assert _write_index(plan, list(plan.units())[:2], FrameNames.of(run, plan), frames) == 4
    make_export(frames)  # goes on with it
    index = pd.read_csv(frames / INDEX)
    assert set(index["frame"]) == {names[case, pose] for case in (1, 2) for pose in (0, 1)}
    # told an RCM of its own at each pose, or the scene's
    told = [load_scene(frames / scene).instrument.rcm for scene in index["scene"]]
    np.testing.assert_allclose(told, index[["rcm_x_mm", "rcm_y_mm", "rcm_z_mm"]], rtol=1e-11)
    assert [scene.count("-") for scene in index["scene"]] == [0, 2, 0, 2]
    assert index["unlit"].notna().tolist() == [False, True, False, True]
    written = "".join(path.read_text() for path in frames.rglob("*") if path.is_file()).lower()
    for word in ("seed", "730911", "trajectory", "random", "true", "apex", "tip_", *(case.key for case in plan.cases)):
        assert word not in written, word
    for group in plan.groups:
        assert group.key not in written
        for number in group.positions.ravel().tolist():
            assert f"{number:.4f}" not in written


@pytest.mark.parametrize("folder", ["images", "frames"])
@pytest.mark.parametrize("name", ["index.csv", "mine.txt"])
def test_an_export_is_not_written_over_somebodys_own_files(tmp_path, folder, name):
    own = tmp_path / folder / name
    own.parent.mkdir()
    own.write_text("frame,label\n")
    with pytest.raises(InputError, match=f"holds '{name}', which is no export's; choose another --frames"):
        make_export(own.parent)
    assert own.read_text() == "frame,label\n"
    assert list(own.parent.iterdir()) == [own]


def test_pixel_values_go_into_a_png_unchanged_with_nothing_beside_them(tmp_path):
    import cv2

    rng = np.random.default_rng(1)
    for image in (rng.integers(0, 4096, (5, 7, 3), np.uint16), rng.integers(0, 256, (5, 7), np.uint8)):
        data = png(image, tmp_path / "a.png")
        back = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        np.testing.assert_array_equal(back[..., ::-1] if image.ndim == 3 else back, image)
        chunks, at = set(), 8
        while at < len(data):
            chunks.add(data[at + 4 : at + 8])
            at += 12 + int.from_bytes(data[at : at + 4])
        assert chunks == {b"IHDR", b"IDAT", b"IEND"}
