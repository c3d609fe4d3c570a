"""A stranger's run folder: its words are escaped, its links are not followed, its pipes not waited for."""

import os

import pytest

from conespot.results import load_run, write_results
from conespot.scene import InputError

SCRIPT = "<script>alert('1')</script> \"&amp;\" $\\frac{$ | {{ 7 * 7 }}"


def test_every_word_of_a_run_is_escaped_in_its_report(tmp_path, make_rows, make_run, make_campaign, make_cases):
    frame = make_rows(poses=2, powers=(1.0,), trajectories=("box",), failing=0.5)
    frame.loc[0, ["status", "reason"]] = "failed", SCRIPT
    frame = frame[frame["spotlights"] == frame["spotlights"].iloc[0]].assign(surface=SCRIPT)
    described = [{**case, "labels": {**case["labels"], "surface": SCRIPT}} for case in make_cases(frame)]
    for case in described:
        case["assumes"] = {**case["assumes"], "edge": SCRIPT}
    document = make_campaign(name=SCRIPT, description=SCRIPT, made_with={SCRIPT: SCRIPT})
    folder = make_run(tmp_path / "run", frame, described=described, document=document)
    write_results(folder)
    report = (folder / "report.html").read_text()
    assert SCRIPT not in report
    assert "<script>alert" not in report
    assert "alert(&#39;1&#39;)" in report
    assert "49" not in report.split("<title>")[1].split("</title>")[0]
    for drawing in (folder / "figures").glob("*.svg"):
        assert "<script" not in drawing.read_text()


@pytest.mark.parametrize("name", ["cases.jsonl", "campaign.yaml", "errors.parquet"])
def test_a_pipe_in_a_file_s_place_is_not_waited_for(tmp_path, make_rows, make_run, name):
    folder = make_run(tmp_path / "run", make_rows(poses=2, powers=(1.0,), trajectories=("box",)))
    (folder / name).unlink()
    os.mkfifo(folder / name)
    with pytest.raises(InputError):
        load_run(folder)


@pytest.mark.parametrize("name", ["cases.jsonl", "errors.parquet", "campaign.yaml"])
def test_a_link_to_what_never_ends_is_refused(tmp_path, make_rows, make_run, name):
    folder = make_run(tmp_path / "run", make_rows(poses=2, powers=(1.0,), trajectories=("box",)))
    (folder / name).unlink()
    (folder / name).symlink_to("/dev/zero")
    with pytest.raises(InputError):
        load_run(folder)


@pytest.mark.slow
def test_a_report_goes_beside_a_link_and_not_through_it(tmp_path, make_rows, make_run):
    folder = make_run(tmp_path / "run", make_rows(poses=2, powers=(1.0,), trajectories=("box",)))
    (tmp_path / "theirs").write_text("untouched")
    for name in ("report.html", "boxes.csv"):
        (folder / name).symlink_to(tmp_path / "theirs")
    write_results(folder)
    assert (tmp_path / "theirs").read_text() == "untouched"
    assert not (folder / "report.html").is_symlink()
